"""Drivers of files against drivers written by hand that say the same bytes, each on its own of two equal benches.

Each action is made in turns, and medians are compared. An exchange is driver, wire, twin and physics together.
"""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable, Mapping, Sequence
from importlib.resources import files
from statistics import median
from typing import Any

from rig.bench.plugins import driver_class
from rig.drivers.clock import Clock
from rig.drivers.declared import driver_of
from rig.drivers.errors import InstrumentError, LimitError, NotReady
from rig.drivers.kept import not_kept
from rig.drivers.numbers import whole
from rig.drivers.scpi import PREPARED, agrees
from rig.drivers.watlow_f4t import WatlowF4T
from rig.drivers.wires import SerialSettings, Wires
from rig.sims.bench import SimBench
from rig.sims.world import World
from rig.simulated.dry_run import twin_class

_READING = re.compile(r"[+-]\d\.\d{8}E[+-]\d\d", re.ASCII)
_MARKS = 32


class Meter:
    """The 34401A as its driver was before it was a file: 10 V, 10 power line cycles of 50 Hz."""

    def __init__(self, address: str, wires: Wires, clock: Clock) -> None:
        settings = SerialSettings(9600, "7E2", "none", timeout_s=2.0, sync=("SYST:VERS?", "19"))
        self._line, self._clock = wires.serial(address, settings, "dvm"), clock
        self._count, self._due, self._mark = 0, 0.0, 0
        self._declared: Mapping[str, float | str] = {}
        self._most, self._channels, self._start, self._fetch = 512, ("input",), "TRIG:COUN {count};:INIT", "FETC?"

    def _sweep_s(self) -> float:
        return 0.0015 + 2 * 10.0 / 50.0

    def _clear(self) -> None:
        self._line.device_clear("\x03", with_dtr=True)

    def _raise_errors(self) -> None:
        answer = self._line.query("SYST:ERR?", repeat=False)
        if code := whole(answer.partition(",")[0]):
            raise InstrumentError(self._line.where, code, answer)

    def prepare(self) -> None:
        """Reset it, send its settings one by one, and read them back."""
        settings = ("CONF:VOLT:DC 10", "VOLT:DC:NPLC 10", "ZERO:AUTO ON", "TRIG:SOUR IMM", "SAMP:COUN 1")
        self._clear()
        for command in ("SYST:REM", "*RST", "*CLS", *settings):
            self._line.write(command)
            if self._line.query("*OPC?") != "1":
                raise self._line.bad_reply("*OPC?", "", "1")
        self._raise_errors()
        wanted: dict[str, float | str] = {"FUNC?": '"VOLT"', "VOLT:DC:RANG?": 10.0, "VOLT:DC:RANG:AUTO?": "0"}
        self._verify({**wanted, "VOLT:DC:NPLC?": 10.0, "ZERO:AUTO?": "1", "TRIG:SOUR?": "IMM", "SAMP:COUN?": 1.0})
        self._line.write(f"*PSC 1;*ESE {PREPARED}")
        self._verify({"*ESE?": float(PREPARED)})

    def _verify(self, wanted: Mapping[str, float | str]) -> None:
        self._declared = {**self._declared, **wanted}
        for question, value, answer in not_kept(wanted, self._line.query, _agree):
            raise self._line.bad_reply(question, answer, str(value))

    def restarted(self) -> bool:
        """Whether it has been powered up since it was prepared."""
        answer = self._line.query("*ESE?")
        try:
            return whole(answer) != PREPARED
        except ValueError:
            raise self._line.bad_reply("*ESE?", answer, "a number") from None

    def start(self, count: int) -> float:
        """Trigger readings, with a number in the service request mask."""
        if not 1 <= count <= self._most:
            raise LimitError(f"{self._line.where} can take 1 to {self._most} sweeps at once, not {count}")
        self._mark = self._mark % (_MARKS - 1) + 1
        self._line.write(f"*SRE {self._mark};:{self._start.format(count=count)}")
        expected = count * self._sweep_s()
        self._count, self._due = count, self._clock.now() + expected
        return expected

    def fetch(self) -> Mapping[str, Sequence[float]]:
        """Its readings, checked: their number, form and mark."""
        if not self._count:
            raise NotReady(f"{self._line.where}: there is nothing to fetch; start a measurement first")
        count, self._count = self._count, 0
        self._clock.sleep(self._due - self._clock.now())
        question, names = f"{self._fetch};*SRE?", self._channels
        sending_s = self._line.takes_s(count * len(names) * 16)
        answer = self._line.query(question, sending_s + count * self._sweep_s() / 4 + 2.0, repeat=False)
        readings, _, mark = answer.rpartition(";")
        words = readings.split(",")
        if not (mark.isascii() and mark.strip("+").isdecimal() and all(map(_READING.fullmatch, words))):
            raise self._line.bad_reply(question, answer, "readings and the measurement's mark")
        if int(mark) != self._mark or len(words) != count * len(names):
            raise self._line.bad_reply(question, answer, f"mark {self._mark} and {count} numbers")
        values = [float(word) for word in words]
        if not all(map(math.isfinite, values)):
            raise self._line.bad_reply(question, answer, "finite numbers")
        return {name: values[n :: len(names)] for n, name in enumerate(names)}


def _agree(answer: str, wanted: float | str) -> bool:
    """Whether an answer is as wanted, with one number for each channel."""
    return all(agrees(part, wanted) for part in ([answer] if isinstance(wanted, str) else answer.split(",")))


class Bath:
    """The Julabo bath: its state, as it is polled until it has settled."""

    def __init__(self, address: str, wires: Wires, clock: Clock) -> None:
        settings = SerialSettings(4800, "7E1", "rtscts", send_end=b"\r", timeout_s=2.0)
        self._line, self._clock, self._free = wires.serial(address, settings, "bath"), clock, 0.0

    def _ask(self, question: str) -> str:
        self._clock.sleep(self._free - self._clock.now())
        self._free = self._clock.now() + 0.25
        return self._line.query(question)

    def _number(self, question: str) -> float:
        answer = self._ask(question)
        try:
            return float(answer)
        except ValueError:
            raise self._line.bad_reply(question, answer, "a number") from None

    def read(self) -> tuple[float, bool, float, Sequence[str]]:
        """Setpoint, output, temperature, what is not as it should be."""
        setpoint = self._number("in_sp_00")
        output = self._ask("in_mode_05")
        if output not in ("0", "1"):
            raise self._line.bad_reply("in_mode_05", output, "0 or 1")
        value = self._number("in_pv_00")
        status = self._ask("status")
        code, _, _ = status.partition(" ")
        return setpoint, output == "1", value, [] if code in ("00", "01", "02", "03") else [status]


_READ = {  # registers of the state of an F4T, in the order in which its driver reads them
    "units": (6730, False),
    "setpoint": (2782, True),
    "temperature": (2820, True),
    "power": (2808, True),
    "mode": (2814, False),
    **{f"alarm_{n}": (1256 + 100 * n, False) for n in range(1, 5)},
}
_REAL = ', type = "float32"'
F4T = """
maker = "Watlow"
model = "F4T"
identity = { register = 16, is = 70 }
wire = { protocol = "modbus", type = "uint16", word_order = "little" }
[reader]
unit = "degC"
""" + "".join(
    f"[reader.channels.{name}]\nreading = {{ register = {register}{_REAL if real else ''} }}\n"
    for name, (register, real) in _READ.items()
)


_Action = Callable[[Any], object]
_TURNS = 41  # of some 10 ms: what else the machine does then meets both


class Bench:
    """A bench with one instrument, whose driver is that of a file or by hand; what was said on its wire."""

    def __init__(self, driver: str, options: Mapping[str, Any], made: Callable[[str, Wires, World], Any]) -> None:
        self.world, key = World(), f"ratio{id(self)}"
        bench = {"name": "", "instruments": {"one": {"driver": driver, "address": "", **options}}, "sensors": {}}
        self._sim = SimBench(self.world, bench, {}, key, {driver: twin_class(driver)})
        self.said: list[tuple[str, bytes]] | None = None
        self._serial = twin_class(driver).wire == "serial"
        wires = Wires(self.world, simulated=self._sim.transports(), tap=self._tap)
        self.driver = made(f"sim://{key}/one", wires, self.world)

    def _tap(self, name: str, direction: str, data: bytes) -> None:
        if self.said is not None:
            self.said.append((direction, data if self._serial else data[2:]))  # Modbus TCP counts requests


def compared(what: str, pair: tuple[Bench, Bench], repeats: int, ours: _Action, theirs: _Action) -> None:
    """Print the time of an exchange of a driver of a file and of one by hand, and the ratio: medians of turns.

    Raises:
        SystemExit: they do not say the same.
    """
    file, hand = pair
    actions = {file: ours, hand: theirs}
    for bench in pair:
        bench.said = []
        actions[bench](bench.driver)
    sent = [[data for direction, data in bench.said or () if direction == "tx"] for bench in pair]
    if sent[0] != sent[1] or not sent[0]:
        raise SystemExit(f"{what}: they do not say the same:\n{sent[0]}\n{sent[1]}")
    exchanges, file.said, hand.said = len(sent[0]), None, None
    taken: dict[Bench, list[float]] = {file: [], hand: []}
    for turn in range(_TURNS):
        for bench in pair if turn % 2 else reversed(pair):
            began = time.process_time()
            for _ in range(repeats):
                actions[bench](bench.driver)
            taken[bench].append((time.process_time() - began) / repeats / exchanges * 1e6)
    times = median(taken[file]), median(taken[hand])
    ratio = median(a / b for a, b in zip(taken[file], taken[hand], strict=True))
    print(f"{what:58} {times[0]:7.1f} us by a file, {times[1]:.1f} by hand, ratio {ratio:.2f}")


def ratios() -> None:
    """Print them. Raises `SystemExit` if a pair does not say the same."""

    def of_file(name: str) -> Callable[[str, Wires, World], Any]:
        made = driver_of(name) if "\n" in name else driver_class(name)
        return lambda address, wires, clock: made("one", address, made.Options(), wires, clock)

    def measure(one: Any) -> None:
        one.start(5)
        one.fetch()

    def prepare(one: Any) -> None:
        one.prepare()

    def read(one: Any) -> None:
        one.read()

    def restarted(one: Any) -> None:
        one.restarted()

    def registers(one: Any) -> None:
        one.start(1)
        one.fetch()

    def chamber(address: str, wires: Wires, clock: World) -> WatlowF4T:
        return WatlowF4T("one", address, WatlowF4T.Options(**options), wires, clock)

    meters = Bench("keysight-34401a", {}, of_file("keysight-34401a")), Bench("keysight-34401a", {}, Meter)
    compared("34401A: prepare()", meters, 10, prepare, prepare)
    compared("34401A: start(5) and fetch()", meters, 50, measure, measure)
    compared("34401A: restarted()", meters, 300, restarted, restarted)
    baths = Bench("julabo-fp50", {}, of_file("julabo-fp50")), Bench("julabo-fp50", {}, Bath)
    compared("Julabo FP50: read(), until it has settled", baths, 50, read, read)
    options = {"register_map": files("rig.contracts").joinpath("watlow_f4t.toml").read_text(encoding="utf-8")}
    chambers = Bench("watlow-f4t", options, of_file(F4T)), Bench("watlow-f4t", options, chamber)
    chambers[1].driver.read()  # asks for the unit once more
    compared("F4T: nine registers of its state", chambers, 30, registers, read)
