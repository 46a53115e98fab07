"""How small an effect the trace of tables still finds, and how good the model is that it ends with.

The laboratory is proving/truth/table.py. Sizes are rms beside the declared straight line, in units of the scatter. The
told test knows the effect's column, its constants included, and tests nothing else: F at 5 % with independent errors.
`told` shares the 5 % by the effects that the trace compares, and allows for correlated errors too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from scipy import optimize, special, stats

from proving.ledger import Result
from proving.statistics.frame import Figures, Part, Results, Study, pooled
from proving.statistics.tables import found_or_alike
from proving.statistics.told import free_of, powers
from proving.truth.table import MISSING, Missing, options, simulate
from rig.procedures.general.column_roles import Roles, roles_of
from rig.procedures.general.trace import search_table
from rig.procedures.general.trace.estimate import error_of, estimate
from rig.procedures.general.trace.run import problem_of
from rig.procedures.tables.table import Table

STEPS = (1.0, 1.3, 1.6, 2.0, 2.6, 3.4, 4.5)
"""Sizes tried, in units of that which the told test finds with 95 % power."""
RANK = {"wave": 2, "oscillation": 2, "group offset": 4, "group gain": 4}
ALIKE = ((0.0, 1.0), (0.3, 1.0), (0.6, 1.0), (0.9, 1.0), (0.6, 0.4), (0.9, 0.7), (0.9, 0.4), (0.9, 0.15))
"""Correlation of neighbours of the part of the errors that wanders, and its share of their variance."""
HELD = {"independent errors": 1, "AR to 0.6": 3, "AR to 0.9": 4, "AR to 0.9 beside independent errors": len(ALIKE)}
"""How many of these a told test holds its level for."""


def told_size(missing: Missing, rank: int) -> float:
    """Rms at which a single F test at 5 % on the true columns has 95 % power."""
    n, df = missing.lab.n, missing.lab.n - 2 - rank
    limit = float(special.fdtri(rank, df, 0.95))
    noncentrality = optimize.brentq(lambda c: stats.ncf.sf(limit, rank, df, c) - 0.95, 1.0, 200.0)
    return float(np.sqrt(noncentrality / n))


def size() -> Study:
    """Size found with 95 % power by name or as an alias, over that of a single told test."""
    return Study({name: partial(_sizes, name=name) for name in MISSING}, _power)


def _sizes(seed: int, name: str) -> Result:
    missing = MISSING[name]
    told = told_size(missing, RANK.get(name, 1))
    hits = []
    for step in STEPS:
        names = found_or_alike(simulate(missing.lab, seed, missing.at(step * told)), options(missing.lab))
        hits.append(any(one.startswith(missing.named) for key, a in names.items() for one in (key, *a)))
    return {"told": told, "hits": hits}


def _power(results: Results) -> Figures:
    """A probit line through the rates at a few sizes, up to where nearly all are found twice in succession."""
    every = np.mean([one["hits"] for one in results], axis=0).tolist()
    last = next((k for k in range(1, len(every)) if min(every[k - 1 : k + 1]) > 0.98), len(every) - 1)
    rates, steps = every[: last + 1], STEPS[: last + 1]
    ratio = _at_95(np.array(steps), np.array(rates), len(results))
    return {
        "told": results[0]["told"],
        "ratio": ratio,
        "found": {f"{step:g}": rate for step, rate in zip(steps, rates, strict=True)},
    }


def _at_95(step: Any, rate: Any, count: int) -> float:
    """Where a probit line, fitted by likelihood, is at 95 %."""
    hits = rate * count

    def minus_log(p: Any) -> float:
        z = np.exp(p[1]) * (step - p[0])
        return -float(np.sum(hits * special.log_ndtr(z) + (count - hits) * special.log_ndtr(-z)))

    best = optimize.minimize(minus_log, np.array([1.3, 0.5]), method="Nelder-Mead")
    return float(best.x[0] + 1.645 / np.exp(best.x[1]))


def error(rows: int = 0) -> Study:
    """Rms of fitted less true response, after over told, where the effect is 1 sd rms; and stated errors that rose.

    In tables of so many rows; 0 for those of each effect.
    """
    return Study({name: partial(_ratio, name=name, rows=rows) for name in MISSING}, _quantiles, pooled(_quantiles))


def _ratio(seed: int, name: str, rows: int) -> Result:
    missing = MISSING[name]
    missing = replace(missing, lab=replace(missing.lab, n=rows or missing.lab.n))
    columns = simulate(missing.lab, seed, missing.at(1.0))
    effect = columns["y"] - simulate(missing.lab, seed)["y"]
    data, _ = roles_of(Table("simulated", columns, True, {}), Roles(**options(missing.lab)))
    result = search_table(data)
    order = data.numbers - 2 if data.numbers is not None else np.arange(len(data.y))
    truth = (3.0 + 2.0 * columns["x"] + effect)[order]
    told = np.column_stack([data.columns, _column(missing, columns, effect)[order]])
    best = told @ np.linalg.lstsq(told, data.y, rcond=None)[0]
    judge, chosen = result.judge, result.chosen
    fitted = estimate(judge, chosen).fitted
    return {
        "ratio": float(np.sqrt(np.mean((fitted - truth) ** 2) / np.mean((best - truth) ** 2))),
        "rose": error_of(judge, chosen, chosen) > error_of(judge, (), chosen),
    }


def _quantiles(results: Results) -> Figures:
    ratios = [one["ratio"] for one in results]
    return {
        "median": float(np.median(ratios)),
        "95 %": float(np.quantile(ratios, 0.95)),
        "after above before": sum(one["rose"] for one in results),
        "of": len(results),
    }


def _column(missing: Missing, columns: Any, effect: Any) -> Any:
    """(n, r) what the told fit knows: the effect up to its size, or a column for each level of a grouping."""
    if missing.lab.groups and "unit" in columns and any(one.startswith("group") for one in missing.named):
        levels = (columns["unit"][:, None] == np.arange(1, missing.lab.groups)).astype(float)
        return levels * columns["x"][:, None] if missing.named[0].startswith("group-gain") else levels
    return effect[:, None]


def told(rows: int = 0) -> Study:
    """Power of a test told the true column, in tables of so many rows; 0 for those of each effect.

    It shares 5 % by the effects that the trace compares there, and by the shapes that a searched constant gives this
    one. It holds this level for independent errors alone, or also where neighbours correlate. The true errors are
    independent.
    """
    return Study({name: partial(_told, name=name, rows=rows) for name in MISSING}, _powers, pooled(_powers))


def _told(seed: int, name: str, rows: int) -> Result:
    missing = MISSING[name]
    missing = replace(missing, lab=replace(missing.lab, n=rows or missing.lab.n))
    clean, effect = simulate(missing.lab, seed), simulate(missing.lab, seed, missing.at(1.0))
    added = np.asarray(effect["y"] - clean["y"])
    data, _ = roles_of(Table("simulated", clean, True, {}), Roles(**options(missing.lab)))
    free = free_of(np.column_stack([np.ones_like(added), clean["x"]]))
    apart = np.abs(np.subtract.outer(*[np.arange(missing.lab.n)] * 2))
    roots = [np.linalg.cholesky(free @ _correlated(apart, *one) @ free.T) for one in ALIKE]
    sizes = {f"{rms:g} sd": free @ (rms * added) for rms in (0.25, 0.5)}
    candidates = problem_of(data).candidates
    blocks = [free @ one.term.columns for one in candidates if one.effect.name.startswith(missing.named)]
    tests = len({one.effect.name for one in candidates}) * _independent(blocks)
    columns, rng = free @ _column(missing, clean, added), np.random.default_rng([36, seed])
    return {"tests": tests, "power": powers(columns, sizes, roots, HELD, 0.05 / tests, rng, (10_000, 2000))}


def _independent(blocks: Sequence[Any]) -> float:
    """Number of independent shapes among some, each the space of its columns (m, r), by how far they overlap."""
    bases = [np.linalg.qr(block)[0] for block in blocks]
    alike = [np.sum((one.T @ other) ** 2) / one.shape[1] for one in bases for other in bases]
    return len(bases) ** 2 / float(np.sum(alike))


def _correlated(apart: Any, correlation: float, share: float) -> Any:
    return share * correlation**apart + (1.0 - share) * (apart == 0)


def _powers(results: Results) -> Figures:
    power = [one["power"] for one in results]
    means = {
        size: {held: float(np.mean([one[size][held] for one in power])) for held in of} for size, of in power[0].items()
    }
    return {"tests": float(np.mean([one["tests"] for one in results])), **means}


PARTS = {"size": Part(size, 40), "error": Part(error, 40), "told": Part(told, 2)}
