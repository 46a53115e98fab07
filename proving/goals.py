"""Coverage of intervals of runs that stop once they are narrow enough, and replications beside an oracle's.

python -m proving.goals [--runs 5000] [--seed 1] [--type-b 1.0] [--shape normal|rectangular]

Each run is a straight line over five settings with normal errors, three replications at first and thirty at most, and a
goal of its own for the slope. With `--type-b` the reference has an error as well, of so many standard errors of a run
that just meets the goal; the goal is then an expanded uncertainty with it. The oracle knows the error's standard
deviation.
"""

from __future__ import annotations

import argparse
import math
import sys
from dataclasses import dataclass
from typing import Any

import numpy as np

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


def main() -> int:
    """As the command line says; 1 if the coverage is not 94 to 96 %."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=5000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--type-b", type=float, default=0.0, help="error of the reference, standard errors of a run")
    parser.add_argument("--shape", choices=("normal", "rectangular"), default="normal", help="of that error")
    asked = parser.parse_args()
    rng = np.random.default_rng(asked.seed)
    told = [stopped(rng, asked.type_b, asked.shape) for _ in range(asked.runs)]
    covered, by_t = (np.mean([getattr(one, name) for one in told]) for name in ("covered", "by_t"))
    met = [one for one in told if one.met]
    early = np.mean([one.covered for one in told if one.replications < one.oracle])
    ratio = np.mean([one.replications for one in met]) / np.mean([one.oracle for one in met])
    print(
        f"{asked.runs} runs of seed {asked.seed}: {covered:.4f} of the intervals hold, stated {LEVEL}; {by_t:.4f} by "
        f"Student's t alone; {early:.4f} of runs that stopped before the oracle; goal met in {len(met)}, with "
        f"{ratio:.3f} times the oracle's replications"
    )
    return 0 if 0.94 <= covered <= 0.96 else 1


if __name__ == "__main__":
    sys.exit(main())
