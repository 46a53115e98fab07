"""Coverage of intervals of runs that stop once they are narrow enough, and replications beside an oracle's.

python -m proving.goals [--runs 5000] [--seed 1]

Each run is a straight line over five settings with normal errors, three replications at first and thirty at most, and a
goal of its own for the slope. The oracle knows the error's standard deviation.
"""

from __future__ import annotations

import argparse
import math
import sys
from dataclasses import dataclass

import numpy as np

from rig.fitter.arrays import FloatArray
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


def stopped(rng: np.random.Generator) -> Stopped:
    """Simulate one run."""
    sigma = math.exp(rng.uniform(-1.0, 1.0))
    design = np.column_stack([np.ones_like(X), X])
    needed = math.exp(rng.uniform(math.log(2.0), math.log(36.0)))
    goal = 1.96 * sigma / math.sqrt(needed * float(X @ X))
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
        half = factor * t_of(df) * s
        if half <= goal or n == MOST:
            off = abs(float(fitted[1]) - SLOPE)
            return Stopped(off <= half, off <= half / factor, n, oracle, half <= goal)
    raise AssertionError


def main() -> int:
    """As the command line says; 1 if the coverage is not 94 to 96 %."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=5000)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    rng = np.random.default_rng(asked.seed)
    told = [stopped(rng) for _ in range(asked.runs)]
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
