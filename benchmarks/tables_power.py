"""How small an effect the trace of tables still finds, and how good the model is that it ends with.

    python -m benchmarks.tables_power size --seeds 40     size found with 95 % power, over that of a single told test
    python -m benchmarks.tables_power error --seeds 40    noise-free error after, over that of a fit told the truth

The laboratory is proving/truth/table.py. Sizes are rms beside the declared straight line, in units of the scatter. The
told test knows the effect's column, its constants included, and tests nothing else: F at 5 % with independent errors.
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np
from scipy import optimize, special, stats

from benchmarks.tables_campaign import found_or_alike, roles_of
from procedures.general.column_roles import Roles
from procedures.general.trace import search_table
from procedures.general.trace.estimate import estimate
from procedures.table import Table

from proving.truth.table import MISSING, Missing, options, simulate  # isort: skip

STEPS = (1.0, 1.3, 1.6, 2.0, 2.6, 3.4, 4.5)
"""Sizes tried, in units of that which the told test finds with 95 % power."""
RANK = {"wave": 2, "oscillation": 2, "group offset": 4, "group gain": 4}


def told_size(missing: Missing, rank: int) -> float:
    """Rms at which a single F test at 5 % on the true columns has 95 % power."""
    n, df = missing.lab.n, missing.lab.n - 2 - rank
    limit = float(special.fdtri(rank, df, 0.95))
    noncentrality = optimize.brentq(lambda c: stats.ncf.sf(limit, rank, df, c) - 0.95, 1.0, 200.0)
    return float(np.sqrt(noncentrality / n))


def size(seeds: range, only: str) -> None:
    """Size found with 95 % power by name or as an alias, by a probit line through the rates at a few sizes."""
    for name, missing in MISSING.items():
        if only not in name:
            continue
        told = told_size(missing, RANK.get(name, 1))
        tried: list[float] = []
        rates: list[float] = []
        for step in STEPS:
            hits = 0
            for seed in seeds:
                names = found_or_alike(simulate(missing.lab, seed, missing.at(step * told)), options(missing.lab))
                hits += any(one.startswith(missing.named) for key, a in names.items() for one in (key, *a))
            tried.append(step)
            rates.append(hits / len(seeds))
            if len(rates) > 1 and min(rates[-2:]) > 0.98:
                break
        ratio = _at_95(np.array(tried), np.array(rates), len(seeds))
        listed = ", ".join(f"{s:g}: {r:.0%}" for s, r in zip(tried, rates, strict=True))
        print(f"{name:14s} n {missing.lab.n:4d}  told {told:.2f} sd  ratio {ratio:.2f}   {listed}", flush=True)


def _at_95(step: Any, rate: Any, count: int) -> float:
    """Where a probit line, fitted by likelihood, is at 95 %."""
    hits = rate * count

    def minus_log(p: Any) -> float:
        z = np.exp(p[1]) * (step - p[0])
        return -float(np.sum(hits * special.log_ndtr(z) + (count - hits) * special.log_ndtr(-z)))

    best = optimize.minimize(minus_log, np.array([1.3, 0.5]), method="Nelder-Mead")
    return float(best.x[0] + 1.645 / np.exp(best.x[1]))


def error(seeds: range, only: str) -> None:
    """Rms of fitted less true response, after over told, where the effect is 1 sd rms: median and 95th percentile."""
    every: list[float] = []
    for name, missing in MISSING.items():
        if only not in name:
            continue
        ratios = []
        for seed in seeds:
            columns = simulate(missing.lab, seed, missing.at(1.0))
            effect = columns["y"] - simulate(missing.lab, seed)["y"]
            data, _ = roles_of(Table("simulated", columns, True, {}), Roles(**options(missing.lab)))
            result = search_table(data)
            order = data.numbers - 2 if data.numbers is not None else np.arange(len(data.y))
            truth = (3.0 + 2.0 * columns["x"] + effect)[order]
            told = np.column_stack([data.columns, _column(missing, columns, effect)[order]])
            best = told @ np.linalg.lstsq(told, data.y, rcond=None)[0]
            fitted = estimate(result.judge, result.chosen).fitted
            ratios.append(float(np.sqrt(np.mean((fitted - truth) ** 2) / np.mean((best - truth) ** 2))))
        every += ratios
        print(f"{name:14s} median {np.median(ratios):.2f}, 95 % {np.quantile(ratios, 0.95):.2f}", flush=True)
    print(f"{'all':14s} median {np.median(every):.2f}, 95 % {np.quantile(every, 0.95):.2f}")


def _column(missing: Missing, columns: Any, effect: Any) -> Any:
    """(n, r) what the told fit knows: the effect up to its size, or a column for each level of a grouping."""
    if missing.lab.groups and "unit" in columns and any(one.startswith("group") for one in missing.named):
        levels = (columns["unit"][:, None] == np.arange(1, missing.lab.groups)).astype(float)
        return levels * columns["x"][:, None] if missing.named[0].startswith("group-gain") else levels
    return effect[:, None]


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("what", choices=["size", "error"])
    parser.add_argument("--seeds", type=int, default=40)
    parser.add_argument("--only", default="")
    given = parser.parse_args()
    {"size": size, "error": error}[given.what](range(given.seeds), given.only)


if __name__ == "__main__":
    main()
