"""Hostile inputs at every door, from a seed: what ends in anything but an answer or an error meant for people.

The quick tests run a share of it, `python -m proving.doors.fuzz` as much as is asked for.
"""

from __future__ import annotations

import resource
import signal
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import typer

from proving.doors import of_messages, of_pages, of_runs, of_texts
from proving.doors.hostile import Acts, Material, Seeded
from rig.drivers.clock import RealClock
from rig.errors import RigError
from rig.procedures.errors import DataError

__all__ = ["DOORS", "Found", "Material", "attack"]

HANG_S, MEMORY_KB = 5.0, 1 << 20
_USAGE: type[Exception] = next(cls for cls in typer.BadParameter.__mro__ if cls.__name__ == "ClickException")


class Hang(BaseException):
    """An input that took longer than it may."""


@dataclass
class Found:
    """What was tried and found: of each kind of finding how many, and an example with its seed."""

    inputs: int = 0
    tracebacks: int = 0
    hangs: int = 0
    memory: int = 0
    deaths: int = 0
    examples: dict[str, str] = field(default_factory=dict)
    counts: dict[str, int] = field(default_factory=dict)

    @property
    def wrong(self) -> int:
        """How many findings."""
        return self.tracebacks + self.hangs + self.memory + self.deaths

    def note(self, what: str, example: str) -> None:
        """Count a finding, and keep the first example of its kind."""
        self.examples.setdefault(what, example)
        self.counts[what] = self.counts.get(what, 0) + 1


DOORS: Mapping[str, Callable[[Seeded, Material], Acts]] = {
    "toml": of_texts.toml,
    "csv": of_texts.csv,
    "formula": of_texts.formula,
    "calibration": of_texts.calibration,
    "contracts": of_texts.contracts,
    "paths": of_texts.paths,
    "run": of_runs.run,
    "beside": of_runs.beside,
    "http": of_pages.http,
    "notify": of_messages.notify,
}


def _spent_s() -> float:
    """Real seconds without those in which other programs had the processors that this one waited for."""
    try:
        waited_ns = int(Path("/proc/thread-self/schedstat").read_text().split()[1])
    except (OSError, IndexError):
        waited_ns = 0
    return RealClock().now() - waited_ns / 1e9


def attack(door: str, seed: int, material: Material, found: Found) -> None:
    """Give a door one input made from a seed, and note what should not be."""
    began = _spent_s()

    def too_long(*_: object) -> None:
        left = HANG_S - (_spent_s() - began)
        if left <= 0.0:
            raise Hang
        signal.setitimer(signal.ITIMER_REAL, left)

    at = f"--door {door} --seed {seed}"
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    handler = signal.signal(signal.SIGALRM, too_long)
    found.inputs += 1
    try:
        for act in DOORS[door](Seeded(door, seed), material):
            began = _spent_s()
            signal.setitimer(signal.ITIMER_REAL, HANG_S)
            try:
                act()
            except (RigError, DataError, _USAGE, OSError, SystemExit, typer.Abort) as error:
                if isinstance(error, (RigError, DataError)) and not str(error).strip():
                    found.tracebacks += 1
                    found.note(f"{type(error).__name__} without a word", at)
            except Hang:
                found.hangs += 1
                found.note("hang", f"{at}:\n{traceback.format_exc()[-1500:]}")
            except MemoryError:
                found.memory += 1
                found.note("memory", f"{at}:\n{traceback.format_exc()[-1500:]}")
            except Exception as error:
                found.tracebacks += 1
                last = traceback.extract_tb(error.__traceback__)[-1]
                what = f"{type(error).__name__} at {Path(last.filename).name}:{last.lineno}"
                found.note(what, f"{at}:\n{traceback.format_exc()[-1800:]}")
            finally:
                signal.setitimer(signal.ITIMER_REAL, 0)
    finally:
        signal.signal(signal.SIGALRM, handler)
    if resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before > MEMORY_KB:
        found.memory += 1
        found.note("memory", at)
