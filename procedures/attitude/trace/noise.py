"""Findings about noise: a random walk of the offset, growing scatter, readings
that stand alone.

These findings have the stratum "noise". They limit the validity of other findings and of intervals; no column is added
to the model for them.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.effects.noise_names import AUTOCORRELATION, NOISE_GROWS
from rig.fitter.resolution import resolution
from rig.fitter.trace.chance import ALPHA, counted
from rig.fitter.trace.engine.robust import in_groups, told
from rig.fitter.trace.growing_noise import Growth, growth_of
from rig.fitter.trace.limits import limit
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.trace.estimate import Estimate
from rig.procedures.attitude.trace.problem import Problem, raw_columns
from rig.procedures.attitude.trace.result import FoundEffect
from rig.procedures.attitude.trace.score import errors, rounding
from rig.procedures.attitude.trace.view import View
from rig.procedures.attitude.trace.wander import walk_evidence

FEW = limit("most outliers", "pitch-roll")
"""Maximum share of readings that stand alone; more mean noise with long tails, or an effect."""
REPLICATIONS = 3
"""Minimum number of readings for a point's median; with fewer, readings are compared with the model alone."""


def noise_findings(problem: Problem, after: Estimate, i: int) -> tuple[FoundEffect, ...]:
    """Findings about noise in the residual of sensor `i` with the effects."""
    if problem.levels.df(problem.levels.of_error) <= 0:
        return ()
    sigma = errors(problem, after.chosen)
    if sigma[i] <= 10 * rounding(problem)[i]:
        return ()
    left = View(problem, problem.levels.of_error, after.chosen, sigma).outputs[i]
    # with a random walk squared residuals are not independent
    found = _walk(problem, left, float(sigma[i]), i) or _growth(problem, after, left * sigma[i], i)
    return () if found is None else (found,)


def _walk(problem: Problem, left: FloatArray, sigma: float, i: int) -> FoundEffect | None:
    p, step = walk_evidence(problem, left)
    p_adjusted = counted(p, len(problem.sensors))
    if problem.wander[i] == 0 and p_adjusted > ALPHA:
        return None
    night = sigma * float(np.sqrt(max(step, problem.wander[i]) * len(left)))
    return FoundEffect.of_noise(
        effect=AUTOCORRELATION,
        cause="the offset takes a random walk: its past does not determine its future",
        terms=("sd of the walk over the run",),
        coefficients=(night,),
        unit="V",
        size=f"{1e6 * night:.3g} uV in {np.ptp(problem.scene.data.elapsed_s) / 3600:.3g} h",
        p=p_adjusted,
        separate_by="go on for some hours at one point: a drift continues, a walk changes its direction",
        against="elapsed_s",
    )


def _drivers(problem: Problem, i: int) -> Mapping[str, tuple[str, FloatArray]]:
    """Variables on which the noise may depend: field for a plot, and (n,) values."""
    scene, sensor = problem.scene, problem.sensors[i]
    drivers = {
        "slope of the output with the angles": (
            "pitch_deg",
            np.hypot(scene.per_pitch(sensor), scene.per_roll(sensor) if scene.roll else 0.0),
        ),
        "gravity along the sensor": ("pitch_deg", np.abs(scene.along(sensor))),
        "pitch": ("pitch_deg", scene.data.pitch_deg),
        "time": ("elapsed_s", scene.hours()),
    }
    if scene.temperature_degC is not None:
        drivers["temperature"] = ("sensor_temperature_degC", scene.warmth())
    return drivers


def _growth(problem: Problem, after: Estimate, left: FloatArray, i: int) -> FoundEffect | None:
    """Scatter that changes with one of the drivers."""
    drivers, n = _drivers(problem, i), len(left)
    share = np.full(n, problem.levels.df(problem.levels.of_error) / n)
    found = growth_of(left, share, {name: v for name, (_, v) in drivers.items()}, sensors=len(problem.sensors))
    if not isinstance(found, Growth):
        return None
    terms, size = found.told(found.driver, 1e6, " uV")
    least, most = np.quantile(_intervals(problem, after, left**2 / np.mean(left**2), i), [0.0, 1.0]).tolist()
    return FoundEffect.of_noise(
        effect=NOISE_GROWS,
        cause=f"the scatter of readings changes with the {found.driver}",
        terms=tuple(terms),
        coefficients=tuple(terms.values()),
        unit="V",
        size=f"{size}; coefficients scatter by {least:.2f} to {most:.2f} times their standard errors, which are "
        "computed with one sd for all",
        p=found.p,
        separate_by="read one point of each kind a hundred times",
        against=drivers[found.driver][0],
    )


def _intervals(problem: Problem, after: Estimate, squares: FloatArray, i: int) -> FloatArray:
    """(k,) true over stated standard errors of all coefficients of sensor `i`.

    Args:
        problem: the run.
        after: the fit.
        squares: (n,) of the residuals, over their mean; for any dependence of the scatter.
        i: the sensor.
    """
    data = problem.scene.data
    h = problem.fits[problem.sensors[i]].columns(data.pitch_deg, data.roll_deg)
    effects = raw_columns(problem.scene, [problem.candidates[j] for j in after.chosen])[i]
    columns = np.column_stack([h, effects[:, np.any(effects != 0, axis=0)]])
    weights = np.linalg.pinv(columns / np.linalg.norm(columns, axis=0))
    return np.asarray(np.sqrt(weights**2 @ squares / np.sum(weights**2, axis=1)))


def alone(data: AttitudeData, residual: FloatArray) -> FloatArray:
    """(S, n) reduction of readings that stand alone, V; zero for most.

    A reading is compared with the median of its point over replications; of few replications with the model alone.

    Args:
        data: the run.
        residual: (S, n) of every sensor, V.

    """
    group = data.point if data.replicates.size >= REPLICATIONS else np.zeros(len(data), np.int64)
    each, sd = zip(residual, data.outputs.values(), strict=True), np.ones(len(data))
    return np.stack([in_groups(left, resolution(output), group, sd, FEW, len(residual)) for left, output in each])


def alone_finding(
    problem: Problem, after: Estimate, off: FloatArray, residual: FloatArray, i: int
) -> tuple[FoundEffect, ...]:
    """The readings of sensor `i` that stand alone, of those (S, n) reduced, by the residual (S, n) of all, V."""
    data = problem.scene.data

    def place(row: int) -> str:
        return f"order {data.order[row]} at pitch {data.pitch_deg[row]:g} deg, roll {data.roll_deg[row]:g} deg"

    error, df = np.full(len(data), errors(problem, after.chosen)[i]), problem.levels.df(problem.levels.of_error)
    found = told(off[i], residual[i], error, df, len(problem.sensors), place)
    return () if found is None else (FoundEffect.of_noise(unit="V", **found),)
