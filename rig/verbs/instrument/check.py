"""An instrument held against its file, question by question: a twin, or the real one at an address.

Without a setpoint only questions are sent, and what chooses a channel, unless it may be prepared. With a setpoint it is
prepared, set, awaited, and brought to its safe state. A twin that measures is prepared.
"""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from itertools import pairwise
from typing import Any

from rig.bench.bench_file import check_options
from rig.bench.config import BenchConfig, InstrumentConfig, parse_bench
from rig.bench.plugins import driver_class
from rig.contracts.declared.frames import shown as as_frame
from rig.contracts.declared.instrument import Instrument, parse
from rig.contracts.declared.replay import replayed
from rig.drivers.clock import Clock, RealClock
from rig.drivers.declared.base import Setting
from rig.drivers.declared.reader import OneByOneReader
from rig.drivers.errors import ChannelsFailed, DriverError, NotReady
from rig.drivers.roles import Reader, Source, WithUnits
from rig.drivers.wires import Wires
from rig.errors import RigError
from rig.instruments.locks import locked_addresses
from rig.instruments.opening import open_bench
from rig.version import VERSION

NAME = "instrument"
_ADDRESSES = {
    "text": "/dev/rig/instrument",
    "stream": "/dev/rig/instrument",
    "modbus": "modbus-tcp://192.0.2.1/1",
    "can": "can:socketcan/can0",
}
_POLL_S = 1.0
_ROUNDS, _CHANNELS = 3, 3
_NEARER = 3.0
"""How much nearer to the channel before every first reading is if it is old; chosen: noise alone does it in 1 of 5,000
checks of two channels that read the same."""
_UNPREPARED = " (it is not prepared; --prepare prepares it)"
_SHOWN = 12
"""Turns on the wire that are kept at the begin and at the end of a step."""


@dataclass
class Step:
    """One step of a check.

    Attributes:
        what: what was done.
        wire: what went over the wire, as text.
        found: what came of it, a sentence.
        ok: whether it is as the file says.
        differ: of settings that were only read: those that are others than in the file.
    """

    what: str
    wire: list[str] = field(default_factory=list)
    found: str = ""
    ok: bool = True
    differ: int = 0

    @property
    def word(self) -> str:
        """Its result in a word."""
        return "WRONG" if not self.ok else "DIFFERS" if self.differ else "ok"


@dataclass(frozen=True)
class Checked:
    """A check of one instrument.

    Attributes:
        file: its file, and its SHA-256.
        instrument: maker and model in the file.
        address: where it was asked; "twin" if it was simulated.
        at: UTC of its begin.
        steps: in order.
    """

    file: str
    sha256: str
    instrument: str
    address: str
    at: str
    steps: tuple[Step, ...]

    @property
    def ok(self) -> bool:
        """Whether every step is as the file says."""
        return all(step.ok for step in self.steps)

    @property
    def verdict(self) -> str:
        """The result in words."""
        if not self.ok:
            return "NOT as its file says"
        if differ := sum(step.differ for step in self.steps):
            them = "settings differ" if differ > 1 else "setting differs"
            return f"as its file says, but {differ} {them}: it is not prepared (--prepare prepares it)"
        return "as its file says"

    def as_json(self) -> dict[str, Any]:
        """Plain values."""
        steps = [vars(step) for step in self.steps]
        head = {key: getattr(self, key) for key in ("file", "sha256", "instrument", "address", "at")}
        return {**head, "rig": VERSION, "ok": self.ok, "verdict": self.verdict, "steps": steps}

    def report(self) -> str:
        """A page for the files of a laboratory, Markdown."""
        lines = [f"# {self.instrument}, held against its file\n", f"- file: {self.file}, SHA-256 {self.sha256}"]
        lines += [f"- asked: {self.address}", f"- begun: {self.at}", f"- calibration-rig {VERSION}"]
        lines.append(f"- result: {self.verdict}\n")
        for step in self.steps:
            lines.append(f"## {step.what}: {step.word}\n\n{step.found}\n")
            lines += [f"```text\n{chr(10).join(step.wire)}\n```\n"] if step.wire else []
        return "\n".join(lines)


def check(
    text: str,
    name: str,
    address: str,
    options: Mapping[str, Any],
    setpoint: float | None,
    wait_s: float,
    *,
    prepare: bool = False,
) -> Checked:
    """Check an instrument.

    Args:
        text: its file.
        name: the file's name.
        address: where it is; "" for its twin.
        options: further options, as in a bench file.
        setpoint: value to set; None to send only questions, and what chooses a channel.
        wait_s: longest wait until it has settled.
        prepare: whether it is prepared also without a setpoint.

    Raises:
        ConfigurationError: options or address are wrong.
        BusyError: another controller uses the address.
    """
    table, steps, heard = parse(text), [], []

    def tap(_: str, direction: str, data: bytes) -> None:
        binary = table.modbus and not data.startswith(b":")  # Modbus ASCII is text
        shown = data.hex(" ") if binary else as_frame(data) if table.can else repr(data)[2:-1]
        heard.append(f"{'>' if direction == 'tx' else '<'} {shown}")

    wrong = list(replayed(table))
    read = f"{len(table.examples)} questions and answers of the file are read as it says"
    said = "; ".join(wrong) or (read if table.examples else "the file has none")
    steps.append(Step("examples in the file", found=said, ok=not wrong))
    with contextlib.ExitStack() as held:
        try:
            driver, clock = held.enter_context(_opened(text, table, address, options, tap))
        except DriverError as error:
            steps.append(Step("connection", found=str(error), ok=False))
        else:
            every = _steps(driver, table, clock, setpoint, wait_s, twin=not address, prepare=prepare)
            _carried_out(every, steps, heard, table, driver, setpoint)
    digest = hashlib.sha256(text.rstrip("\n").encode()).hexdigest()
    what = f"{table.maker} {', '.join(table.model)}".strip()
    return Checked(
        name,
        digest,
        what,
        address or "its twin",
        f"{datetime.fromtimestamp(RealClock().utc(), UTC):%Y-%m-%d %H:%M:%S} UTC",
        tuple(steps),
    )


def _carried_out(
    every: Iterable[tuple[Step, Callable[[], str]]],
    steps: list[Step],
    heard: list[str],
    table: Instrument,
    driver: Any,
    setpoint: float | None,
) -> None:
    """Add the steps as they are carried out; without the right identity no further one is."""
    try:
        for step, act in every:
            heard.clear()
            try:
                step.found = act() or "done"
            except (DriverError, RigError) as error:
                step.found, step.ok = str(error), False
            step.wire = _joined(heard, apart=table.can)
            steps.append(step)
            if not step.ok and step.what == "identity":
                break
    except BaseException:  # also somebody's Ctrl-C while it settles
        if setpoint is not None and isinstance(driver, Source):
            driver.make_safe()
        raise


def _joined(heard: list[str], *, apart: bool) -> list[str]:
    """Transfers on the wire, a line for each turn; of frames, which are `apart`, each its own."""
    lines: list[str] = []
    for one in heard:
        if lines and lines[-1][0] == one[0] and not apart:
            lines[-1] += one[2:]
        else:
            lines.append(one)
    if len(lines) > 2 * _SHOWN:
        lines[_SHOWN:-_SHOWN] = [f"... {len(lines) - 2 * _SHOWN} lines more"]
    return lines


class _opened:  # noqa: N801 - used as a context
    """The driver at its address or at its twin, and the clock."""

    def __init__(
        self,
        text: str,
        table: Instrument,
        address: str,
        options: Mapping[str, Any],
        tap: Callable[[str, str, bytes], None],
    ) -> None:
        self._config = bench_of(text, table, address or _ADDRESSES[table.wire.protocol], options)
        self._real, self._tap = bool(address), tap

    def __enter__(self) -> tuple[Any, Clock]:
        config = self._config
        checked = check_options(config, NAME)
        if self._real:
            self._lock = locked_addresses({NAME: config.instruments[NAME]})
            self._lock.__enter__()
            clock: Clock = RealClock()
            wires = Wires(clock, tap=self._tap)
            one = config.instruments[NAME]
            self._close: Callable[[], None] = wires.close
            try:
                self._driver = driver_class(one.driver)(NAME, one.address, checked[NAME], wires, clock)
            except BaseException:
                self._lock.__exit__(None, None, None)
                raise
            return self._driver, clock
        from rig.simulated.dry_run import DryBench  # noqa: PLC0415 - a real one never loads the simulation

        dry = DryBench(config, {}, tap=self._tapped)
        # a bridge has a stand-in here, whose options are others
        bench = open_bench(dry.config, check_options(dry.config, NAME), dry.clock, dry.wires)
        self._driver, self._close = bench.instruments[NAME], dry.close
        return self._driver, dry.clock

    def _tapped(self, name: str, direction: str, data: bytes) -> None:
        if name == NAME:
            self._tap(name, direction, data)

    def __exit__(self, *_: object) -> None:
        try:
            self._driver.close()
        finally:
            self._close()
            if self._real:
                self._lock.__exit__(None, None, None)


def bench_of(text: str, table: Instrument, address: str, options: Mapping[str, Any]) -> BenchConfig:
    """A bench with this instrument, on which all its channels are read or its quantity is set."""
    lines = ['name = "check"', f"[instruments.{NAME}]", 'driver = "person"']
    if table.scan is not None:
        options = {"channels": table.scan.first(), **options}
    reader, source = table.chosen(options).reader, table.source
    if reader is not None:
        channels = {name: one.unit or reader.unit for name, one in reader.channels.items()} or {"input": reader.unit}
        for n, (channel, unit) in enumerate(channels.items()):
            lines += [f"[sensors.s{n}]", f'reader = "{NAME}"', f'channel = "{channel}"', f'unit = "{unit}"']
    else:
        lines += ["[instruments.other]", 'driver = "person"', "[sensors.other]", 'reader = "other"', 'channel = "dial"']
        lines.insert(lines.index('driver = "person"', 4) + 1, 'reads = { dial = "V" }\nresolution = { dial = 1 }')
    if source is not None:
        lines += ["[factors]", f'level_{source.unit} = "{NAME}"']
    config = parse_bench("\n".join(lines), "check")
    one = InstrumentConfig.model_validate({"driver": text, "address": address, **options})
    return config.model_copy(update={"instruments": {**config.instruments, NAME: one}})


def _steps(
    driver: Any, table: Instrument, clock: Clock, setpoint: float | None, wait_s: float, *, twin: bool, prepare: bool
) -> Iterator[tuple[Step, Callable[[], str]]]:
    # a twin that measures cannot be hurt
    setting = prepare or setpoint is not None or (twin and not isinstance(driver, Source))
    doubt = ""
    anything: Any = driver

    def identity() -> str:
        found = driver.identify()
        serial = f"serial number {found.serial}" if found.confirmed else "no serial number"
        return f"{found.maker} {found.model}, {serial}, firmware {found.firmware or 'not told'}"

    yield Step("identity"), identity
    if setting:
        yield Step("prepare"), lambda: anything.prepare() or ""
    if table.check or table.healthy or table.ready or table.prepare:
        step = Step("settings")

        def settings() -> str:
            nonlocal doubt
            every = driver.compared()
            told = "; ".join(map(_said, every))
            wrong = [one for one in every if one.declared and not one.same]
            if wrong and setting:
                raise RigError(told)
            step.differ = sum(not one.why_not for one in wrong)
            if wrong:
                doubt = ". Its settings are others than those of the file: unit and range of this are not known"
            elif not setting and not all(one.same for one in every):
                doubt = _UNPREPARED
            return told

        yield step, settings
    starts = [key for key in ("start", "number") if getattr(table.reader, key, ())]
    if isinstance(driver, Reader) and starts and not setting:
        yield Step("readings"), lambda: f"none: reader.{starts[0]} is a command, and only questions are sent"
    elif isinstance(driver, Reader):
        yield (
            Step("three readings of each channel" if len(driver.channels()) > 1 else "three readings"),
            (lambda: _readings(driver, doubt)),
        )
        if isinstance(driver, OneByOneReader) and len(driver.channels()) > 1:
            yield Step("first reading after choosing"), lambda: _first(driver.twice_each(_ROUNDS, _CHANNELS))
    if isinstance(driver, Source):

        def state() -> str:
            found = driver.read()
            on = "on" if found.output else "off"
            settled = "settled" if found.settled else "not settled"
            return f"setpoint {found.setpoint:g}, reads {found.value:g} {driver.unit()}, {on}, {settled}{doubt}"

        yield Step("state"), state
    if unseen := driver.unwatched():
        yield Step("not watched"), lambda: f"nothing shows {'; '.join(unseen)}"
    if told := driver.without_point():
        yield Step("numbers without a decimal point"), lambda: "; ".join(told)
    if isinstance(driver, Source) and setpoint is not None:
        took = Step(f"set {setpoint:g} {driver.unit()}")
        yield took, lambda: anything.set(setpoint) or ""
        if took.ok:
            yield Step("settle"), lambda: _settled(driver, clock, wait_s)
        yield Step("safe state"), lambda: _safe(driver, clock, wait_s) + state()


def _readings(driver: Any, doubt: str) -> str:
    """Three readings of each channel. Raises `RigError` if some have none."""
    driver.start(3)
    units, failed = driver.units() if isinstance(driver, WithUnits) else {}, ""
    try:
        found = driver.fetch()
    except ChannelsFailed as error:
        found, failed = error.readings, str(error)
    told = "; ".join(
        f"{name}: {', '.join(f'{value:g}' for value in values)} {units.get(name, '')}" for name, values in found.items()
    )
    if failed:
        raise RigError(f"{told}{doubt}; {failed}")
    return told + doubt


def _said(one: Setting) -> str:
    """A setting in words."""
    if one.why_not:
        return f"{one.asked}: not read, {one.why_not}"
    return f"{one.asked} answers {one.found}: " + ("same" if one.same else f"differs, {one.declared} is declared")


def _first(pairs: Sequence[tuple[float, float]]) -> str:
    """Whether the first reading after choosing a channel is that of the channel before. Raises `RigError`."""
    steps = [(abs(b[0] - a[1]), abs(b[0] - b[1])) for a, b in pairwise(pairs)]
    if all(before < itself / _NEARER for before, itself in steps):
        said = ", ".join(f"{first:g} and then {second:g}" for first, second in pairs[:2])
        raise RigError(
            f"it is that of the channel before: two readings of each are {said}; write discard = 1 at [reader]"
        )
    return "it is the channel's own"


def _safe(driver: Any, clock: Clock, wait_s: float) -> str:
    """Bring it to its safe state, to which it may be on its way for a while. Raises `NotReady`."""
    end = clock.now() + wait_s
    while True:
        try:
            driver.make_safe()
        except NotReady:
            if clock.now() >= end:
                raise
            clock.sleep(_POLL_S)
        else:
            return ""


def _settled(driver: Any, clock: Clock, wait_s: float) -> str:
    """How long it takes until it has settled. Raises `RigError`."""
    began = clock.now()
    while not (found := driver.read()).settled:
        if clock.now() - began > wait_s:
            raise RigError(f"it has not settled within {wait_s:g} s, and reads {found.value:g}; --wait waits longer")
        clock.sleep(_POLL_S)
    return f"after {clock.now() - began:.0f} s it reads {found.value:g}"
