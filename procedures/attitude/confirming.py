"""A traced attitude run as the first of two. See `rig.procedures.evaluate.confirming.Confirming`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.confirm import CARRIED_ON, Confirmation, Later, Question, Together
from rig.fitter.effects.entry import Entry
from rig.procedures.attitude.budget import AttitudeEvaluation
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.effects import CATALOGUE, Effect, separate
from rig.procedures.attitude.evaluate import AttitudeTraced
from rig.procedures.attitude.fitted import AttitudeFitted, effects_of, fit_attitude_table
from rig.procedures.attitude.for_budgets import attitude_evaluation
from rig.procedures.attitude.model import mounting_matrix
from rig.procedures.attitude.options import FitOptions
from rig.procedures.attitude.parameters import SCALE, UNIT
from rig.procedures.attitude.settings import DesignSettings, PitchRollProcedure
from rig.procedures.attitude.table import attitude_data
from rig.procedures.attitude.together import AttitudeTogether, mountings
from rig.procedures.errors import DataError
from rig.procedures.evaluate.confirming import SETTLED, ConfirmedFit, Confirming, in_words
from rig.procedures.plan.further_runs import Variation, repeated
from rig.procedures.plan.run_list import RunList
from rig.procedures.tables.table import Table

PACKAGE_S = 1200.0
"""Time constant of a package behind its enclosure, seconds: a run begins before a change has decayed."""
TRAVEL_S_PER_DEG = 0.2
"""Additional time for longer motion between points; a head at 5 deg/s."""
MOST_CANDIDATES = 160
"""Number of points, at most, from which those of a run are chosen."""
GOES_ON = 0.0, 0.5, 1.0
"""Share of the first run's temperature trend that may continue until the further run."""


@dataclass(frozen=True, eq=False)
class AttitudeConfirming(Confirming):
    """A traced run of the package, as the first of two; errors are angles."""

    traced: AttitudeTraced

    unit = "deg"
    output_unit = "V"
    per_slope = float(np.degrees(1.0))
    drawn = UNIT, SCALE
    counts = 12, 13, 15, 17, 19, 21, 24, 27, 30, 34, 38, 43, 48, 54, 60, 68, 76, 86, 96, 108, 120
    passes = 1, 2, 4
    least_added = 12  # each replication has an alignment of its own

    def own_words(self, *, realigned: bool) -> str:
        """Parameters estimated from the further run itself for its prediction, in words; "" if there are none."""
        return "offset and sensitive axes are fitted to the further run" if realigned else ""

    def later(self, table: Table) -> AttitudeData:
        """Observations of a later run. Raises `DataError`."""
        return attitude_data(table)

    def together(self, later: Sequence[Later]) -> AttitudeTogether:
        """This run and later ones. Raises `FitError`."""
        return AttitudeTogether.of(self.found, self.data, later)

    @property
    def catalogue(self) -> Sequence[Entry]:
        """Effects that the trace looked for."""
        return CATALOGUE

    def standing(self, variation: Variation) -> Variation:
        """A possible run as a person finds the bench after the earlier ones: whether something has to be turned."""
        if not self.earlier:
            return variation
        turn = variation.procedure.mounting
        now, then = mountings(self.earlier[-1].data)[-1], mounting_matrix(turn.x_deg, turn.y_deg, turn.z_deg)
        return replace(variation, turned=not np.allclose(now, then, atol=1e-9))

    def whole(self, group: Sequence[Variation], times: int) -> Variation:
        """The run of a group with all points that can be chosen, so many times each; None if points are not chosen. The
        largest design of few enough points.
        """
        sizes = [len(variation.procedure.design.build()) for variation in group]
        most = max((size for size in sizes if size <= MOST_CANDIDATES), default=min(sizes))
        return repeated(group[sizes.index(most)], times)

    def units(self, run_list: RunList) -> IntArray:
        """(n,) number of the unit of each point of a run with all of them: units are chosen together. A point of the
        design, in all replications.
        """
        return np.asarray(_points(run_list)[1], np.int64)

    def chosen(self, whole: Variation, units: Sequence[int]) -> Variation:
        """The run with these units only."""
        points = self._candidates(whole)
        design = DesignSettings(
            type="points", points_deg=[tuple(at) for at in short_path(points[list(units)]).tolist()]
        )
        return replace(whole, procedure=whole.procedure.model_copy(update={"design": design}))

    def _candidates(self, whole: Variation) -> FloatArray:
        """(U, 2) different (pitch, roll) of a run; runs of them are chosen from one design many times."""
        known = self._of_design
        if not known or known[0][0] is not whole:
            known[:] = [(whole, _points(whole.procedure.expand())[0])]
        return known[0][1]

    @cached_property
    def _of_design(self) -> list[tuple[Variation, FloatArray]]:
        return []

    def ways(
        self, variation: Variation, run_list: RunList, questions: Sequence[Question], later_s: float
    ) -> list[Together]:
        """With temperatures that repeat, or continue to fall; one course if no open question is of time or
        temperature.
        """
        later = self._planned(variation, run_list)
        done = [step.done(run_list.replications()) for step in variation.steps]
        both = [self.beside(later, later_s, done)]
        sources = {member.terms[0].effect.source for question in questions for member in question.members}
        if later.sensor_temperature_degC is not None and sources & {*CARRIED_ON}:
            trend = _trend(self.data) * later_s
            for share in GOES_ON[1:]:
                degC = later.sensor_temperature_degC + share * trend
                both.append(self.beside(replace(later, sensor_temperature_degC=degC), later_s, done))
        return both

    def hours(self, variation: Variation, run_list: RunList) -> float:
        """Bench time of a run, hours, from that of this run."""
        return (len(run_list) * _point_s(self.data, run_list) + self.settling_s(variation)) / 3600.0

    def size(self, procedure: PitchRollProcedure) -> str:
        """Points and replications, for a table."""
        return in_words(len(procedure.design.build()), procedure.replications)

    def mounting(self, procedure: PitchRollProcedure) -> Mapping[str, float] | None:
        """How the package is turned in a run, deg about each axis; None where it is as usual, or nothing is turned."""
        return procedure.mounting.model_dump() if procedure.mounting.turned else None

    def separated_by(self, one: Entry, other: Entry) -> str:
        """The measurement that would separate two effects."""
        assert isinstance(one, Effect)
        assert isinstance(other, Effect)
        return separate(one, other)

    def variables(self) -> Mapping[str, tuple[str, float]]:
        """Fields of observations for plots of residuals: label and scale."""
        return {
            "pitch_deg": ("pitch / deg", 1.0),
            "roll_deg": ("roll / deg", 1.0),
            "sensor_temperature_degC": ("sensor temperature / degC", 1.0),
        }

    def calibrated(
        self,
        answers: Sequence[Confirmation],
        questions: Sequence[Question],
        record: dict[str, Any],
        options: FitOptions,
    ) -> ConfirmedFit:
        """If several causes remain, intervals cover those; if nothing is settled, the whole class."""
        if options.at_degC is not None or options.points is not None:
            raise DataError(
                "--confirmed-by keeps a calibration at the run's mean temperature: leave --at-degC and --points away"
            )
        allowed = {
            a.effect: [cause for member in a.members if member.holds for cause in member.causes]
            for a in answers
            if a.verdict in (*SETTLED, "undecided")
        }
        for answer, question, effect in zip(answers, questions, record["effects"], strict=True):
            if answer.verdict in SETTLED and len(answer.members[0].causes) > 1:
                effect["used"] = f"{effect['told']}; intervals cover {', '.join(allowed[answer.effect])}, each alone"
            elif answer.verdict in SETTLED and any(m.near for m in question.members if m.effect in answer.holding):
                effect["used"] = (
                    f"{effect['told']}; the calibration does not have it, because the first run barely excludes it: "
                    "intervals cover the causes that the first run leaves, and may be invalid"
                )
        result = fit_attitude_table(
            self.traced.table, traced=True, temperature=self.traced.temperature, found=self.found, allowed=allowed
        )
        kept = result["calibration"]
        kept["notes"] = [*kept["notes"], *(effect["used"] for effect in record["effects"])]
        return ConfirmedFit(AttitudeFitted(result, self.traced.table), record, partial(self._evaluation, allowed))

    def _evaluation(
        self,
        allowed: Mapping[str, Sequence[str]],
        at: Sequence[Mapping[str, float]],
        constants: Mapping[str, float],
    ) -> AttitudeEvaluation:
        """The run with the effects that further runs left, for budgets."""
        return attitude_evaluation(
            self.traced.table,
            at,
            temperature=self.traced.temperature,
            effects=effects_of(self.found, allowed),
            gravity=constants.get("gravity"),
        )

    def _planned(self, variation: Variation, run_list: RunList) -> AttitudeData:
        data, procedure = self.data, variation.procedure
        n = len(run_list)
        elapsed = np.arange(1.0, n + 1.0) * _point_s(data, run_list) + float(data.elapsed_s.min())
        degC = None
        if data.temperatures is not None:
            enclosure = procedure.environment
            soaked = np.inf if enclosure is None else enclosure.dwell_s
            late = np.exp(-(soaked + elapsed - float(data.elapsed_s.min())) / PACKAGE_S)
            degC = np.interp(elapsed, *data.temperatures) + variation.warmer_degC * (1.0 - late)
        turn = procedure.mounting
        sides = [np.array([side for _, side in column]) for column in run_list.points.settings]
        at = [f.name for f in run_list.factors]
        return AttitudeData(
            replicate=np.array(run_list.replications()),
            order=np.arange(n),
            elapsed_s=elapsed,
            pitch_deg=np.array(run_list.column("pitch_deg")),
            roll_deg=np.array(run_list.column("roll_deg")),
            sensor_temperature_degC=degC,
            outputs={name: np.zeros(n) for name in data.sensors},
            pitch_side=sides[at.index("pitch_deg")],
            roll_side=sides[at.index("roll_deg")],
            mounting=np.broadcast_to(mounting_matrix(turn.x_deg, turn.y_deg, turn.z_deg), (n, 3, 3))
            if turn.turned
            else None,
        )


def short_path(points: FloatArray) -> FloatArray:
    """(n, 2) angles in an order with little motion: along pitch at one roll after the other, or the reverse."""
    paths = []
    for slow, fast in ((0, 1), (1, 0)):
        path, way = [], 1
        for level in np.unique(points[:, slow]).tolist():
            own = points[points[:, slow] == level]
            path.append(own[np.argsort(own[:, fast])][::way])
            way = -way
        paths.append(np.concatenate(path))
    return min(paths, key=_travel)


def _points(run_list: RunList) -> tuple[FloatArray, IntArray]:
    """(U, 2) different (pitch, roll) of a run, ascending, and (n,) the number of each point's."""
    pairs = np.column_stack([run_list.column("pitch_deg"), run_list.column("roll_deg")])
    points, number = np.unique(pairs, axis=0, return_inverse=True)
    return points, np.ravel(number).astype(np.int64)


def _trend(data: AttitudeData) -> float:
    """Trend of the temperature through a run, degC/s."""
    if data.temperatures is None:
        return 0.0
    elapsed, degC = data.temperatures
    return float(np.polyfit(elapsed - elapsed.mean(), degC, 1)[0]) if np.ptp(elapsed) > 0 else 0.0


def _point_s(data: AttitudeData, run_list: RunList) -> float:
    """Expected duration of a point, seconds: as in the first run, plus longer motion."""
    executed = np.argsort(data.order)
    seconds = float(np.median(np.diff(data.elapsed_s[executed])))
    usual = _travel(np.column_stack([data.pitch_deg, data.roll_deg])[executed])
    angles = np.column_stack([run_list.column(factor.name) for factor in run_list.factors])
    return seconds + TRAVEL_S_PER_DEG * max(_travel(angles) - usual, 0.0)


def _travel(angles: FloatArray) -> float:
    """Mean motion between points of the axis with the longer way, degrees."""
    return float(np.mean(np.max(np.abs(np.diff(angles, axis=0)), axis=1))) if len(angles) > 1 else 0.0
