"""How often `rig chart` is right: false alarms of its tests, and whether sensors are within tolerance when due.

Every history is a sensor with readings, replications and calibrations of its own (proving/truth/chart.py): 5 x 5 points
three times, half a year apart, replications with offsets of their own. A seed is a stream of histories.
"""

from __future__ import annotations

from collections import defaultdict
from functools import partial

import numpy as np

from proving.frame import Figures, Part, Results, Study
from proving.ledger import Result
from proving.truth.chart import KINDS, draw_history, largest_error_deg
from rig.fitter.history import Between, error_bound, homogeneity, limits, step, trend
from rig.procedures.attitude.history import attitude_charted, calibrated

COUNTS = (3, 6, 10, 20)
SIZES = {"none": 0.0, "scatter": 2.0, "walk": 3.0, "together": 3.0, "step": 5.0, "linear": 3.0}
TOLERANCES_DEG = (3e-4, 6e-4, 1.2e-3)
BOUNDED = tuple(a.ravel() for a in np.meshgrid(np.linspace(-30, 30, 5), np.arange(0, 360, 30.0)))
"""Attitudes the bound is made for, as `rig chart` does; the true error is looked for on a finer grid."""
TESTS = ("homogeneity", "trend", "steady", "step", "95 %", "99.7 %")
BETWEEN = {"the earlier of both": None, **{f"taken to {b.value}": b for b in Between}}


def charts(histories: int = 400) -> Study:
    """Shares in percent of tests at 5 % that say there is something, and of sensors within tolerance when due."""
    which = [(kind, count) for kind in KINDS for count in COUNTS]
    cases = {f"{k}, {n} calibrations": partial(_stream, kind=k, count=n, histories=histories) for k, n in which}
    return Study(cases, _shares)


def _stream(seed: int, kind: str, count: int, histories: int) -> Result:
    rng = np.random.default_rng([KINDS.index(kind), count, seed])
    found: dict[str, list[float]] = defaultdict(list)
    for _ in range(histories):
        history = draw_history(kind, count, rng, SIZES[kind])
        fits = [calibrated(run, "x_V") for run in history.runs()]
        charted, last = attitude_charted(fits, history.years), fits[-1].coefficients
        for series in charted.series:
            tested, charts = trend(series), limits(series)
            assert tested is not None
            assert charts is not None
            found["homogeneity"].append(homogeneity(series).p < 0.05)
            found["trend"].append(tested.p < 0.05)
            found["steady"].append(max(tested.p, tested.p_walk) < 0.05)
            if count > 3:
                stepped = step(series)
                assert stepped is not None
                found["step"].append(stepped.p < 0.05)
            found["95 %"] += charts.warned.tolist()
            found["99.7 %"] += charts.out.tolist()
        bound = error_bound(charted, charted.output_rows(*BOUNDED), times=17, draws=1024, nodes=64)
        assert bound is not None
        for tolerance in TOLERANCES_DEG:
            for name, between in BETWEEN.items():
                years = bound.holds_for(tolerance, between)
                found[f"dated {name} {tolerance:g}"].append(years is not None)
                if years is not None:
                    error = largest_error_deg(history.after(years), last)
                    found[f"within {name} {tolerance:g}"].append(error <= tolerance)
                    found[f"age {name} {tolerance:g}"].append(years)
    return {name: [float(value) for value in values] for name, values in found.items()}


def _shares(results: Results) -> Figures:
    found: dict[str, list[float]] = defaultdict(list)
    for one in results:
        for name, values in one.items():
            found[name] += values
    out: Figures = {test: 100.0 * float(np.mean(found[test])) for test in TESTS if found[test]}
    for name in BETWEEN:
        for tolerance in TOLERANCES_DEG:
            within, dated, age = (found[f"{what} {name} {tolerance:g}"] for what in ("within", "dated", "age"))
            due = {"dated": 100.0 * float(np.mean(dated))}
            if within:
                due |= {"within": 100.0 * float(np.mean(within)), "median age": float(np.median(age))}
            out[f"{tolerance:g} deg, {name}"] = due
    return out


PARTS = {"": Part(charts, seeds=1)}
