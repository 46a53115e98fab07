"""Drivers of files against drivers written by hand that say the same bytes, each on its own of two equal benches.

Each action is made in turns, and medians are compared. An exchange is driver, wire, twin and physics together.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Mapping, Sequence
from importlib.resources import files
from statistics import median
from typing import Any

from rig.bench.plugins import driver_class
from rig.drivers.clock import Clock
from rig.drivers.declared import driver_of
from rig.drivers.scpi import SYNC, Dialect, ScpiMeter
from rig.drivers.watlow_f4t import WatlowF4T
from rig.drivers.wires import SerialSettings, Wires
from rig.sims.bench import SimBench
from rig.sims.world import World
from rig.simulated.dry_run import twin_class

_DIALECT = Dialect("SYST:REM", "\x03", clear_with_dtr=True, reading=re.compile(r"[+-]\d\.\d{8}E[+-]\d\d", re.ASCII))


class Meter(ScpiMeter):
    """The 34401A as its driver was before it was a file: 10 V, 10 power line cycles of 50 Hz."""

    most_sweeps = 512

    def __init__(self, address: str, wires: Wires, clock: Clock) -> None:
        line = wires.serial(address, SerialSettings(9600, "7E2", "none", timeout_s=2.0, sync=SYNC), "dvm")
        super().__init__(line, clock, "34401A", _DIALECT)

    def channels(self) -> Sequence[str]:
        return ("input",)

    def sweep_s(self) -> float:
        return 0.0015 + 2 * 10.0 / 50.0

    def prepare(self) -> None:
        self._configure(("CONF:VOLT:DC 10", "VOLT:DC:NPLC 10", "ZERO:AUTO ON", "TRIG:SOUR IMM", "SAMP:COUN 1"))
        wanted: dict[str, float | str] = {"FUNC?": '"VOLT"', "VOLT:DC:RANG?": 10.0, "VOLT:DC:RANG:AUTO?": "0"}
        self._verify({**wanted, "VOLT:DC:NPLC?": 10.0, "ZERO:AUTO?": "1", "TRIG:SOUR?": "IMM", "SAMP:COUN?": 1.0})
        self._mark_prepared()


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
