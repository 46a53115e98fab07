"""Pressure calibrations simulated by the thousand: how large is the reading error, and do intervals hold?"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from functools import cache, partial

import numpy as np
from scipy.special import ndtri, stdtr

from proving.frame import Figures, Part, Results, Study
from proving.ledger import Result
from proving.truth.pressure import GROWING, GROWING_AND_CUBIC, HOMOSCEDASTIC, Transducer, simulate
from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.quantiles import t_limit
from rig.fitter.split_plot import SplitPlotDesign
from rig.procedures.pressure.fit import METHODS, fit_pressure
from rig.procedures.pressure.fit.methods import fit_method
from rig.procedures.pressure.infer import Zero, infer_pressure


def coverage(
    transducer: Transducer, method: str, seed: int, *, pressures: Sequence[float] = (0.12, 1.0, 4.5)
) -> dict[str, bool]:
    """Whether each 95 % interval of one simulated calibration holds the truth.

    In the whole-plot stratum coefficients, the mean output at given settings and the output of a new whole plot; below
    it coefficients; and pressures inferred at other temperatures in a new whole plot, after a noisy zero and without.
    """
    data, _ = simulate(transducer, seed)
    fit = fit_pressure(data, "bridge_mV")
    rng = np.random.default_rng([19991231, seed])
    sensor, sse = rng.uniform(-118, -62), rng.uniform(-28, 28)
    at, at_pressure = {"P": np.array([1.0]), "T_sensor": np.array([sensor]), "T_SSE": np.array([sse])}, 1.0
    error = rng.normal(0, transducer.wholeplot_mV)
    inside: dict[str, bool] = {}

    def holds(name: str, centre: float, half: float, truth: float) -> None:
        inside[name] = bool(abs(centre - truth) <= half)

    clean = float(transducer.output_mV(at_pressure, sensor, sse))
    if method == "GLS" and transducer.subplot_mV_per_psi == 0.0:
        row = fit.formula.columns(at)[1]
        mean = fit.reml.predict(row)[0]
        holds("mean output (whole-plot stratum)", mean, fit.reml.interval(row)[0], clean)
        new = clean + error + rng.normal() * float(transducer.subplot_sd(np.array(at_pressure)))
        half = fit.reml.interval(row, new_whole_plot=True, new_readings=1.0)[0]
        holds("output of a new whole plot", mean, half, float(new))
    found = fit_method(fit.problem, method)
    for name, stratum, truth in (
        ("T_SSE^2", "whole-plot", 0.0),
        ("T_sensor:T_SSE", "whole-plot", transducer.cross_offset_per_degC2),
        ("P:T_SSE", "subplot", transducer.sensitivity_mV_per_psi * transducer.gain_per_degC),
        ("P^2", "subplot", transducer.sensitivity_mV_per_psi * transducer.bend_per_psi),
    ):
        i = found.names.index(name)
        half = t_limit(0.95, found.df[i]) * found.stderr[i]
        holds(f"coefficient {name} ({stratum} stratum)", found.coefficients[i], half, truth)
    calibration = fit.calibration(method)
    read = transducer.output_mV(np.array([0.0, *pressures]), sensor, sse) + error
    read += rng.normal(size=len(read)) * transducer.subplot_sd(np.array([0.0, *pressures]))
    for label, zero in (("after a zero", Zero(read[0], sensor, sse)), ("without a zero", None)):
        inferred = infer_pressure(calibration, read[1:], sensor, sse, zero)
        for i, pressure in enumerate(pressures):
            low, high = inferred.lo95_psia[i], inferred.hi95_psia[i]
            inside[f"pressure {pressure:g} psia {label}"] = bool(low <= pressure <= high)
    return inside


READING_ERROR = {
    "homoscedastic, variance ratio 10": HOMOSCEDASTIC,
    "sd 0.4 + 0.3 P, undeclared cubic": GROWING_AND_CUBIC,
}
COVERAGE = {
    "homoscedastic": (HOMOSCEDASTIC, ("GLS", "in-flight zero", "in-flight zero + WLS")),
    "sd 0.4 + 0.3 P": (GROWING, ("GLS", "in-flight zero", "in-flight zero + WLS")),
    "no whole-plot error (at the boundary)": (replace(HOMOSCEDASTIC, wholeplot_mV=0.0), ("GLS",)),
}


def reading_error(model: str = "hierarchical", pressure: float = 0.12) -> Study:
    """The largest |marginal residual| at a pressure over dV/dP and that pressure, in percent."""
    cases = {truth: partial(_largest, truth=truth, model=model, pressure=pressure) for truth in READING_ERROR}
    return Study(cases, _quartiles)


def _largest(seed: int, truth: str, model: str, pressure: float) -> Result:
    data, _ = simulate(READING_ERROR[truth], seed)
    found = {}
    for method, fit in fit_pressure(data, "bridge_mV", model).methods.items():
        at = int(np.argmin(np.abs(fit.reading_error.pressure_psia - pressure)))
        found[method] = float(fit.reading_error.max_pct[at])
    return found


def _quartiles(results: Results) -> Figures:
    """[quartile, median, quartile] by method."""
    return {m: np.quantile([one[m] for one in results], [0.25, 0.5, 0.75]).tolist() for m in METHODS}


def holding() -> Study:
    """How often nominal 95 % intervals of a whole calibration, made by what a user calls, hold the truth."""
    cells = [(truth, method) for truth, (_, methods) in COVERAGE.items() for method in methods]
    cases = {f"{truth}, {method}": partial(_held, truth=truth, method=method) for truth, method in cells}
    return Study(cases, _percent, block=50)


def _held(seed: int, truth: str, method: str) -> Result:
    return coverage(COVERAGE[truth][0], method, seed)


def _percent(results: Results) -> Figures:
    held = Counter({interval: 0 for one in results for interval in one})
    for one in results:
        held.update({interval: int(inside) for interval, inside in one.items()})
    return {interval: 100.0 * count / len(results) for interval, count in held.items()}


def few() -> Study:
    """How far degrees of freedom hold in a night of four whole plots and three pressures."""
    return Study({"four whole plots, three pressures": _score}, _scores, block=100)


@cache
def _small() -> tuple[SplitPlotDesign, FloatArray, IntArray]:
    pressure, plot = np.tile([0.12, 1.0, 2.5], 4), np.repeat(np.arange(4), 3)
    x = np.column_stack([np.ones(12), pressure])
    return SplitPlotDesign(x, plot, ("1", "P")), x, plot


def _score(seed: int) -> Result:
    """Coefficients less the truth over their standard errors, made standard normal by their t distributions."""
    (design, x, plot), truth, rng = _small(), np.array([1.0, 2.0]), np.random.default_rng(seed)
    fit = design.fit(x @ truth + rng.normal(0.0, 0.0155, 4)[plot] + rng.normal(0.0, 0.0049, 12))
    z = ndtri(stdtr(fit.df, (fit.coefficients - truth) / fit.stderr))
    return dict(zip(("offset", "sensitivity"), z.tolist(), strict=True))


def _scores(results: Results) -> Figures:
    out = {}
    for name in ("offset", "sensitivity"):
        z = np.array([one[name] for one in results])
        outside = 100.0 * float(np.mean(np.abs(z) > 1.96))
        out[name] = {"mean": float(z.mean()), "sd": float(z.std()), "outside 95 %": outside}
    return out


PARTS = {"reading-error": Part(reading_error, 50), "coverage": Part(holding, 10_000), "few": Part(few, 30_000)}
