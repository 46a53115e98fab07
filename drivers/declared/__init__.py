"""Drivers of instruments that are tables: one class is made of each file."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, Field, create_model

from rig.contracts.declared.instrument import Instrument, parse
from rig.contracts.declared.scan import Scan
from rig.drivers.declared.base import Declared, Remembering
from rig.drivers.declared.reader import DeclaredReader, OneByOneReader, ScanningReader
from rig.drivers.declared.source import DeclaredSource
from rig.drivers.scpi import INTERFACE, Interface, one_of
from rig.drivers.wires import SerialOptions
from rig.drivers.wires.serial_options import Flow, LineSettings
from rig.drivers.wires.serial_port import Frame


class _Options(SerialOptions):
    """Options in a bench file of any declared instrument on a line of text."""

    def settings(self, address: str) -> LineSettings:
        """Settings of its line at an address."""
        own: Any = self  # of the made class
        end = self.send_end if "line_end" in self.model_fields_set else None
        serial = getattr(own, "interface", "rs232") == "rs232"
        return LineSettings(own.baud, own.frame, self.flow_at(address), end, serial)


class _Plain(BaseModel, extra="forbid"):
    """Options in a bench file of any declared instrument without lines of text."""


def options_of(table: Instrument) -> type[Any]:
    """The options of an instrument in a bench file: its wire, its parameters, limits within its own."""
    fields: dict[str, Any] = {}
    wire = table.wire
    if table.lines:
        fields["baud"] = (int, Field(wire.baud, ge=300, le=921600, description="symbols per second"))
        fields["frame"] = (Frame, Field(wire.frame, description="data bits, parity, stop bits"))
        fields["flow"] = (Flow, Field(wire.flow, description="flow control: none, rtscts, xonxoff or dsrdtr"))
    if table.wire.remote:
        fields["interface"] = (Interface, Field("rs232", description=INTERFACE))
    for name, default in ((name, one) for name, one in table.parameters.items() if name not in table.asked):
        fields[name] = (type(default), Field(default, description="parameter of its file"))
    for name, meaning in table.optional.items():
        fields[name] = (float | None, Field(None, description=meaning))
    for name in table.choices.keys() & fields.keys():
        kind, described = fields[name]
        fields[name] = (Annotated[kind, AfterValidator(one_of(*table.choices[name]))], described)
    if table.reader is not None and table.reader.channels:
        known = tuple(table.reader.channels)
        fields["channels"] = (tuple[str, ...], Field(known, description=f"channels that are read: {', '.join(known)}"))
    if table.scan is not None:
        fields |= _of_scan(table.scan, fields)
    if table.source is not None:
        source = table.source
        for name in ("low", "high", "safe_value"):
            described = Field(
                getattr(source, name), ge=source.low, le=source.high, description=f"{name} of this one, within its own"
            )
            fields[name] = (float | None, described)
        for name in ("tolerance", "dwell_s", "time_constant_s"):
            fields[name] = (float | None, Field(getattr(source, name), ge=0.0, description=f"{name} of this one"))
        if source.rest is not None:
            said = "lowest and highest reading while it is off"
            fields["rest"] = (tuple[float, float], Field(source.rest, description=said))
    base: Any = _Options if table.lines else _Plain
    made: type[Any] = create_model("Options", __base__=base, **fields)
    return made


def _of_scan(scan: Scan, parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Options of channels that the bench file chooses; those with a value of their own take that of a parameter."""

    def of(kind: Any, check: Any, **more: Any) -> Any:
        return Annotated[dict[str, kind], AfterValidator(check)], Field(**more)

    sort = Annotated[str, AfterValidator(one_of(*scan.sorts))]
    said = f"channel ({', '.join(scan.cards)}) to what is connected: {', '.join(scan.sorts)}"
    found = {"channels": of(sort, scan.checked, min_length=1, description=said)}
    own = scan.own().items()
    return found | {
        o: of(parameters[n][0], scan.able, default={}, description=f"{n} of single channels") for o, n in own
    }


@cache
def driver_of(text: str, *, own: bool = True) -> type[Declared]:
    """The driver of an instrument's file, one of a user's `own` or one that is supplied.

    Raises:
        ValueError: with all that is wrong with the file.
    """
    table = parse(text)
    bases: list[type[Declared]] = [Remembering] if table.remembers else []
    if table.reader is not None:
        asked = (table.reader.reading.ask if table.reader.reading is not None else None) or ""
        several = len(table.reader.channels) > 1 and (
            table.reader.select or "{channel}" in asked or any(one.reading for one in table.reader.channels.values())
        )
        bases.append(OneByOneReader if several else ScanningReader if table.scan is not None else DeclaredReader)
    bases += [DeclaredSource] if table.source is not None else []
    words = "".join(c if c.isalnum() else "_" for c in f"{table.maker}_{table.model[0]}")
    told = {key: getattr(table.source, key, None) for key in ("time_constant_s", "rest")}
    members: dict[str, Any] = {
        "table": table,
        "wire": "bridge" if table.bridge else "serial" if table.lines else table.wire.protocol,
        "coarse": table.coarse,
        "shares": table.bridge.startswith("secop:")
        or bool(table.wire.preamble or table.wire.shared)
        or any(f"{{{name}" in table.wire.request for name in table.parameters),
        "own": own,
        "supplied": {key: one for key, one in told.items() if one is not None},
        "Options": options_of(table),
    }
    return type(words, tuple(bases), members)
