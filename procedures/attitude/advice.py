"""The recommendations of NASA/TP-1999-209835, section 10, applied to a procedure: advice with numbers, no refusals.

Every sentence is computed from the design. The paper's general recommendations may not suit one bench, so the numbers
give the consequences, and no procedure is refused.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rig.fitter import RankError
from rig.procedures.attitude.designs import Design, fraction, grid, roll_circle, tumble, uniform
from rig.procedures.attitude.merit import (
    DesignPoints,
    Usage,
    figure_of_merit,
    mean_variance,
    pad_visibility,
    smallest_offset_drift,
    worst_variance,
)
from rig.procedures.attitude.model import attitude_columns, fit_columns
from rig.procedures.attitude.package_advice import Package, advise_package, not_for
from rig.procedures.attitude.settings import PitchRollProcedure
from rig.procedures.plan.advice import Advice

RANGE_RATIO = 1.5
"""Ratio of calibrated to used pitch range, recommendation 1."""
REPLICATIONS = 6
"""Minimum number, recommendation 6; preferably ten."""
PAPERS_PADS_DEG = 4e-4
"""Size of the pad deflections the paper found in its own sensors (figures 24, 44, 47)."""


def advise(
    procedure: PitchRollProcedure, usage: Usage | None = None, package: Package | None = None
) -> tuple[Advice, ...]:
    """The paper's ten recommendations in order, then the visibility of the paper's effect in the design.

    Args:
        procedure: the procedure.
        usage: attitudes of use of the calibrated sensor; by default two thirds of the calibrated pitch range.
        package: the sensors and their requirements; without it recommendations 8 to 10 do not apply.

    Raises:
        rig.fitter.linear.RankError: the design does not determine a sensor.
    """
    design, points = procedure.design.build(), design_points(procedure)
    fit_columns(points.columns(), np.zeros(points.points))
    within = usage or _two_thirds(points)
    case = _Case(procedure, design, points, within, usage is not None, _is_tumble(points))
    own = tuple(check(case) for check in _CHECKS)
    return (*own, *advise_package(package, within, roll=points.roll), _pads(case))


def advice(procedure: PitchRollProcedure, axes: Sequence[str], usage_deg: float | None) -> list[Advice]:
    """The recommendations of NASA/TP-1999-209835 that apply to a procedure and sensors along these axes."""
    found = advise(procedure, usage_of(procedure, usage_deg), package_of(procedure, axes))
    return [one for one in found if one.applies]


def usage_of(procedure: PitchRollProcedure, pitch_deg: float | None = None) -> Usage | None:
    """The range of use in a procedure, or pitch from minus to plus `pitch_deg`; None if neither is given."""
    half, roll = procedure.usage.pitch_deg if pitch_deg is None else pitch_deg, procedure.usage.roll_deg
    return None if half is None else Usage((-half, half), (-roll, roll))


def package_of(procedure: PitchRollProcedure, axes: Sequence[str]) -> Package | None:
    """The package of sensors along these axes, and the procedure's requirements.

    None if they are not a package with an x sensor: several along one axis, or none along x.
    """
    if "x" not in axes or len(set(axes)) < len(axes):
        return None
    expect = procedure.expect
    sigmas = {"x": expect.sigma_deg, "y": expect.sigma_y_deg, "z": expect.sigma_z_deg}
    return Package(
        {axis: sigmas[axis] or expect.sigma_deg for axis in axes},
        procedure.usage.roll_sd_deg,
        procedure.usage.pitch_sd_deg,
        expect.coning_deg,
    )


def design_points(procedure: PitchRollProcedure) -> DesignPoints:
    """The points of a procedure for the figures of merit; visits up and back count twice."""
    design = procedure.design.build()
    times = 2 if procedure.order.type == "up-and-down" else 1
    return _points(procedure.name, design, procedure.replications, times)


@dataclass(frozen=True)
class _Case:
    procedure: PitchRollProcedure
    design: Design
    points: DesignPoints
    usage: Usage
    told: bool
    tumble: bool

    @property
    def sigma_deg(self) -> float:
        return self.procedure.expect.sigma_deg

    def like(self, design: Design) -> DesignPoints:
        """Another design with the same execution: for a sensor of the same model."""
        times = self.points.points // len(self.design)
        return replace(_points(design.name, design, self.points.replications, times), roll=self.points.roll)

    def better(self, other: DesignPoints) -> tuple[float, float]:
        """Mean and worst standard deviation of `other` over those of this design, in the usage range.

        Per observation: designs of different size are compared at equal numbers of observations. Infinite if the other
        does not determine a sensor.
        """
        size = float(np.sqrt(other.observations / self.points.observations))
        try:
            mean = np.sqrt(mean_variance(other, self.usage) / mean_variance(self.points, self.usage))
            worst = np.sqrt(worst_variance(other, self.usage)[0] / worst_variance(self.points, self.usage)[0])
        except RankError:
            return float("inf"), float("inf")
        return size * float(mean), size * float(worst)

    def stretched(self, low_deg: float, high_deg: float) -> tuple[float, float]:
        """Mean and worst ratio, as of `better`, for these points with their pitch scaled to another range."""
        pitch = self.points.pitch_deg
        share = (pitch - pitch.min()) / np.ptp(pitch)
        return self.better(replace(self.points, pitch_deg=low_deg + (high_deg - low_deg) * share))


def _pitch_range(case: _Case) -> Advice:
    said = "pitch is calibrated over about 150 % of the usage range"
    low, high = float(case.points.pitch_deg.min()), float(case.points.pitch_deg.max())
    half, used = (high - low) / 2.0, case.usage.pitch_half_deg
    if case.tumble:
        return not_for(1, said, "a tumble is about as precise at every pitch")
    if not case.told:
        return not_for(1, said, f"no usage range was given; calibrated {_span(low, high)}, it suits {case.usage}")
    wanted, centre = min(RANGE_RATIO * used, 180.0), sum(case.usage.pitch_deg) / 2.0
    ideal = (centre - wanted, centre + wanted)
    covered = case.points.covers(case.usage)
    start = f"calibrated {_span(low, high)} for use within {case.usage}" + ("" if covered else ", which is beyond that")
    if covered and used > 0 and abs(half / used - RANGE_RATIO) <= 0.25:
        return _advice(
            1,
            said,
            True,
            f"{start}: the same points over the usage range alone {_would(case.stretched(*case.usage.pitch_deg))}",
        )
    found = case.stretched(*ideal)
    return _advice(
        1, said, covered and min(found) > 0.995, f"{start}: the same points over {_span(*ideal)} {_would(found)}"
    )


def _roll_range(case: _Case) -> Advice:
    said = "roll is calibrated from -180 to 180 deg"
    if not case.points.roll:
        error = np.degrees(np.sin(np.radians(1.0)) * np.radians(1.0))
        sentence = f"each degree of roll in use costs up to {error:.3f} deg of pitch at 1 deg of coning"
        return not_for(2, said, f"calibrated without roll: {sentence}")
    if case.tumble:
        return not_for(2, said, "a tumble turns the package over in pitch")
    angles = np.unique(np.mod(case.points.roll_deg, 360.0))
    gap = float(np.max(np.diff([*angles, angles[0] + 360.0])))
    if gap <= 1.5 * float(np.median(np.diff(angles))):
        return _advice(
            2, said, True, f"{len(angles)} roll angles around the circle, nowhere more than {gap:g} deg apart"
        )
    circle = grid("D", case.design.pitch_deg, roll_circle(max(3, len(case.design.roll_deg)), repeat_180=False))
    found = _would(case.better(case.like(circle)))
    return _advice(2, said, False, f"{gap:g} deg of roll are left out: as many rolls around the whole circle {found}")


def _uniform(case: _Case) -> Advice:
    said = "points are uniformly spaced in pitch and in roll"
    if case.tumble:
        return not_for(3, said, "a tumble has cardinal angles only")
    uneven = [
        f"{what} in steps of {min(steps):g} to {max(steps):g} deg"
        for what, values in (("pitch", case.design.pitch_deg), ("roll", case.design.roll_deg))
        if len(steps := np.diff(values)) and np.ptp(steps) > 1e-3 * np.max(steps)
    ]
    if not uneven:
        each = [v[1] - v[0] for v in (case.design.pitch_deg, case.design.roll_deg) if len(v) > 1]
        return _advice(3, said, True, "steps of " + " and ".join(f"{step:g} deg" for step in each))
    even = case.like(grid("D", *(uniform(v[0], v[-1], len(v)) for v in (case.design.pitch_deg, case.design.roll_deg))))
    left, own = pad_visibility(even).rms, pad_visibility(case.points).rms
    pads = f"and leave {left:.2f} instead of {own:.2f} of a pad deflection to be seen"
    return _advice(3, said, False, f"{', '.join(uneven)}: uniform steps {_would(case.better(even))}, {pads}")


def _up_and_back(case: _Case) -> Advice:
    said = "pitch goes up to its largest angle and back down"
    run = case.procedure.expand().points
    set_to = np.array([p.setpoints for p in run])
    sides = np.array([p.sides[0] for p in run])
    up = float(np.mean(sides > 0))
    columns = attitude_columns(set_to[:, 0], set_to[:, 1], roll=case.points.roll)
    drifted = fit_columns(columns, np.linspace(-0.5, 0.5, len(run)))
    shift = float(np.max(np.abs(drifted.coefficients / np.linalg.norm(drifted.root, axis=1))[1:]))
    sentence = (
        f"{_percent(up)} of the points are approached upwards; a drift of the output by one sigma through the run "
        f"would shift a coefficient by up to {shift:.2f} of its standard deviations"
    )
    holds = 0.4 <= up <= 0.6 and shift <= 1.0
    remedy = 'order.type = "up-and-down" goes both ways, and so does order.replications = "abba" in even number'
    return _advice(4, said, holds, sentence if holds else f"{sentence}; {remedy}")


def _fraction(case: _Case) -> Advice:
    said = "a fraction of the grid is enough where that has been established by experiment"
    if case.tumble:
        return not_for(5, said, "a tumble is no grid")
    whole = grid(case.design.name, case.design.pitch_deg, case.design.roll_deg)
    full, rows, columns = case.like(whole), len(whole.pitch_deg), len(whole.roll_deg)
    if case.procedure.design.fraction is None:
        every = [next((k for k in (2, 3, 5, 7) if n > k and (n - 1) % k == 0), 0) for n in (rows, columns)]
        if not all(every):
            return not_for(5, said, f"all of the grid is run; {rows} x {columns} has no interior to thin evenly")
        part = case.like(fraction(whole, pitch_every=every[0], roll_every=every[1]))
        keys = f"fraction = {{ pitch_every = {every[0]}, roll_every = {every[1]} }}"
        try:
            cost = f"{part.points} of {full.points} points a replication and be {_less_precise(part, full, case.usage)}"
        except RankError:
            return not_for(5, said, f"all of the grid is run; {keys} would not determine a sensor")
        return not_for(5, said, f"all of the grid is run; {keys} would take {cost}")
    taken = case.points
    merits = [figure_of_merit(d, case.usage) for d in (taken, full)]
    lof = taken.points - taken.parameters
    seen = [pad_visibility(replace(d, replications=max(2, d.replications))).smallest for d in (taken, full)]
    return _advice(
        5,
        said,
        merits[0] <= 1.1 * merits[1] and lof >= 10,
        f"{taken.points} of {full.points} points a replication, {_less_precise(taken, full, case.usage)} (figure of "
        f"merit {merits[0]:.3f}, of the whole grid {merits[1]:.3f}); degrees of freedom to test the model: {lof}; pads "
        f"show {_from(seen[0] * case.sigma_deg)}, with the whole grid {_from(seen[1] * case.sigma_deg)}",
    )


def _replications(case: _Case) -> Advice:
    said = "a calibration is replicated at least 6 times, preferably 10"
    n = case.procedure.replications
    if n == 1:
        sentence = "run once: neither T_bias nor the drift tests T_b and T_S exist, and sigma_prec stays unknown"
        return _advice(6, said, False, sentence)
    if case.points.points == case.points.parameters:
        sentence = f"{n} replications of as many points as coefficients: none leaves an error to judge drift by"
        return _advice(6, said, n >= REPLICATIONS, sentence)
    drift = [smallest_offset_drift(replace(case.points, replications=r)) * case.sigma_deg for r in (n, 10)]
    sentence = f"{n} replications find an offset that varies between them by {drift[0]:.1e} deg nine times in ten"
    return _advice(6, said, n >= REPLICATIONS, sentence + ("" if n >= 10 else f"; ten would find {drift[1]:.1e} deg"))


def _no_tumble(case: _Case) -> Advice:
    said = "no four-point or six-point tumble in the laboratory"
    points, usage = case.points, case.usage
    sd = case.sigma_deg * float(np.sqrt(worst_variance(points, usage)[0]))
    if not case.tumble:
        other = case.like(tumble(roll=points.roll))
        than = case.sigma_deg * float(np.sqrt(worst_variance(other, usage)[0]))
        sentence = f"{points.points} points: {sd:.1e} deg at worst, where a tumble leaves {than:.1e} deg"
        return _advice(7, said, True, sentence)
    lof = points.points - points.parameters
    return _advice(
        7, said, False, f"{points.points} points at cardinal angles: {sd:.1e} deg at worst, degrees of freedom to "
        f"test the model: {lof}, and {pad_visibility(points).rms:.2f} of a pad deflection left to be seen"
    )  # fmt: skip


def _pads(case: _Case) -> Advice:
    said = "a wide pitch range shows systematic errors that a narrow one hides"
    seen = pad_visibility(case.points)
    smallest = seen.smallest * case.sigma_deg
    model = "with roll" if case.points.roll else "without roll"
    left = f"{model}, {seen.rms:.2f} of an isolation-pad deflection stays in the residuals"
    if not np.isfinite(smallest):
        imitated = "it is zero at every point" if case.tumble else "the model can explain all of it"
        why = imitated if seen.rms == 0 else "nothing is replicated"
        return Advice(0, said, False, f"{left}: it cannot be found, since {why}")
    holds = smallest <= PAPERS_PADS_DEG
    remedies = ("go beyond +-90 deg of pitch or roll too", "more points or replications find smaller ones")
    hint = "" if holds else f"; {remedies[case.points.roll]}"
    found = f"found nine times in ten from {smallest:.1e} deg (the paper's were {PAPERS_PADS_DEG:.0e} deg)"
    return Advice(0, said, holds, f"{left}: {found}{hint}")


_CHECKS: tuple[Callable[[_Case], Advice], ...] = (
    _pitch_range,
    _roll_range,
    _uniform,
    _up_and_back,
    _fraction,
    _replications,
    _no_tumble,
)


def _advice(number: int, said: str, holds: bool, sentence: str) -> Advice:
    return Advice(number, said, bool(holds), sentence)


def _points(name: str, design: Design, replications: int, times: int) -> DesignPoints:
    pitch, roll = np.tile(np.array(design.points_deg()).T, times)
    return DesignPoints(name, pitch, roll, roll=bool(np.ptp(roll)), replications=replications)


def _two_thirds(points: DesignPoints) -> Usage:
    low, high = float(points.pitch_deg.min()), float(points.pitch_deg.max())
    centre, half = (low + high) / 2.0, (high - low) / 2.0 / RANGE_RATIO
    return Usage((centre - half, centre + half))


def _is_tumble(points: DesignPoints) -> bool:
    """Whether there are only cardinal angles: at most six different attitudes."""
    angles = np.concatenate([points.pitch_deg, points.roll_deg])
    return bool(np.all(np.mod(angles, 90.0) == 0.0))


def _less_precise(one: DesignPoints, other: DesignPoints, usage: Usage) -> str:
    return f"{_percent(np.sqrt(mean_variance(one, usage) / mean_variance(other, usage)) - 1)} less precise"


def _from(smallest_deg: float) -> str:
    return f"from {smallest_deg:.1e} deg" if np.isfinite(smallest_deg) else "at no size"


def _span(low: float, high: float) -> str:
    return f"+-{high:g} deg" if low == -high else f"{low:g} to {high:g} deg"


def _percent(share: float) -> str:
    return f"{100.0 * share:.0f} %"


def _would(found: tuple[float, float]) -> str:
    """Ratios of standard deviations in words, on average and at worst."""
    if not np.all(np.isfinite(found)):
        return "would not determine a sensor"
    return "would be {} on average, {} at worst".format(*(_change(ratio) for ratio in found))


def _change(ratio: float) -> str:
    if abs(ratio - 1.0) < 0.005:
        return "no better"
    return f"{_percent(1.0 - ratio)} better" if ratio < 1.0 else f"{_percent(ratio - 1.0)} worse"
