"""Who answers at named addresses: identity questions of declared instruments, and nothing else."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

from rig.bench.plugins import declared, driver_class
from rig.contracts.declared.instrument import Instrument, parse
from rig.drivers.clock import Clock
from rig.drivers.declared.known_lines import question_of
from rig.drivers.errors import BadReply, DriverError, NoReply, Unreachable
from rig.drivers.wires import SerialSettings, Wires
from rig.instruments.locks import locked_addresses

SCPI = """
maker = ""
model = ["any"]
[identity]
ask = "*IDN?"
answer = "{text}"
[reader]
unit = "V"
reading = "READ?"
[wire]
timeout_s = 1
"""
"""Anything that answers the question of IEEE 488.2."""
LISTENS_S = 1.5
"""Silence after all questions for one setting of a line from which on nobody is there; chosen."""
_APART_S = 0.02


class Place:
    """An address for its lock."""

    def __init__(self, address: str) -> None:
        self.address = address


def scan(address: str, clock: Clock, only: Sequence[str] = ()) -> Iterator[tuple[str, str]]:
    """Drivers whose instrument answers at an address, each with its identity in words.

    All questions are sent one after the other first: where nothing comes back, each is not waited for on its own.

    Args:
        address: one that the user has named.
        clock: bench time.
        only: drivers to look for; all declared ones if empty.

    Raises:
        BusyError: another controller uses it.
        NoReply: nothing at all came back.
        Unreachable: it cannot be opened.
    """
    texts = {name: text for name, text in declared().items() if not only or name in only}
    if not address.startswith(("modbus-", "can:")) and not only:
        texts = {"*IDN?": SCPI, **texts}
    tables = {name: parse(text) for name, text in texts.items()}
    tables = {name: one for name, one in tables.items() if _asked_at(one, address)}
    silent: set[tuple[object, ...]] = set()
    missing: NoReply | None = None
    known = False
    with locked_addresses({"scan": Place(address)}):
        if not address.startswith(("modbus-", "visa://", "can:")):
            _heard(address, tables.values(), clock)
        for name, table in tables.items():
            wire, question = table.wire, str(table.identity).partition("answer=")[0]
            key = (question, wire.send_end, wire.request, () if "://" in address else (wire.baud, wire.frame))
            if key in silent:
                continue
            driver = driver_class(texts[name])
            wires = Wires(clock)
            try:
                found = driver(name, address, driver.Options(), wires, clock).identify()
            except Unreachable:
                raise
            except NoReply as error:
                if table.modbus:  # a device that is there answers every question, at least that it has no such register
                    raise
                silent.add(key)
                missing = error if table.can else missing
                continue
            except DriverError as error:
                if name == "*IDN?":
                    yield name, str(error)
                continue
            finally:
                wires.close()
            known = True
            yield name, f"{found.maker} {found.model} {found.serial}".strip()
    if missing is not None and not known:  # it says what is heard on the bus instead
        raise missing


def _asked_at(table: Instrument, address: str) -> bool:
    wire = table.wire
    medium = "modbus" if address.startswith("modbus-") else "can" if address.startswith("can:") else "text"
    return wire.protocol == medium and not wire.preamble


def _heard(address: str, tables: Iterable[Instrument], clock: Clock) -> None:
    """Raise `NoReply` if nothing comes back while and after all questions are sent."""
    groups: dict[SerialSettings, dict[str, None]] = {}
    for table in tables:
        wire, plain = table.wire, SerialSettings(9600, send_end=b"", quiet_s=LISTENS_S, encoding="latin-1")
        own = plain if "://" in address else replace(plain, baud=wire.baud, frame=wire.frame, flow=wire.flow)
        groups.setdefault(own, {})[question_of(table)] = None
    heard: list[bytes] = []
    for settings, questions in groups.items():
        wires = Wires(clock, tap=lambda _, way, data: heard.append(data) if way == "rx" else None)
        try:
            line = wires.serial(address, settings, "scan")
            for question in questions:
                line.write(question)
                clock.sleep(_APART_S)
            with contextlib.suppress(BadReply):  # it sends by itself
                line.drain()
        finally:
            wires.close()
        if heard:
            return
    count = sum(map(len, groups.values()))
    raise NoReply(
        f"{address} is silent: nothing came back to {count} identity questions, within {LISTENS_S:g} s of the last"
        + (f" at each of {len(groups)} settings of the line" if len(groups) > 1 else "")
        + "; is an instrument switched on and connected there?"
    )
