"""REML of split plots: time of one fit, of many at once, and of nested ones.

    OPENBLAS_NUM_THREADS=1 .venv/bin/python -m benchmarks.bench_reml

The low-range paper's design: 20 whole plots of 11 readings, 10 coefficients.
"""

from statistics import median
from time import perf_counter

import numpy as np

from proving.truth.split_plot import NAMES, WHOLE_PLOT, columns
from rig.fitter.split_plot import SplitPlotDesign


def responses(m: int, ratio: float) -> np.ndarray:
    rng = np.random.default_rng(1)
    mean = columns() @ np.array([1.5, 2.0, 0.2, -0.1, 0.01, 0, 0, 0, 0.03, 0])
    between = np.sqrt(ratio) * rng.normal(size=(20, m))[WHOLE_PLOT]
    return mean[:, None] + 0.1 * (between + rng.normal(size=(220, m)))


def milliseconds(function, repeats: int) -> float:
    times = []
    for _ in range(repeats):
        start = perf_counter()
        function()
        times.append(perf_counter() - start)
    return 1e3 * median(times)


def main() -> None:
    ys = responses(4096, 10.0)
    y, x = ys[:, 0].copy(), columns()
    design = SplitPlotDesign(x, WHOLE_PLOT, NAMES)
    nested = SplitPlotDesign(np.vstack([x] * 3), np.arange(660) // 11, NAMES, replicate=np.arange(660) // 220)
    y3 = np.concatenate(ys.T[:3]) + np.repeat([0.1, -0.4, 0.2], 220)
    rows = {
        "one fit of 220 points, design at hand": milliseconds(lambda: design.fit(y), 2000),
        "  with Kenward-Roger errors and df": milliseconds(lambda: all_of(design.fit(y)), 500),
        "  with the design's set-up": milliseconds(lambda: SplitPlotDesign(x, WHOLE_PLOT, NAMES).fit(y), 200),
        "4096 fits at once, each": milliseconds(lambda: design.fit_many(ys), 15) / 4096,
        "660 points nested in 3 replications": milliseconds(lambda: nested.fit(y3), 50),
    }
    for what, ms in rows.items():
        print(f"{what:42}{ms:9.4f} ms")


def all_of(fit) -> None:
    fit.kenward_roger().stderr, fit.df


if __name__ == "__main__":
    main()
