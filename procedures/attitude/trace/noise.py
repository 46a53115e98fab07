"""Findings about noise: a random walk of the offset, growing scatter, outliers.

These findings have the stratum "noise". They limit the validity of other findings and of intervals; no column is added
to the model for them.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy import special

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.effects.noise_names import AUTOCORRELATION, NOISE_GROWS, OUTLIERS
from rig.fitter.trace.chance import ALPHA, COUNTED
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.trace.estimate import Estimate
from rig.procedures.attitude.trace.problem import Problem, raw_columns
from rig.procedures.attitude.trace.result import FoundEffect
from rig.procedures.attitude.trace.score import errors, rounding, whiten
from rig.procedures.attitude.trace.wander import walk_evidence


def noise_findings(problem: Problem, after: Estimate, i: int) -> tuple[FoundEffect, ...]:
    """Findings about noise in the residual of sensor `i` with the effects."""
    if problem.levels.df(problem.levels.of_error) <= 0:
        return ()
    sigma = errors(problem, after.chosen)
    if sigma[i] <= 10 * rounding(problem)[i]:
        return ()
    left = whiten(problem, problem.levels.of_error, after.chosen, sigma).outputs[i]
    # with a random walk squared residuals are not independent
    found = _walk(problem, left, float(sigma[i]), i) or _growth(problem, after, left, float(sigma[i]), i)
    return () if found is None else (found,)


def _walk(problem: Problem, left: FloatArray, sigma: float, i: int) -> FoundEffect | None:
    p, step = walk_evidence(problem, left)
    p_adjusted = min(p * len(problem.sensors) / COUNTED, 1.0)
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
        "pitch off level": ("pitch_deg", np.abs(scene.data.pitch_deg)),
        "time": ("elapsed_s", scene.hours()),
    }
    if scene.temperature_degC is not None:
        drivers["temperature"] = ("sensor_temperature_degC", scene.warmth())
    return {name: driver for name, driver in drivers.items() if np.ptp(driver[1]) > 0}


def _growth(problem: Problem, after: Estimate, left: FloatArray, sigma: float, i: int) -> FoundEffect | None:
    """The driver with the most significant relation to squared residuals, by Koenker's test (J. Econometrics 17 (1981)
    107).
    """
    squares, drivers = left**2, _drivers(problem, i)
    about, best = squares - squares.mean(), (1.0, "", 0.0)
    for name, (_, value) in drivers.items():
        x = value - value.mean()
        correlation = float(x @ about) / float(np.sqrt((x @ x) * (about @ about)))
        p = float(special.chdtrc(1, squares.size * correlation**2))
        if p < best[0]:
            best = p, name, float(x @ about / (x @ x))
    p, name, slope = best
    p_adjusted = min(p * len(drivers) * len(problem.sensors) / COUNTED, 1.0)
    if not name or p_adjusted > ALPHA:
        return None
    against, value = drivers[name]
    ends = 1.0 + slope * (np.quantile(value, [0.02, 0.98]) - value.mean()) / squares.mean()
    low, high = (sigma * np.sqrt(np.maximum(ends, 0.0))).tolist()
    least, most = np.quantile(_intervals(problem, after, squares / squares.mean(), i), [0.0, 1.0]).tolist()
    return FoundEffect.of_noise(
        effect=NOISE_GROWS,
        cause=f"the scatter of readings changes with the {name}",
        terms=(f"sd at the lowest {name}", f"sd at the highest {name}"),
        coefficients=(low, high),
        unit="V",
        size=f"{1e6 * low:.3g} uV to {1e6 * high:.3g} uV; coefficients scatter by {least:.2f} to {most:.2f} times "
        "their standard errors, which are computed with one sd for all",
        p=p_adjusted,
        separate_by="read one point of each kind a hundred times",
        against=against,
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


def outlier_finding(
    problem: Problem, whole: AttitudeData, rows: IntArray, sd: FloatArray, moved: float, i: int
) -> FoundEffect:
    """The outliers of sensor `i`.

    Args:
        problem: of the run without them.
        whole: the run with them.
        rows: (k,) outliers of sensor `i`, rows of the whole run.
        sd: (n,) deviations, in standard deviations.
        moved: change of the fit by them, in its standard errors.
        i: the sensor.
    """
    worst = rows[np.argsort(-np.abs(sd[rows]))]
    scale = float(errors(problem, ())[i])
    where = tuple(
        f"order {whole.order[r]} at pitch {whole.pitch_deg[r]:g} deg, roll {whole.roll_deg[r]:g} deg" for r in worst
    )
    return FoundEffect.of_noise(
        effect=OUTLIERS,
        cause="readings that no scatter of the others explains; they are left out of the search and of the fit",
        terms=where,
        coefficients=tuple(float(sd[r] * scale) for r in worst),
        unit="V",
        size=f"{rows.size} of {len(whole)} readings, up to {np.max(np.abs(sd[rows])):.3g} sd; with them the fit moves "
        f"by up to {moved:.2g} of its standard errors",
        p=float(min(sd.size * len(problem.sensors) * 2 * special.ndtr(-np.min(np.abs(sd[rows]))), 1.0)),
        separate_by="repeat these points",
        against="elapsed_s",
    )
