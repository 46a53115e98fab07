"""A simulated bench for other processes, in real time or a multiple of it.

The same twins as in a dry run, behind serial ports and sockets of the operating system. One thread waits for bytes or
for the world's next event, whichever comes first.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import re
import selectors
import signal
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from rig.sims.bench import SimBench, world_for
from rig.sims.tape_file import TapeFile
from rig.sims.twin import MakesTwins
from rig.sims.wires.can_line import on_one_bus
from rig.sims.wires.modbus_line import ModbusEndpoint, registers_of
from rig.sims.wires.ports import Port, PseudoTerminal, Receive, TcpPort
from rig.sims.wires.slcan import SlcanAdapter
from rig.sims.world import Pace

_STOP = frozenset({signal.SIGINT, signal.SIGTERM})
_LOOK_UP_S = 0.5  # period of checks for the end, seconds


def serve(
    bench: Mapping[str, Any],
    truth: Mapping[str, Any],
    twin_classes: Mapping[str, MakesTwins],
    live: Path,
    *,
    world_text: str = "",
    speed: float = 1.0,
    seconds: float | None = None,
    tape: Path | None = None,
    announce: Callable[[str], None] = lambda line: None,
) -> None:
    """Serve a bench until SIGINT, SIGTERM, or its time is up. SIGUSR1 is a power cut: every instrument restarts.

    Args:
        bench: the bench file as plain values.
        truth: the world file as plain values.
        twin_classes: twin class by driver name.
        live: the bench file with the served addresses; written after all ports are open, removed at the end.
        world_text: text of the world file, for `live`.
        speed: virtual seconds per real second.
        seconds: real seconds after which to stop; None for no limit.
        tape: file to which all answers and true events are appended; see `rig.sims.tape_file`. None for no tape.
        announce: called with a line for each instrument and one for the file.

    Raises:
        rig.sims.physics.WorldError: the world file is wrong.
        OSError: `live` or `tape` cannot be written, or a port cannot be opened.
    """
    if os.path.lexists(live):
        raise FileExistsError(
            f"{live} exists: another simulated bench may be serving it; name another file, or remove it if it is stale"
        )
    with contextlib.ExitStack() as held:
        selector = held.enter_context(selectors.DefaultSelector())
        told = held.enter_context(_told(selector))
        world = world_for(bench, truth)
        taped = None if tape is None else held.enter_context(TapeFile(tape, world))
        heard = None if taped is None else taped.happened
        sim = SimBench(world, bench, truth, f"served{os.getpid()}", twin_classes, heard=heard)
        held.callback(sim.close)
        ports: list[Port] = []
        held.callback(_close, ports)
        pace = Pace(world, speed)
        if taped is not None:
            taped.begin(pace, speed)
        given = bench["instruments"]
        instruments = dict(given)
        for names in _wires(sim, {n: i["address"] for n, i in given.items() if sim.twin(n).wire != "none"}):
            addresses = _open(sim, {name: given[name]["address"] for name in names}, selector, ports, taped)
            for name, address in addresses.items():
                instruments[name] = {**given[name], "address": address}
                announce(f"{name}: {address}")
        hands = TcpPort(selector, lambda: Hands(sim).on_rx)
        ports.append(hands)
        about: dict[str, Any] = {"speed": speed, "epoch_utc": pace.epoch_utc, "started_utc": pace.started_utc}
        about |= {"world": world_text, "by_hand": hands.address}
        _write(live, toml({**bench, "simulated": True, "instruments": instruments, "live": about}))
        held.callback(live.unlink, missing_ok=True)
        announce(f"serving until Ctrl-C; use --bench {live}")
        while not told & _STOP and (seconds is None or pace.real_s() < seconds):
            pace.catch_up()
            if signal.SIGUSR1 in told:
                told.discard(signal.SIGUSR1)
                sim.power_cycle()
                announce("power cut: every instrument has restarted")
            until = pace.until_next(_LOOK_UP_S)
            ready = selector.select(until)
            if taped is not None:
                taped.turn(until)
            for key, _ in ready:
                pace.catch_up()
                key.data()


class Hands:
    """One connection of a controller that tells what a person has done: a JSON object a line.

    `{"factor": "mass_g", "value": 20.0}` sets a factor, `{"change": "remount", "number": null}` is a step by hand, and
    `{}` only asks. Each is answered by the number of steps so far. `{"reader": "operator", "channel": "dial"}` is
    answered by what is seen there, `nan` if the world's person does not come.

    Args:
        sim: the bench.
    """

    def __init__(self, sim: SimBench) -> None:
        self._sim, self._heard = sim, b""

    def on_rx(self, data: bytes, tx: Callable[[bytes], None]) -> None:
        """Take bytes of the connection; what makes no sense is answered by "?"."""
        *lines, self._heard = (self._heard + data).split(b"\n")
        for line in lines:
            try:
                told = dict(json.loads(line))
                if "factor" in told:
                    self._sim.plant.set_by_hand(str(told["factor"]), float(told["value"]))
                elif "change" in told:
                    self._sim.by_hand(str(told["change"]), told["number"])
                elif "reader" in told:
                    comes = self._sim.plant.truth.person.comes
                    tx(f"{self._sim.reads(told['reader'], told['channel']) if comes else math.nan!r}\n".encode())
                    continue
            except (ValueError, LookupError, TypeError):
                tx(b"?\n")
            else:
                tx(f"{self._sim.steps}\n".encode())


def _close(ports: list[Port]) -> None:
    for port in ports:
        port.close()


def _wires(sim: SimBench, addresses: Mapping[str, str]) -> list[list[str]]:
    """Names of the instruments on each wire: instruments on one bus or line share it.

    Loops of one controller have one address; each is a separate twin with a separate port.
    """
    wires: dict[tuple[str, str, int], list[str]] = {}
    seen: Counter[str] = Counter()
    for name, address in addresses.items():
        kind = sim.twin(name).wire
        place = {"modbus": address.rpartition("/")[0], "can": address}.get(kind, name)
        wires.setdefault((kind, place, seen[address] if kind == "modbus" else 0), []).append(name)
        seen[address] += 1
    return list(wires.values())


def _open(
    sim: SimBench,
    addresses: Mapping[str, str],
    selector: selectors.BaseSelector,
    ports: list[Port],
    tape: TapeFile | None,
) -> dict[str, str]:
    """Open a port for the instruments on one wire; returns the addresses that replace those of the bench file."""
    twins = {name: sim.twin(name) for name in addresses}
    name, first = next(iter(addresses.items()))
    wire = "+".join(addresses)

    def on_tape(receive: Receive) -> Receive:
        return receive if tape is None else tape.wired(wire, receive)

    match twins[name].wire:
        case "serial" if first.startswith(("socket:", "visa:")):
            door = TcpPort(selector, lambda: on_tape(twins[name].on_rx))
            ports.append(door)
            return {name: f"socket://{door.address}"}
        case "serial":
            cable = sim.cables[name]
            terminal = PseudoTerminal(selector, on_tape(lambda data, tx: cable.send(data)))
            cable.attach(terminal.send if tape is None else tape.answering(wire, terminal.send))
            ports.append(terminal)
            return {name: terminal.address}
        case "modbus":
            units = {n: int(address.partition("?")[0].rpartition("/")[2]) for n, address in addresses.items()}
            rtu, over_tcp = first.startswith("modbus-rtu:"), first.startswith("modbus-rtu://socket:")
            devices = {unit: registers_of(twins[n], first) for n, unit in units.items()}

            def end() -> ModbusEndpoint:
                return ModbusEndpoint(sim.world, devices, rtu=rtu)

            on_line = rtu and not over_tcp
            port: Port = (
                PseudoTerminal(selector, on_tape(end().on_rx))
                if on_line
                else TcpPort(selector, lambda: on_tape(end().on_rx))
            )
            ports.append(port)
            scheme = "modbus-rtu://socket" if over_tcp else "modbus-rtu" if rtu else "modbus-tcp"
            return {n: f"{scheme}://{port.address}/{unit}" for n, unit in units.items()}
        case "can":
            bus = on_one_bus(*(twin.on_frame for twin in twins.values()))
            unasked = [twin.connected for twin in twins.values() if hasattr(twin, "connected")]
            adapter = PseudoTerminal(selector, on_tape(SlcanAdapter(bus, unasked).on_rx))
            ports.append(adapter)
            return dict.fromkeys(addresses, f"can:slcan/{adapter.address}")
        case kind:
            raise ValueError(f"{', '.join(addresses)}: a twin of kind {kind!r} cannot be served")


@contextlib.contextmanager
def _told(selector: selectors.BaseSelector) -> Iterator[set[int]]:
    """Received signals; a signal also ends a wait of the selector."""
    told: set[int] = set()
    reading, writing = os.pipe()
    os.set_blocking(reading, False)
    os.set_blocking(writing, False)
    selector.register(reading, selectors.EVENT_READ, lambda: os.read(reading, 100))
    woken_before = signal.set_wakeup_fd(writing)
    heard = (*_STOP, signal.SIGUSR1)
    before = {s: signal.signal(s, lambda number, frame: told.add(number)) for s in heard}
    try:
        yield told
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        signal.set_wakeup_fd(woken_before)
        selector.unregister(reading)
        os.close(reading)
        os.close(writing)


def _write(path: Path, text: str) -> None:
    """Write a file that is either not there or complete."""
    part = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        part.write_text(text, encoding="utf-8")
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def toml(values: Mapping[str, Any]) -> str:
    """Plain values as TOML; None is left out, since TOML has no null."""
    return "\n".join(_table(values, ())).lstrip() + "\n"


def _table(values: Mapping[str, Any], path: tuple[str, ...]) -> Iterator[str]:
    inner = {k: v for k, v in values.items() if isinstance(v, Mapping)}
    own = {k: v for k, v in values.items() if k not in inner and v is not None}
    if path and (own or not inner):
        yield f"\n[{'.'.join(map(_key, path))}]"
    yield from (f"{_key(key)} = {_value(value)}" for key, value in own.items())
    for key, value in inner.items():
        yield from _table(value, (*path, key))


def _key(key: str) -> str:
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else _string(key)


def _string(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _value(value: object) -> str:
    match value:
        case bool():
            return "true" if value else "false"
        case int() | float():
            return repr(value)
        case str():
            return _string(value)
        case list() | tuple():
            return f"[{', '.join(map(_value, value))}]"
    raise TypeError(f"{value!r} has no place in a bench file")
