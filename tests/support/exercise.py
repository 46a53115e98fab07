"""Any instrument that is installed, on a simulated bench, put through what its role asks of it.

A file for each driver says on which bench, and what then goes over the wire: `exchanges/DRIVER.toml` in these tests,
or in the package that the driver comes with. `python tests/support/exercise.py DRIVER` prints it as it is now.
"""

from __future__ import annotations

import sys
import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any

from rig.bench.bench_file import check_options
from rig.bench.config import parse_bench
from rig.bench.plugins import driver_class
from rig.drivers.roles import Chamber, Head, PressureController, Reader, Source
from rig.instruments.opening import Bench, open_bench
from rig.sims.faults import Fault, Kind
from rig.simulated.dry_run import DryBench

NAME = "it"
QUIET = {"lab": {"daily_amplitude_degC": 0.0}}
_HERE = Path(__file__).parents[1] / "exchanges"


def on_file(driver: str) -> Mapping[str, str]:
    """The bench and the exchange of a driver."""
    place = _HERE if (_HERE / f"{driver}.toml").is_file() else files(driver_class(driver).__module__.partition(".")[0])
    path = place / f"{driver}.toml" if place is _HERE else place / "exchanges" / f"{driver}.toml"
    assert path.is_file(), f"{driver} has no exchange to be held to: write {path} (see tests/support/exercise.py)"
    return tomllib.loads(path.read_text(encoding="utf-8"))


@dataclass
class Exercise:
    """One instrument on its bench.

    Attributes:
        truth: what the world file says.
        wire: (direction, bytes) of all that went over its wire, with ("#", what was asked of it) and ("=", its answer).

    """

    driver_name: str
    truth: Mapping[str, Any] = field(default_factory=dict)
    wire: list[tuple[str, bytes]] = field(default_factory=list)

    def __post_init__(self) -> None:
        text = on_file(self.driver_name)["bench"]
        self.dry = DryBench(parse_bench(text, "bench.toml"), {**QUIET, **self.truth}, tap=self._heard, key="exercise")
        self.bench: Bench = open_bench(
            self.dry.config, check_options(self.dry.config, "bench"), self.dry.world, self.dry.wires
        )
        self.driver: Any = self.bench.instruments[NAME]
        self.twin = self.dry.sim.twin(NAME)
        self.plant = self.dry.sim.plant
        self.sleep: Callable[[float], None] = self.dry.world.sleep

    def close(self) -> None:
        self.bench.close()
        self.dry.close()

    def _heard(self, name: str, direction: str, data: bytes) -> None:
        if name != NAME:
            return
        if self.wire and self.wire[-1][0] == direction:
            data = self.wire.pop()[1] + data
        self.wire.append((direction, data))

    def do(self, what: str, *arguments: Any) -> Any:
        """Call a method of the driver."""
        self.wire.append(("#", f"{what} {', '.join(map(str, arguments))}".strip().encode()))
        answer = getattr(self.driver, what)(*arguments)
        if answer is not None:
            self.wire.append(("=", str(answer).encode()))
        return answer

    def bring_up(self) -> None:
        """As a session does: who is there, settings, zeros."""
        self.do("identify")
        self.do("prepare")
        if isinstance(self.driver, Head):
            self.do("home")
            for _ in range(40):
                self.sleep(20.0)
                if all(axis.homed and not axis.moving for axis in self.driver.read().values()):
                    return
            raise AssertionError("it does not home")

    def work(self) -> Iterator[Any]:
        """What its roles are for, with what it answers."""
        driver = self.driver
        if isinstance(driver, Head):
            self.do("move", {axis: low + 0.6 * (high - low) for axis, (low, high) in driver.axes().items()})
            yield self.do("read")
            self.sleep(120.0)
            yield self.do("read")
        if isinstance(driver, Reader):
            yield self.do("start", 2)
            yield self.do("fetch")
        if isinstance(driver, Chamber):
            low, high = driver.limits()
            self.do("set_temperature", low + 0.6 * (high - low))
            for _ in range(2):
                self.sleep(20.0)
                yield self.do("read")
        if isinstance(driver, PressureController):
            low, high = driver.limits()
            self.do("set_pressure", low + 0.95 * (high - low))
            for seconds in (20.0, 300.0):
                self.sleep(seconds)
                yield self.do("read")
        if isinstance(driver, Source):
            low, high = driver.limits()
            self.do("set", low + 0.75 * (high - low))
            for seconds in (0.5, 20.0):
                self.sleep(seconds)
                yield self.do("read")
        if hasattr(driver, "stop"):
            self.do("stop")

    def calls(self) -> list[Callable[[], Any]]:
        """Every command that its roles have, each with something it may be told."""
        driver = self.driver
        plain = ("identify", "prepare", "stop", "make_safe", "home", "vent", "restarted", "read", "limits")
        found: list[Callable[[], Any]] = [getattr(driver, command) for command in plain if hasattr(driver, command)]
        if isinstance(driver, Head):
            found.append(lambda: driver.move({axis: (low + high) / 2.0 for axis, (low, high) in driver.axes().items()}))
        if isinstance(driver, Chamber):
            found.append(lambda: driver.set_temperature(25.0))
        if isinstance(driver, PressureController):
            found.append(lambda: driver.set_pressure(2.0))
        if isinstance(driver, Source):
            found.append(lambda: driver.set(driver.limits()[1]))
        if isinstance(driver, Reader):
            found += [lambda: driver.start(2), driver.fetch]
        return found

    def strike(self, kind: Kind, **words: str) -> None:
        """Have a fault happen now, with its defaults but for these options."""
        options = {key: option.default for key, option in kind.options.items()} | words
        self.dry.sim.faults.strike(Fault(kind, NAME, at_s=self.dry.world.now(), options=options))

    def exchange(self) -> str:
        """What went over its wire, a line for each turn."""
        return "".join(f"{who} {data.decode() if who in '#=' else repr(data)[2:-1]}\n" for who, data in self.wire)


def golden(driver: str) -> str:
    """All that goes over the wire in one exercise."""
    it = Exercise(driver)
    try:
        it.bring_up()
        list(it.work())
        it.do("make_safe")
        return it.exchange()
    finally:
        it.close()


if __name__ == "__main__":
    print(golden(sys.argv[1]), end="")
