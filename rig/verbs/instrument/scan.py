"""Who answers at named addresses: identity questions of declared instruments, and nothing else."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rig.bench.plugins import declared, driver_class
from rig.contracts.declared.instrument import parse
from rig.drivers.clock import Clock
from rig.drivers.errors import DriverError, NoReply, Unreachable
from rig.drivers.wires import Wires
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


class Place:
    """An address for its lock."""

    def __init__(self, address: str) -> None:
        self.address = address


def scan(address: str, clock: Clock, only: Sequence[str] = ()) -> Iterator[tuple[str, str]]:
    """Drivers whose instrument answers at an address, each with its identity in words.

    Args:
        address: one that the user has named.
        clock: bench time.
        only: drivers to look for; all declared ones if empty.

    Raises:
        BusyError: another controller uses it.
        Unreachable: it cannot be opened.
    """
    modbus, silent = address.startswith("modbus-"), set()
    texts = {name: text for name, text in declared().items() if not only or name in only}
    if not modbus and not only:
        texts = {"*IDN?": SCPI, **texts}
    with locked_addresses({"scan": Place(address)}):
        for name, text in texts.items():
            table = parse(text)
            if table.modbus != modbus or table.wire.protocol == "stream" or table.wire.preamble:
                continue
            wire, question = table.wire, str(table.identity).partition("answer=")[0]
            key = (question, wire.send_end, wire.request, () if "://" in address else (wire.baud, wire.frame))
            if key in silent:
                continue
            driver = driver_class(text)
            wires = Wires(clock)
            try:
                found = driver(name, address, driver.Options(), wires, clock).identify()
            except Unreachable:
                raise
            except NoReply:
                silent.add(key)
                continue
            except DriverError as error:
                if name == "*IDN?":
                    yield name, str(error)
                continue
            finally:
                wires.close()
            yield name, f"{found.maker} {found.model} {found.serial}".strip()
