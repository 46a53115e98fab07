"""Uncertainty budgets: against GTC, against simulation, and how often their expanded uncertainty holds.

A seed is a laboratory (proving/truth/budgets.py): its sources of error, what is known of them, three results.
"""

from __future__ import annotations

from functools import partial
from typing import Any, Literal, cast

import numpy as np
from GTC import core, reporting

from proving.frame import Figures, Part, Results, Study
from proving.ledger import Result
from proving.truth.budgets import SHAPES, Laboratory, laboratory
from rig.fitter.arrays import FloatArray
from rig.fitter.budget import EXCESS, Budgeted, Correlation, Influence, TypeA, budgets, check, combine, monte_carlo
from rig.fitter.budget.coverage import NORMAL_FROM

_COMPLEX_STEP = 1e-30
_MEASUREMENTS = 2000


def stated(lab: Laboratory) -> tuple[list[TypeA], list[Influence], list[Correlation]]:
    """What a laboratory that knows its sources states of them."""
    fits = [] if lab.scatter is None else [TypeA(lab.covariance, lab.scatter_df)]
    shape = cast("list[Literal['normal', 'rectangular', 'triangular', 'arcsine']]", list(lab.shape))
    influences = [
        Influence(f"source {i}", "simulated", "B", lab.sd[i], float(lab.df[i]), shape[i]) for i in range(len(lab.df))
    ]
    pair = [] if lab.pair is None else [Correlation(f"source {lab.pair[0]}", f"source {lab.pair[1]}", lab.r)]
    return fits, influences, pair


def engine() -> Study:
    """Largest relative differences of u, df, k and U: of `combine`, and of perturbed evaluations, from GTC's."""
    return Study({"rows in numpy": _rows, "calibration line": _line}, _largest)


def _rows(seed: int) -> Result:
    lab = laboratory(np.random.default_rng([21, seed]))
    fits, influences, pair = stated(lab)
    told = budgets(["a", "b", "c"], ["V"] * 3, np.zeros(3), fits, influences, correlations=pair)
    r = np.eye(len(influences))
    if lab.pair is not None:
        r[lab.pair] = r[lab.pair[::-1]] = lab.r
    fast = combine(lab.sd.T, lab.df, [(np.diag(one.covariance), one.df) for one in fits], correlation=r)
    pairs = zip(told, fast.standard_uncertainty, fast.df, fast.coverage_factor, fast.expanded_uncertainty, strict=True)
    return {"difference": max(_difference(one, list(numbers)) for one, *numbers in pairs)}


def _line(seed: int) -> Result:
    """A straight line through readings of an erring meter over an erring standard; a value inferred with it.

    GTC carries uncertain numbers through sums and quotients; ours evaluates in numpy with each input displaced.
    """
    rng = np.random.default_rng([22, seed])
    x, true = np.linspace(1.0, 10.0, 8), rng.normal(size=2) + np.array([0.0, 4.0])
    y, in_use = true[0] + true[1] * x + rng.normal(0.0, 0.01, 8), true[0] + true[1] * 5.5
    names = ("gain of standard", "zero of standard", "gain of meter", "zero of meter", "zero of meter in use")
    sizes, dfs = 10.0 ** rng.uniform(-4, -2, 5), [float(rng.choice([np.inf, rng.uniform(3.0, 50.0)])) for _ in names]

    def fitted(errors: Any) -> list[Any]:
        xs = [one * (1.0 + errors[0]) + errors[1] for one in x.tolist()]
        ys = [one * (1.0 + errors[2]) + errors[3] for one in y.tolist()]
        middle, height = sum(xs) / 8.0, sum(ys) / 8.0
        across = sum((a - middle) * (b - height) for a, b in zip(xs, ys, strict=True))
        slope = across / sum((a - middle) * (a - middle) for a in xs)
        used = float(in_use) * (1.0 + errors[2]) + errors[4]
        return [slope, height - slope * middle, (used - height) / slope + middle]

    steps = np.eye(5) * 1j * _COMPLEX_STEP * sizes
    influences = [
        Influence(name, "simulated", "B", np.imag(fitted(step)) / _COMPLEX_STEP, df)
        for name, step, df in zip(names, steps, dfs, strict=True)
    ]
    values = np.array(fitted(np.zeros(5)))
    told = budgets(["slope", "zero", "inferred"], ["1"] * 3, values, (), influences)
    uncertain = [core.ureal(0.0, size, df) for size, df in zip(sizes.tolist(), dfs, strict=True)]
    return {"difference": max(_difference(a, _by_gtc(b)) for a, b in zip(told, fitted(uncertain), strict=True))}


def _by_gtc(result: Any) -> list[float]:
    u, df = core.uncertainty(result), core.dof(result)
    k = reporting.k_factor(df, 95)
    return [u, df, k, k * u]


def _difference(one: Budgeted, other: list[float]) -> float:
    ours = [one.standard_uncertainty, one.df, one.coverage_factor, one.expanded_uncertainty]
    # Degrees of freedom that are infinite but for rounding errors are the same.
    pairs = [
        (min(a, NORMAL_FROM), min(b, NORMAL_FROM)) if at == 1 else (a, b)
        for at, (a, b) in enumerate(zip(ours, other, strict=True))
    ]
    return max(abs(a / b - 1.0) for a, b in pairs)


def _largest(results: Results) -> Figures:
    return {"largest difference": max(one["difference"] for one in results), "of": len(results)}


def simulated(trials: int = 200_000) -> Study:
    """Budgets beside simulations of the same inputs: all normal and well known, or of any shape and df.

    Each result is judged with one significant digit, and with two (JCGM 101, 8.1).
    """
    return Study({case: partial(_simulated, case=case, trials=trials) for case in ("normal", "any")}, _agreement)


def _simulated(seed: int, case: str, trials: int) -> Result:
    lab = laboratory(np.random.default_rng([23, seed]), ("normal",) if case == "normal" else SHAPES)
    fits, influences, pair = stated(lab)
    if case == "normal":
        fits = [TypeA(one.covariance, np.inf) for one in fits]
        influences = [Influence(one.name, one.source, one.kind, one.sensitivities) for one in influences]
    told = budgets(["a", "b", "c"], ["V"] * 3, np.zeros(3), fits, influences, correlations=pair)
    found = [one.simulated for one in monte_carlo(told, fits, influences, seed=seed, correlations=pair, count=trials)]
    pairs = list(zip(told, found, strict=True))
    wider = [2.0 * one.expanded_uncertainty / (at.symmetric.upper - at.symmetric.lower) for one, at in pairs]
    return {**{str(digits): [check(*one, digits).agrees for one in pairs] for digits in (1, 2)}, "wider": wider}


def _agreement(results: Results) -> Figures:
    out: Figures = {}
    for digits in ("1", "2"):
        every = [one for result in results for one in result[digits]]
        out[f"{digits} digits"] = {str(word): every.count(word) for word in (True, False, None)}
    wider = [one for result in results for one in result["wider"]]
    return {**out, "budget's interval over simulated": [min(wider), float(np.median(wider)), max(wider)]}


def coverage() -> Study:
    """Share of measurements whose expanded uncertainty for 95 % holds, in percent; 2,000 in each laboratory.

    With coverage factors of Student's t, and by the shapes of the distributions.
    A laboratory knows its standard deviations with their degrees of freedom, and computes its budget from those.
    """
    return Study({case: partial(_covered, case=case) for case in ("normal", "any")}, _covering)


def _covered(seed: int, case: str) -> Result:
    rng = np.random.default_rng([24, seed])
    lab = laboratory(rng, ("normal",) if case == "normal" else SHAPES, results=1)
    errors = lab.errors(rng, _MEASUREMENTS)[:, 0]
    factors, scatter = lab.seen(rng, _MEASUREMENTS)
    r = np.eye(len(lab.df))
    if lab.pair is not None:
        r[lab.pair] = r[lab.pair[::-1]] = lab.r
    repeated: list[tuple[FloatArray, float]] = []
    if lab.scatter is not None:
        repeated = [(float(lab.covariance[0, 0]) * np.square(scatter), lab.scatter_df)]
    rows, excess = factors * lab.sd[:, 0], np.array([EXCESS[shape] for shape in lab.shape])
    by_t = combine(rows, lab.df, repeated, correlation=r)
    by_shape = combine(rows, lab.df, repeated, correlation=r, excess=excess)
    every = {"held": by_t, "by shape": by_shape}
    return {name: int(np.sum(np.abs(errors) <= one.expanded_uncertainty)) for name, one in every.items()}


def _covering(results: Results) -> Figures:
    out: Figures = {}
    for name, words in (("held", "Student's t"), ("by shape", "by shape")):
        shares = [100.0 * one[name] / _MEASUREMENTS for one in results]
        out[words] = {"mean": float(np.mean(shares)), "least": min(shares), "greatest": max(shares)}
    return {**out, "laboratories": len(results)}


PARTS = {"engine": Part(engine, 200), "simulated": Part(simulated, 200), "coverage": Part(coverage, 500)}
"""`python -m proving budgets engine`; docs/explanation/uncertainty.md."""
