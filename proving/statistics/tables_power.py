"""How small an effect the trace of tables still finds, and how good the model is that it ends with.

The laboratory is proving/truth/table.py. Sizes are rms beside the declared straight line, in units of the scatter. A
told test knows the effect's column, its constants included, and shares 5 % by the effects that the trace compares.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from proving.frame import Figures, Part, Results, Study, pooled
from proving.ledger import Result
from proving.statistics.told import free_of, powers
from proving.truth.table import MISSING, Missing, options, simulate
from rig.procedures.general.column_roles import Roles, roles_of
from rig.procedures.general.trace import search_table
from rig.procedures.general.trace.estimate import error_of, estimate
from rig.procedures.general.trace.run import problem_of
from rig.procedures.tables.table import Table

ALIKE = ((0.0, 1.0), (0.3, 1.0), (0.6, 1.0), (0.9, 1.0), (0.6, 0.4), (0.9, 0.7), (0.9, 0.4), (0.9, 0.15))
"""Correlation of neighbours of the part of the errors that wanders, and its share of their variance."""
HELD = {"independent errors": 1, "AR to 0.6": 3, "AR to 0.9": 4, "AR to 0.9 beside independent errors": len(ALIKE)}
"""How many of these a told test holds its level for."""


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


PARTS = {"error": Part(error, 40), "told": Part(told, 2)}
