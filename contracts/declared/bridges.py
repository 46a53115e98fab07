"""Bridges: instruments that a driver of another library, or a control system, reaches; the names of these drivers.

`pymeasure:keithley.Keithley2400` and `qcodes:qcodes.instrument_drivers.Keithley.Keithley2450` are classes;
`ophyd:LAB:BATH` is an EPICS process variable, or the begin of several; `secop:HOST:PORT/MODULE/PARAMETER` is a module
of a SECoP node.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, NamedTuple

SECOP_PORT = 10767
_ANSWER_S = 10.0  # longest wait unless a file says another: libraries have timeouts of their own; chosen
_CLASS = r"[A-Za-z_][A-Za-z0-9_]*(?:\.[A-Za-z_][A-Za-z0-9_]*)+"
_SECOP = (
    r"(?P<host>[A-Za-z0-9](?:[A-Za-z0-9.-]*[A-Za-z0-9])?)(?::(?P<port>[0-9]{1,5}))?"
    r"/(?P<module>[A-Za-z_]\w*)(?:/(?P<parameter>[A-Za-z_]\w*))?"
)
_FORMS = {
    "pymeasure": (_CLASS, "MODULE.CLASS of pymeasure.instruments: pymeasure:keithley.Keithley2400"),
    "qcodes": (_CLASS, "PACKAGE.MODULE.CLASS: qcodes:qcodes.instrument_drivers.Keithley.Keithley2450"),
    "ophyd": (r"[!-~]{1,60}", "a process variable, or the begin of several: ophyd:LAB:BATH"),
    "secop": (_SECOP, "HOST:PORT/MODULE or HOST:PORT/MODULE/PARAMETER: secop:localhost:10767/cryo"),
}
PATTERN = r"^(|(pymeasure|qcodes|ophyd|secop):\S+)$"
"""Of the key `bridge` of a file."""


class Bridged(NamedTuple):
    """The driver of a bridge.

    Attributes:
        kind: library or control system.
        what: class, process variable, or module.
        parameter: the parameter of a SECoP module that is read; "" if none is named.
        address: where it is, if the driver's name says it; "" otherwise.
    """

    kind: str
    what: str
    parameter: str = ""
    address: str = ""

    @property
    def model(self) -> str:
        """Its model in a file that names none."""
        return self.what.rpartition(".")[2] if self.kind in ("pymeasure", "qcodes") else self.what


def is_bridge(driver: str) -> bool:
    """Whether a driver is that of a bridge."""
    return "\n" not in driver and driver.partition(":")[0] in _FORMS and ":" in driver


def bridged(driver: str) -> Bridged:
    """The parts of a bridge's driver. Raises `ValueError` if it is none."""
    kind, _, what = driver.partition(":")
    form, means = _FORMS[kind]
    found = re.fullmatch(form, what, re.ASCII)
    if found is None:
        raise ValueError(f"{driver!r} should be {kind}: and {means}")
    if kind == "secop":
        port = int(found["port"] or SECOP_PORT)
        return Bridged(kind, found["module"], found["parameter"] or "", f"socket://{found['host']}:{port}")
    return Bridged(kind, what, address=f"epics:{what}" if kind == "ophyd" else "")


def completed(given: Mapping[str, Any]) -> dict[str, Any]:
    """The table of a bridge, with what its driver says. Raises `ValueError`."""
    try:
        found = bridged(str(given["bridge"]))
    except (ValueError, KeyError) as error:
        raise ValueError(f"bridge: {error}") from None
    wire = given.get("wire", {})
    made = {"identity": {"ask": "identity"}, **given}
    made["wire"] = {"timeout_s": _ANSWER_S, **wire} if isinstance(wire, dict) else wire
    if not made.get("model"):
        made["model"] = found.model
    source, reader = made.get("source"), made.get("reader")
    if isinstance(reader, dict) and "reading" not in reader and not reader.keys() & {"fetch", "channels"}:
        own = found.parameter or ("value" if found.kind in ("ophyd", "secop") else "")
        made["reader"] = {**reader, "reading": own} if own else reader
    if isinstance(source, dict) and isinstance(source.get("set"), str) and not re.search(r"[=({]", source["set"]):
        made["source"] = {**source, "set": f"{source['set']} = {{value}}"}
    return made
