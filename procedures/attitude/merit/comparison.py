"""Designs side by side: number of points, and precision over the range of use of a sensor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rig.fitter import RankError, ties
from rig.fitter.arrays import FloatArray
from rig.fitter.quantiles import t_limit
from rig.procedures.attitude.merit.design_points import DesignPoints, Usage
from rig.procedures.attitude.merit.merit import mean_variance, variance, worst_variance
from rig.procedures.attitude.merit.visibility import pad_visibility

NAN = float("nan")


@dataclass(frozen=True)
class Comparison:
    """One design, for a sensor along x, y or z. Degrees are those of calibrated output, sigma/S, as in Table 2.

    Attributes:
        name: of the design.
        roll: whether the sensor is calibrated with roll.
        points: K, visits in one replication.
        replications: n.
        observations: n K, its cost.
        df: degrees of freedom left for error, n K - L.
        mean_sd_deg: root of the mean variance of the calibrated output over the usage range.
        worst_sd_deg: largest standard deviation there.
        worst_pitch_deg: its pitch.
        worst_interval95_deg: half-width of the 95 % calibration interval there, eq. (72): it is large for few degrees
            of freedom. NaN without any.
        figure_of_merit: V^(1/2) over the usage range, eq. (53).
        pads_seen: share of an isolation-pad deflection's effect on an x sensor that stays in the residuals.
        smallest_pad_deg: pad deflection that T_bias detects with probability 0.9; infinite if it cannot.
        extrapolated: whether the usage range goes beyond the calibrated pitch.
        undetermined: why the design does not determine a sensor (all figures are then NaN); otherwise empty.
    """

    name: str
    roll: bool
    points: int
    replications: int
    observations: int
    df: int
    mean_sd_deg: float = NAN
    worst_sd_deg: float = NAN
    worst_pitch_deg: float = NAN
    worst_interval95_deg: float = NAN
    figure_of_merit: float = NAN
    pads_seen: float = NAN
    smallest_pad_deg: float = NAN
    extrapolated: bool = False
    undetermined: str = ""


@dataclass(frozen=True, eq=False)
class Curve:
    """Standard deviation of the calibrated output over pitch: one line, or a family of them, of figures 1 to 5.

    Attributes:
        name: of the design.
        pitch_deg: (m,).
        roll_deg: (r,) roll of each line.
        sd_deg: (r, m).
        normalised: (r, m) the same over sigma and times the root of the number of observations, as the paper plots it.

    """

    name: str
    pitch_deg: FloatArray
    roll_deg: FloatArray
    sd_deg: FloatArray
    normalised: FloatArray


@dataclass(frozen=True)
class Recommendation:
    """The recommended design, with the reason.

    Attributes:
        name: of the design.
        why: the reason, with numbers.
    """

    name: str
    why: str


def compare(designs: Sequence[DesignPoints], usage: Usage, sigma_deg: float) -> tuple[Comparison, ...]:
    """A row for each design, in the given order. The row of a design that does not determine a sensor has the reason.

    Args:
        designs: the compared designs, with or without roll.
        usage: attitudes of use of the sensor.
        sigma_deg: expected standard error of one observation.
    """
    return tuple(_row(design, usage, sigma_deg) for design in designs)


def recommend(
    rows: Sequence[Comparison], *, wanted_sd_deg: float | None = None, cost: Sequence[float] | None = None
) -> Recommendation | None:
    """The recommended design. None if no design determines a sensor over the range of use.

    Designs that would have to extrapolate are left out, and so are those that do not show a pad deflection shown by
    others. Of the rest: the cheapest that meets the requirement at the worst attitude; without a requirement, the one
    with the smallest product of worst variance and cost.

    Args:
        rows: of `compare`.
        wanted_sd_deg: required standard deviation of the calibrated output.
        cost: of each row, in any unit (hours on the bench); without it the number of observations.
    """
    costs = [float(r.observations) for r in rows] if cost is None else list(cost)
    fit = [(r, c) for r, c in zip(rows, costs, strict=True) if not r.undetermined and not r.extrapolated]
    fit = [(r, c) for r, c in fit if np.isfinite(r.smallest_pad_deg)] or fit
    if not fit:
        return None
    if wanted_sd_deg is None:
        best, _ = ties.least(fit, key=lambda pair: pair[0].worst_sd_deg ** 2 * pair[1])
        why = f"most precise for its cost (worst variance times cost is least): {best.worst_sd_deg:.1e} deg at worst"
        return Recommendation(best.name, f"{why}, figure of merit {best.figure_of_merit:.3f}")
    enough = [pair for pair in fit if pair[0].worst_sd_deg <= wanted_sd_deg]
    if enough:
        best, _ = ties.least(enough, key=lambda pair: pair[1])
        why = f"cheapest that reaches {wanted_sd_deg:.1e} deg: {best.worst_sd_deg:.1e} deg at worst"
        return Recommendation(best.name, why)
    best, _ = ties.least(fit, key=lambda pair: pair[0].worst_sd_deg)
    times = (best.worst_sd_deg / wanted_sd_deg) ** 2
    why = f"nearest to {wanted_sd_deg:.1e} deg with {best.worst_sd_deg:.1e} deg at worst"
    return Recommendation(best.name, f"{why}; it takes {times:.1f} times as many replications")


def curve(
    design: DesignPoints, usage: Usage, sigma_deg: float, *, roll_deg: Sequence[float] = (0.0,), count: int = 181
) -> Curve:
    """Standard deviation over the range of use of pitch, at `count` angles.

    Args:
        design: calibration points.
        usage: range of use; its pitch is the abscissa.
        sigma_deg: expected standard error of one observation.
        roll_deg: a line for each; with design D0 and D1 they are one (Theorem IV).
        count: number of pitch angles.

    Raises:
        rig.fitter.linear.RankError: the design does not determine the model.
    """
    pitch, roll = np.linspace(*usage.pitch_deg, count), np.array(roll_deg, np.float64)
    over_sigma = np.sqrt(variance(design, pitch[None, :], roll[:, None]))
    return Curve(design.name, pitch, roll, sigma_deg * over_sigma, np.sqrt(design.observations) * over_sigma)


def _row(design: DesignPoints, usage: Usage, sigma_deg: float) -> Comparison:
    df = design.observations - design.parameters
    counts = (design.name, design.roll, design.points, design.replications, design.observations, df)
    try:
        mean = mean_variance(design, usage)
        worst, worst_pitch, _ = worst_variance(design, usage)
    except RankError as error:
        return Comparison(*counts, undetermined=str(error))
    pads = pad_visibility(design)
    return Comparison(
        *counts,
        mean_sd_deg=sigma_deg * float(np.sqrt(mean)),
        worst_sd_deg=sigma_deg * float(np.sqrt(worst)),
        worst_pitch_deg=worst_pitch,
        worst_interval95_deg=t_limit(0.95, df) * sigma_deg * float(np.sqrt(worst)) if df > 0 else NAN,
        figure_of_merit=float(np.sqrt(design.observations * mean)),
        pads_seen=pads.share,
        smallest_pad_deg=pads.smallest * sigma_deg,
        extrapolated=not design.covers(usage),
        undetermined="",
    )
