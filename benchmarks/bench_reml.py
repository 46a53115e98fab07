"""REML of split plots against statsmodels and, where Rscript has them, lme4 and nlme: time and accuracy in one run.

    OPENBLAS_NUM_THREADS=1 .venv/bin/python benchmarks/bench_reml.py [--responses 100]

The low-range paper's design: 20 whole plots of 11 readings, 10 coefficients. It is balanced, so the exact answer is the
analysis of variance: 14 degrees of freedom between whole plots, 196 within. Accuracy is the largest relative error
of any coefficient's standard error, on data with ten times the subplot variance between whole plots and with none.
"""

import argparse
import importlib.util
import json
import shutil
import subprocess
import tempfile
import warnings
from pathlib import Path
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


def exact(ys: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Standard errors (m, 10), by the analysis of variance; which responses have a whole-plot variance of zero."""
    x = columns()
    mean = np.stack([x[w == WHOLE_PLOT].mean(axis=0) for w in range(20)])
    ybar = np.stack([ys[w == WHOLE_PLOT].mean(axis=0) for w in range(20)])
    within = x - mean[WHOLE_PLOT]
    ss_below = np.sum((ys - ybar[WHOLE_PLOT] - within @ np.linalg.pinv(within) @ ys) ** 2, axis=0)
    ss_above = 11 * np.sum((ybar - mean @ np.linalg.pinv(mean, rcond=1e-10) @ ybar) ** 2, axis=0)
    zero = ss_above / 14 <= ss_below / 196
    below = np.where(zero, (ss_above + ss_below) / 210, ss_below / 196)
    above = np.where(zero, below, ss_above / 14)
    information = within.T @ within / below[:, None, None] + 11 * mean.T @ mean / above[:, None, None]
    return np.sqrt(np.diagonal(np.linalg.inv(information), axis1=1, axis2=2)), zero


def milliseconds(function, repeats: int) -> float:
    times = []
    for _ in range(repeats):
        start = perf_counter()
        function()
        times.append(perf_counter() - start)
    return 1e3 * median(times)


def in_statsmodels(ys: np.ndarray) -> dict[str, tuple[float, np.ndarray]]:
    if importlib.util.find_spec("statsmodels") is None:
        print("statsmodels is not installed")
        return {}
    from statsmodels.regression.mixed_linear_model import MixedLM

    x, times, stderr = columns(), [], []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for y in ys.T:
            start = perf_counter()
            fit = MixedLM(y, x, WHOLE_PLOT).fit(reml=True)
            times.append(perf_counter() - start)
            stderr.append(fit.bse_fe)
    return {"statsmodels MixedLM": (1e3 * median(times), np.array(stderr))}


def in_r(ys: np.ndarray) -> dict[str, tuple[float, np.ndarray]]:
    if shutil.which("Rscript") is None:
        return {}
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "data.csv"
        header = ["whole_plot", *NAMES[1:], *(f"y{i + 1}" for i in range(ys.shape[1]))]
        table = np.column_stack([WHOLE_PLOT, columns()[:, 1:], ys])
        np.savetxt(path, table, "%.17g", ",", header=",".join(header), comments="")
        done = subprocess.run(
            ["Rscript", str(Path(__file__).with_suffix(".R")), str(path)], capture_output=True, text=True, check=False
        )
    if done.returncode:
        print("R:", done.stderr.strip().splitlines()[-1])
        return {}
    answer = json.loads(done.stdout)
    print("R packages:", ", ".join(f"{name} {version}" for name, version in answer["versions"].items()))
    functions = {"lmer": "lme4::lmer", "refit": "lme4::refit", "lme": "nlme::lme"}
    return {
        label: (answer["ms"][name], np.array(answer["answers"][name], float)[:, 2:])
        for name, label in functions.items()
    }


def speed() -> float:
    ys = responses(4096, 10.0)
    y, x = ys[:, 0].copy(), columns()
    design = SplitPlotDesign(x, WHOLE_PLOT, NAMES)
    nested = SplitPlotDesign(np.vstack([x] * 3), np.arange(660) // 11, NAMES, replicate=np.arange(660) // 220)
    y3 = np.concatenate(ys.T[:3]) + np.repeat([0.1, -0.4, 0.2], 220)
    one = milliseconds(lambda: design.fit(y), 2000)
    rows = {
        "one fit of 220 points, design at hand": one,
        "  with Kenward-Roger errors and df": milliseconds(lambda: all_of(design.fit(y)), 500),
        "  with the design's set-up": milliseconds(lambda: SplitPlotDesign(x, WHOLE_PLOT, NAMES).fit(y), 200),
        "4096 fits at once, each": milliseconds(lambda: design.fit_many(ys), 15) / 4096,
        "660 points nested in 3 replications": milliseconds(lambda: nested.fit(y3), 50),
    }
    for what, ms in rows.items():
        print(f"{what:42}{ms:9.4f} ms")
    return one


def all_of(fit) -> None:
    fit.kenward_roger().stderr, fit.df


def accuracy(ratio: float, m: int, ours_ms: float) -> None:
    ys = responses(m, ratio)
    truth, zero = exact(ys)
    design = SplitPlotDesign(columns(), WHOLE_PLOT, NAMES)
    found = {
        "this, one by one": (ours_ms, np.array([design.fit(y).stderr for y in ys.T])),
        "this, all at once": (None, design.fit_many(ys).stderr),
        **in_statsmodels(ys),
        **in_r(ys),
    }
    print(f"\nvariance ratio {ratio:g}: {m} responses, {int(zero.sum())} of them with a whole-plot variance of zero")
    heading = "error of standard errors: median     90 %    worst   off by > 1 %   failed"
    print(f"{'':22}{'ms a fit':>10}{'ratio':>7} | {heading}")
    for name, (ms, stderr) in found.items():
        error = np.max(np.abs(stderr / truth - 1.0), axis=1)
        given = error[np.isfinite(error)]
        timing = f"{'':17}" if ms is None else f"{ms:10.3f}{ms / ours_ms:7.0f}"
        sizes = "".join(f"{each:9.1e}" for each in np.quantile(given, [0.5, 0.9, 1.0]))
        print(f"{name:22}{timing} |{'':24}{sizes}{np.mean(given > 0.01):15.0%}{len(error) - len(given):9}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--responses", type=int, default=100)
    given = parser.parse_args()
    ours = speed()
    for ratio in (10.0, 0.0):
        accuracy(ratio, given.responses, ours)


if __name__ == "__main__":
    main()
