"""How often `rig chart` is right: false alarms of its tests, and whether sensors are within tolerance when due.

    python -m benchmarks.chart_campaign          400 histories a cell, some ten minutes on two cores
    python -m benchmarks.chart_campaign 1000

Every history is a sensor on the bench of the fitter's tests, with readings, replications and calibrations of its own
(proving/truth/chart.py): 5 x 5 points three times, half a year apart, replications with offsets of their own.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # figures are per core

import sys
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from fitter.history import Between, error_bound, homogeneity, limits, step, trend
from procedures.attitude.history import attitude_charted, calibrated
from proving.truth.chart import KINDS, draw_history, largest_error_deg

COUNTS = (3, 6, 10, 20)
SIZES = {"none": 0.0, "scatter": 2.0, "walk": 3.0, "together": 3.0, "step": 5.0, "linear": 3.0}
TOLERANCES_DEG = (3e-4, 6e-4, 1.2e-3)
BOUNDED = tuple(a.ravel() for a in np.meshgrid(np.linspace(-30, 30, 5), np.arange(0, 360, 30.0)))
"""Attitudes the bound is made for, as `rig chart` does; the true error is looked for on a finer grid."""
FAST = {"times": 17, "draws": 1024, "nodes": 64}


def cell(kind, count, histories):
    """Shares, by name, over so many histories."""
    rng = np.random.default_rng([KINDS.index(kind), count])
    found = defaultdict(list)
    for _ in range(histories):
        history = draw_history(kind, count, rng, SIZES[kind])
        fits = [calibrated(run, "x_V") for run in history.runs()]
        charted, last = attitude_charted(fits, history.years), fits[-1].coefficients
        for series in charted.series:
            tested = trend(series)
            found["homogeneity"].append(homogeneity(series).p < 0.05)
            found["trend"].append(tested.p < 0.05)
            found["steady"].append(max(tested.p, tested.p_walk) < 0.05)
            if count > 3:
                found["step"].append(step(series).p < 0.05)
            charts = limits(series)
            found["95 %"] += charts.warned.tolist()
            found["99.7 %"] += charts.out.tolist()
        bound = error_bound(charted, charted.output_rows(*BOUNDED), **FAST)
        for tolerance in TOLERANCES_DEG:
            for name, between in (("both", None), *((b.value, b) for b in Between)):
                years = bound.holds_for(tolerance, between)
                found[f"dated {name} {tolerance:g}"].append(years is not None)
                if years is not None:
                    error = largest_error_deg(history.after(years), last)
                    found[f"within {name} {tolerance:g}"].append(error <= tolerance)
                    found[f"age {name} {tolerance:g}"].append(years)
    return found


def main(histories):
    which = [(kind, count) for kind in KINDS for count in COUNTS]
    with ProcessPoolExecutor(2) as pool:
        made = pool.map(cell, *zip(*which, strict=True), [histories] * len(which))
        cells = dict(zip(which, made, strict=True))
    print(f"{histories} histories a cell. Share of tests at 5 % that say there is something, in percent")
    tests = ("homogeneity", "trend", "steady", "step", "95 %", "99.7 %")
    print(f"{'drift':9}{'n':>3}" + "".join(f"{t:>13}" for t in tests))
    for (kind, count), found in cells.items():
        row = "".join(f"{100 * np.mean(found[t]):13.1f}" if found[t] else f"{'-':>13}" for t in tests)
        print(f"{kind:9}{count:3}{row}")
    print("\nWithin tolerance on the due date, in percent (share of histories with a due date; median age, years)")
    print(f"{'drift':9}{'n':>3}" + "".join(f"{f'{t:g} deg':>26}" for t in TOLERANCES_DEG))
    for name in ("both", *(b.value for b in Between)):
        print({"both": "the earlier of both"}.get(name, f"if taken to {name}"))
        for (kind, count), found in cells.items():
            print(f"{kind:9}{count:3}" + "".join(f"{_due(found, f'{name} {t:g}'):>26}" for t in TOLERANCES_DEG))


def _due(found, key):
    within = found[f"within {key}"]
    if not within:
        return "- (0 %)"
    dated, age = np.mean(found[f"dated {key}"]), np.median(found[f"age {key}"])
    return f"{100 * np.mean(within):.1f} ({100 * dated:.0f} %; {age:.2f})"


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 400)
