"""Early warnings: faults of sensors that are found while the run can still be saved.

The tests see every accepted observation. Each cause is reported once per run. A warning is an event of the run file; it
is shown by `rig status`, by `rig watch` and at the end of `rig run`. It stops nothing, except that the run holds if
the procedure says `[warnings] hold = true`.
"""

from __future__ import annotations

import contextlib
import itertools
import math
from bisect import bisect_right
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rig.engine.response_statistics import ResponseTest, Row
from rig.engine.warning_statistics import ALARM, NoiseTest, Number, PreviousTest, RepeatTest, StillTest
from rig.errors import RigError
from rig.procedures.column_names import spelled, unit_of
from rig.procedures.plan.conduct import Conduct
from rig.procedures.plan.run_list import Point, RunList
from rig.run_file.chain import Record
from rig.run_file.events.bench import Warned
from rig.run_file.events.event import EMPTY
from rig.run_file.read.reader import RunReader
from rig.units.of_instruments import PER_VOLT, per_volt

if TYPE_CHECKING:
    from rig.procedures.plan.expected import Previous

_SETTINGS = 400
"""Approximate maximum number of settings whose first readings are kept for comparison, for runs of any length."""
_FIRST, _LAST = 200, 40
"""Observations read again when a run is resumed: the first ones and those in the windows of the tests."""


@dataclass
class _Output:
    """The tests of one output."""

    noise: NoiseTest
    repeats: RepeatTest
    previous: PreviousTest
    response: ResponseTest | None


class EarlyWarnings:
    """Watches the sensors of a run.

    Args:
        run_list: every point.
        previous: the last calibration, if the procedure names one.
        conduct: how the package is turned, and the declared properties of the outputs.

    """

    def __init__(self, run_list: RunList, previous: Previous | None, conduct: Conduct) -> None:
        self._run_list, self._previous, self._conduct = run_list, previous, conduct
        self._told: set[tuple[str, str]] = set()
        self._broken = False
        self._outputs: dict[str, _Output] = {}
        self._thermometers: dict[str, StillTest] = {}
        self._whole_plot: int | None = None
        self._changes_at = [step.before for step in run_list.steps]
        self._changes = 0
        self._span = self._spans()
        per_replication = len(run_list) / max(1, run_list.points[-1].replication if run_list.points else 1)
        self._every = max(1, math.ceil(2 * per_replication / _SETTINGS))

    def add(self, point: Point, whole_plot: int | None, body: Mapping[str, Any]) -> list[Warned]:
        """Take an accepted observation, as the run file has it; returns the new warnings. Never raises."""
        if self._broken:
            return []
        try:
            return self._judged(point, whole_plot, body)
        except Exception as error:  # a programming error in the tests must not end a run
            self._broken = True
            words = f"early warnings have ended with a mistake of their own ({type(error).__name__}: {error})"
            return [Warned("itself", "", f"{words}; the run goes on without them")]

    def _judged(self, point: Point, whole_plot: int | None, body: Mapping[str, Any]) -> list[Warned]:
        outputs: Mapping[str, Any] = body["outputs"]
        changes = bisect_right(self._changes_at, point.index)
        if changes != self._changes:  # a person has changed the bench: earlier readings are no measure of later ones
            self._changes = changes
            self._outputs.clear()
        read = self._quantities(point, body)
        given = {name: np.array([value]) for name, value in read.items()} if self._previous else {}
        began = whole_plot != self._whole_plot
        self._whole_plot = whole_plot
        row = self._row(read)
        expected = {} if self._previous is None else self._previous.expected(given, self._conduct.mounting)
        found = []
        for name, channel in outputs.items():
            number = Number(float(channel["mean"]), float(channel["sd"]) ** 2, len(channel["readings"]))
            tests = self._outputs.get(name)
            if tests is None:
                tests = self._outputs[name] = self._new(name, len(outputs))
            if began:
                tests.repeats.forget()
                if whole_plot is not None:
                    tests.previous.forget()
            said = {"noise": tests.noise.add(number), "drift": self._repeated(tests, point, whole_plot, number.mean)}
            if row is not None and tests.response is not None:
                new = began and whole_plot is not None
                said["response"] = tests.response.add(row, number.mean, number.variance, new_whole_plot=new)
            if name in expected:
                one = expected[name]
                draws = len(outputs) * max(1, self._run_list.whole_plots)
                said["calibration"] = tests.previous.add(
                    number.mean - float(one.output[0]),
                    float(one.own[0]),
                    float(one.shared[0]),
                    one.reach(0.1 * ALARM / draws),
                )
            found += [Warned(cause, name, f"{name} {words}") for cause, words in said.items() if words]
        found += list(self._still(body.get("temperatures", {})))
        if not found:
            return found
        fresh = [w for w in found if (w.cause, w.output) not in self._told]
        self._told |= {(w.cause, w.output) for w in fresh}
        return fresh

    def recall(self, run: RunReader) -> None:
        """Restore the state of the tests from the run file when a run is resumed: no warning is repeated.

        The number of records read is bounded, for runs of any length.
        """
        accepted = "kind = 'observation' AND status = 'accepted'"
        kept = list(itertools.islice((p.index for p in self._run_list.points if self._keeps(p)), _SETTINGS))
        marks = ", ".join("?" * len(kept))
        some: dict[int, Record] = {}
        for where, values in (
            (f"seq IN (SELECT seq FROM record WHERE {accepted} ORDER BY seq LIMIT {_FIRST})", ()),
            (f"{accepted} AND run_index IN ({marks})", tuple(kept)),
            (f"seq IN (SELECT seq FROM record WHERE {accepted} ORDER BY seq DESC LIMIT {_LAST})", ()),
        ):
            some |= {seq: record for seq, record, _, _ in run.chained(where, values)}
        for _, record in sorted(some.items()):
            self.add(self._run_list.points[int(record.run_index or 0)], record.whole_plot, record.data)
        self._told = {(warned.cause, warned.output) for _, warned in warnings_of(run)}

    def _new(self, name: str, outputs: int) -> _Output:
        points, say = len(self._run_list), partial(in_unit, unit_of(name))
        response = None if self._span is None else ResponseTest(self._span, self._conduct.least_jump, say)
        return _Output(
            NoiseTest(points, outputs, say),
            RepeatTest(points, outputs, say),
            PreviousTest(points, outputs, say),
            response,
        )

    def _still(self, temperatures: Mapping[str, Any]) -> Iterator[Warned]:
        for name, channel in temperatures.items():
            if name not in self._thermometers:
                self._thermometers[name] = StillTest(len(self._run_list), len(temperatures), spelled(unit_of(name)))
            if words := self._thermometers[name].add(channel["readings"]):
                yield Warned("thermometer", name, f"{name} {words}")

    def _repeated(self, tests: _Output, point: Point, whole_plot: int | None, mean: float) -> str:
        if whole_plot is None and not self._keeps(point):
            return ""
        return tests.repeats.add((whole_plot, point.setpoints, point.sides), mean)

    def _keeps(self, point: Point) -> bool:
        """Whether a setting is compared. A hash chooses, so that all parts of a design are represented."""
        return hash((point.setpoints, point.sides)) % self._every == 0  # the hash of numbers is the same in every
        # process

    def _quantities(self, point: Point, body: Mapping[str, Any]) -> dict[str, float]:
        """The setting, or its readback where that is the more accurate one."""
        given = self._run_list.setting(point)
        for group in ("temperatures", "references"):
            for name, channel in body.get(group, EMPTY).items():
                given[name] = float(channel["mean"])
        return given

    def _row(self, given: Mapping[str, float]) -> Row | None:
        return None if self._conduct.response is None else self._conduct.response(given)

    def _spans(self) -> Row | None:
        """Range of each column of the model over the run list, from a sample of its points."""
        points = self._run_list.points
        some = points[:: max(1, len(points) // 2000)]
        rows = [row for p in some if (row := self._row(self._run_list.setting(p))) is not None]
        return tuple(max(column) - min(column) for column in zip(*rows, strict=True)) if rows else None


def in_unit(unit: str, value: float) -> str:
    """A value with a readable unit: -3.4e-5 V becomes "-34 uV"."""
    scale = per_volt(unit)
    if scale is None:
        return f"{value:.3g} {spelled(unit)}"
    volts = value / scale
    for name, of_one in PER_VOLT.items():
        if abs(volts) * of_one >= 0.5:
            return f"{volts * of_one:.4g} {name}"
    return f"{volts * 1e6:.3g} uV"


def warnings_of(run: RunReader) -> Iterator[tuple[Record, Warned]]:
    """The warnings of a run file, in order."""
    for _, record, _, _ in run.chained("kind = 'event' AND status IN ('warning', 'emerging')"):
        if isinstance(record.event, Warned):
            yield record, record.event


def warnings_in(run_file: Path) -> list[str]:
    """Early warnings of a run; none for a file that cannot be read (the reader reports that error)."""
    with contextlib.suppress(RigError), RunReader.open(run_file) as reader:
        return [warned.message for _, warned in warnings_of(reader)]
    return []
