"""Coverage of intervals of runs that stop once they are narrow enough, and replications beside an oracle's.

python -m proving goals [--seeds 5] [--type_b 1.0] [--shape normal|rectangular]

Each run is a straight line over five settings with normal errors, three replications at first and thirty at most, and a
goal of its own for the slope. With `--type_b` the reference has an error as well, of so many standard errors of a run
that just meets the goal; the goal is then an expanded uncertainty with it. The oracle knows the error's standard
deviation.
"""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass
from functools import partial
from typing import Any

import numpy as np

from proving.frame import Figures, Part, Results, Study
from proving.ledger import Result
from rig.fitter.arrays import FloatArray
from rig.fitter.budget import Influence, TypeA, budgets
from rig.fitter.sequential import LEVEL, t_of, widening

X = np.linspace(-1.0, 1.0, 5)
FIRST, MOST, SLOPE = 3, 30, 0.7


@dataclass(frozen=True)
class Stopped:
    """A run that has stopped: whether its interval has the true slope, by Student's t alone too, and replications."""

    covered: bool
    by_t: bool
    replications: int
    oracle: int
    met: bool


def stopped(rng: np.random.Generator, type_b: float = 0.0, shape: Any = "normal") -> Stopped:
    """Simulate one run; the reference's error is `type_b` standard errors of a run that just meets the goal."""
    sigma = math.exp(rng.uniform(-1.0, 1.0))
    design = np.column_stack([np.ones_like(X), X])
    needed = math.exp(rng.uniform(math.log(2.0), math.log(36.0)))
    u_b = type_b * sigma / math.sqrt(needed * float(X @ X))
    wrong = u_b * (rng.standard_normal() if shape == "normal" else math.sqrt(3.0) * rng.uniform(-1.0, 1.0))
    goal = 1.96 * math.hypot(sigma / math.sqrt(needed * float(X @ X)), u_b)
    oracle = min(max(math.ceil(needed), FIRST), MOST)
    rows: list[FloatArray] = []
    df_first, more = FIRST * len(X) - 2, len(X)
    factor = widening(float(df_first), float(more), MOST - FIRST + 1, FIRST)
    for n in range(1, MOST + 1):
        rows.append(SLOPE * X + sigma * rng.standard_normal(len(X)))
        if n < FIRST:
            continue
        y, every = np.concatenate(rows), np.tile(design, (n, 1))
        fitted, _, _, _ = np.linalg.lstsq(every, y, rcond=None)
        df = len(y) - 2
        s = math.sqrt(float(np.sum((y - every @ fitted) ** 2)) / df / (n * float(X @ X)))
        half = _expanded(factor * s, df, u_b, shape)
        if half <= goal or n == MOST:
            off = abs(float(fitted[1]) + wrong - SLOPE)
            return Stopped(off <= half, off <= _expanded(s, df, u_b, shape), n, oracle, half <= goal)
    raise AssertionError


def _expanded(s: float, df: float, u_b: float, shape: Any) -> float:
    """Expanded uncertainty of the slope, 95 %."""
    if u_b == 0.0:
        return t_of(df) * s
    by = Influence("reference", "", "B", np.array([u_b]), distribution=shape)
    slope = TypeA(np.array([[s * s]]), df)
    told = budgets(["slope"], [""], np.zeros(1), slope, [by], shapes="where limits dominate", forecast=True)
    return told[0].expanded_uncertainty


def goals(runs: int = 1000, type_b: float = 0.0, shape: str = "normal") -> Study:
    """Coverage of intervals, to be 94 to 96 %; `--type_b` in standard errors of a run, `--shape` normal or rectangular.

    A seed is a stream of runs.
    """
    case = partial(_stream, runs=runs, type_b=type_b, shape=shape)
    return Study({"runs": case}, _figures, fails=lambda rows: not 0.94 <= rows["runs"]["intervals that hold"] <= 0.96)


def _stream(seed: int, runs: int, type_b: float, shape: str) -> Result:
    rng = np.random.default_rng(seed)
    return {"runs": [astuple(stopped(rng, type_b, shape)) for _ in range(runs)]}


def _figures(results: Results) -> Figures:
    told = [Stopped(*one) for result in results for one in result["runs"]]
    met = [one for one in told if one.met]
    early = [one.covered for one in told if one.replications < one.oracle]
    ratio = np.mean([one.replications for one in met]) / np.mean([one.oracle for one in met])
    return {
        "intervals that hold": float(np.mean([one.covered for one in told])),
        "stated": LEVEL,
        "by Student's t alone": float(np.mean([one.by_t for one in told])),
        "of runs that stopped before the oracle": float(np.mean(early)),
        "goal met": len(met),
        "replications over the oracle's": float(ratio),
        "of": len(told),
    }


PARTS = {"": Part(goals, 5, 1)}
