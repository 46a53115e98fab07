"""Pressure calibrations simulated by the thousand: how large is the reading error, and do intervals hold?

    .venv/bin/python benchmarks/pressure_campaign.py reading-error --seeds 50
    .venv/bin/python benchmarks/pressure_campaign.py coverage --calibrations 10000
    .venv/bin/python benchmarks/pressure_campaign.py few --calibrations 30000

Reading error is the largest |marginal residual| at a pressure over dV/dP and that pressure, in percent. Coverage counts
how often nominal 95 % intervals of a whole calibration, made by the functions a user calls, hold the truth. Few: how
far the degrees of freedom hold in a run as small as a simulated night of four whole plots and three pressures.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import numpy as np
from pressure_truth import GROWING, GROWING_AND_CUBIC, HOMOSCEDASTIC, coverage, simulate
from scipy.special import ndtri, stdtr

from fitter.split_plot import SplitPlotDesign
from procedures.pressure.fit import METHODS, fit_pressure

READING_ERROR = {
    "homoscedastic, variance ratio 10": HOMOSCEDASTIC,
    "sd 0.4 + 0.3 P, undeclared cubic": GROWING_AND_CUBIC,
}
COVERAGE = {
    "homoscedastic": (HOMOSCEDASTIC, ("GLS", "in-flight zero", "in-flight zero + WLS")),
    "sd 0.4 + 0.3 P": (GROWING, ("GLS", "in-flight zero", "in-flight zero + WLS")),
    "no whole-plot error (at the boundary)": (replace(HOMOSCEDASTIC, wholeplot_mV=0.0), ("GLS",)),
}


def show_reading_error(seeds: int, model: str, pressure_psia: float) -> None:
    print(f"reading error at {pressure_psia:g} psia in %, median [quartiles] of {seeds} seeds, model {model}")
    for truth, transducer in READING_ERROR.items():
        print(truth)
        found: dict[str, list[float]] = {method: [] for method in METHODS}
        for seed in range(seeds):
            data, _ = simulate(transducer, seed)
            for method, fit in fit_pressure(data, "bridge_mV", model).methods.items():
                at = int(np.argmin(np.abs(fit.reading_error.pressure_psia - pressure_psia)))
                found[method].append(fit.reading_error.max_pct[at])
        for method, values in found.items():
            low, middle, high = np.quantile(values, [0.25, 0.5, 0.75])
            print(f"  {method:22s} {middle:6.1f}  [{low:.1f}, {high:.1f}]")


def show_coverage(calibrations: int, first: int) -> None:
    begun, shown = time.monotonic(), time.monotonic()
    cells = [(truth, transducer, m) for truth, (transducer, methods) in COVERAGE.items() for m in methods]
    for done, (truth, transducer, method) in enumerate(cells):
        held: dict[str, int] = {}
        for i in range(calibrations):
            for interval, inside in coverage(transducer, method, first + i).items():
                held[interval] = held.get(interval, 0) + inside
            if time.monotonic() - shown > 10.0:
                shown = time.monotonic()
                part = (done + (i + 1) / calibrations) / len(cells)
                left = (shown - begun) * (1.0 / part - 1.0)
                print(f"  {100 * part:.0f} % done, about {left / 60:.1f} min left", file=sys.stderr, flush=True)
        print(f"{truth}, {method}: coverage of 95 % intervals in %, {calibrations} calibrations")
        for interval, count in held.items():
            print(f"  {interval:55s} {100 * count / calibrations:6.2f}", flush=True)


def show_few(calibrations: int, first: int) -> None:
    """Coefficients less the truth over their standard errors, made standard normal by their t distributions."""
    pressure, plot = np.tile([0.12, 1.0, 2.5], 4), np.repeat(np.arange(4), 3)
    x = np.column_stack([np.ones(12), pressure])
    design, truth = SplitPlotDesign(x, plot, ("1", "P")), np.array([1.0, 2.0])
    scores = []
    for i in range(calibrations):
        rng = np.random.default_rng(first + i)
        y = x @ truth + rng.normal(0.0, 0.0155, 4)[plot] + rng.normal(0.0, 0.0049, 12)
        fit = design.fit(y)
        scores.append(ndtri(stdtr(fit.df, (fit.coefficients - truth) / fit.stderr)))
    for name, z in zip(("offset", "sensitivity"), np.array(scores).T, strict=True):
        print(
            f"{name:12s} mean {z.mean():+.3f}, sd {z.std():.3f}, outside 95 % {100 * np.mean(np.abs(z) > 1.96):.2f} %"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("reading-error", "coverage", "few"))
    parser.add_argument("--seeds", type=int, default=50)
    parser.add_argument("--model", default="hierarchical")
    parser.add_argument("--pressure", type=float, default=0.12)
    parser.add_argument("--calibrations", type=int, default=10000, help="in each cell")
    parser.add_argument("--first", type=int, default=0, help="first seed")
    asked = parser.parse_args()
    if asked.what == "reading-error":
        show_reading_error(asked.seeds, asked.model, asked.pressure)
    elif asked.what == "few":
        show_few(asked.calibrations, asked.first)
    else:
        show_coverage(asked.calibrations, asked.first)


if __name__ == "__main__":
    main()
