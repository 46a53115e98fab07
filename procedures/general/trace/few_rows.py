"""Names that one or two rows make: rows that are gross errors, and rows without which nothing of a name is left."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from rig.fitter import ties
from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.trace.chance import ALPHA
from rig.fitter.trace.doubts import rests_on
from rig.fitter.trace.engine.judge import MANY
from rig.fitter.trace.engine.problem import Problem
from rig.fitter.trace.search import names_of
from rig.procedures.general.gross import of_table
from rig.procedures.general.trace.run import Found, TableData, problem_of, search_table
from rig.procedures.general.trace.unmodelled import UnmodelledSmooth

MOST = 2
"""Rows that are left out to see whether a name rests on them."""
HANDFUL, SHARE, LEVER = 10, 0.15, 2.5
"""The same, and share of all rows, of rows with so many times the leverage of the average one: far from all others they
are one piece of evidence, however many they are.
"""
NOTHING = 0.05
"""Probability by chance of an effect when they are left out, above which its name rests on them."""
FIXED = 1e-9
"""Share of a row's variance in its residual below which the model passes through it."""


@dataclass(frozen=True, eq=False)
class Searched:
    """A table searched with its gross errors apart.

    Attributes:
        found: the result.
        data: the table, with a column of its own for each row that is apart.
        problem: of this table.
        apart: (m,) rows that are gross errors beside the declared model, farthest first; in a table of no more than
            a thousand rows also several that perhaps are, each hiding the others.
        distance_sd: (m,) their distances.
        off: (m,) the same in units of the response.
        p: probability that a clean table has such a row.
        dropped: effects that only these rows showed; empty where the rows are in the search as they are.
    """

    found: Found
    data: TableData
    problem: Problem
    apart: IntArray
    distance_sd: FloatArray
    off: FloatArray
    p: float
    dropped: tuple[str, ...] = ()


def searched(data: TableData) -> Searched:
    """Search a table; an effect that gross errors make, and nothing else shows, is not named.

    An effect with no more constants than there are such rows explains them whatever they are; one that explains more
    rows than it has constants is no gross error.
    """
    problem = problem_of(data)
    found = search_table(data, problem)
    gross = told = of_table(data.y, data.columns, data.shared)
    if not gross.rows.size and len(data.y) < MANY:
        perhaps = of_table(data.y, data.columns, data.shared, level=ALPHA)
        # By chance one is there in 40 of 1,500 clean tables, and more than one in 2.
        told = perhaps if perhaps.rows.size > 1 else gross
    plain = Searched(found, data, problem, told.rows, told.distance_sd, told.off, told.p)
    names = names_of(found.judge.candidates, found.chosen)
    constants = {
        name: sum(c.term.price for c in (found.judge.candidates[j] for j in found.chosen) if c.effect.name == name)
        for name in names
    }
    if (
        not gross.rows.size
        or not any(gross.rows.size <= count for count in constants.values())
        or _repeated(data, gross.rows)
    ):
        return plain
    own = np.zeros((len(data.y), gross.rows.size))
    own[gross.rows, np.arange(gross.rows.size)] = 1.0
    apart = replace(data, columns=np.hstack([data.columns, own]), tails=np.hstack([data.tails, 0.0 * own]))
    beside = problem_of(apart)
    again = search_table(apart, beside)
    left = names_of(again.judge.candidates, again.chosen)
    dropped = tuple(name for name in names if name not in left and gross.rows.size <= constants[name])
    if not dropped or len(left) >= len(names):
        return plain
    return replace(plain, found=again, data=apart, problem=beside, dropped=dropped)


def _repeated(data: TableData, rows: IntArray) -> bool:
    """Whether two of these rows repeat one setting: then they confirm each other."""
    return data.points is not None and len(np.unique(data.points[rows])) < rows.size


def resting(unmodelled: UnmodelledSmooth) -> dict[str, str]:
    """Sentences about names of which nothing is left without one or two rows, or a handful far off, by name."""
    judge, chosen = unmodelled.judge, unmodelled.chosen
    out = {}
    for name in names_of(judge.candidates, chosen):
        rest = tuple(j for j in chosen if judge.candidates[j].effect.name != name)
        rows = _rows_of(unmodelled, rest)
        if rows:
            out[name] = rests_on([unmodelled.data.rows[i] for i in rows])
    return out


def _rows_of(unmodelled: UnmodelledSmooth, rest: tuple[int, ...]) -> list[int]:
    """Rows on which the effects beside the `rest` rest, in order; empty where there are none.

    The row whose deletion leaves least evidence is left out first. The fall of a sum of squares by a deletion is known
    from residual and leverage (Cook and Weisberg, Residuals and Influence in Regression, 1982, section 2.2).
    """
    judge, chosen = unmodelled.judge, unmodelled.chosen
    view, white = judge.view(0), judge.white(0, chosen)
    small, large = view.taken(rest), view.taken(chosen)
    rank = large.shape[1] - small.shape[1]
    leverage = np.sum(large**2, axis=1)
    out: list[int] = []
    for _ in range(max(MOST, min(HANDFUL, int(SHARE * len(white))))):
        before, after = _without(white, small), _without(white, large)
        df = len(white) - large.shape[1] - 1
        if rank < 1 or df < 1:
            return []
        error = np.maximum(after, view.rounding) / df
        ratio = np.maximum(before - after, 0.0) / rank / np.maximum(error, np.finfo(float).tiny)
        ratio[out] = np.inf
        worst = ties.lowest(ratio)
        out.append(worst)
        if special.fdtrc(rank, df, ratio[worst]) > NOTHING:
            return sorted(out) if len(out) <= MOST or leverage[out].mean() > LEVER * leverage.mean() else []
        small, large = _beside(small, worst), _beside(large, worst)
        rank = large.shape[1] - small.shape[1]
    return []


def _without(white: FloatArray, basis: FloatArray) -> FloatArray:
    """(n,) sums of squares of residuals with each row in turn left out."""
    left = white - basis @ (basis.T @ white)
    kept = 1.0 - np.sum(basis**2, axis=1)
    fall = np.divide(left**2, kept, out=np.zeros_like(left), where=kept > FIXED)
    return np.asarray(float(left @ left) - fall)


def _beside(basis: FloatArray, row: int) -> FloatArray:
    """The basis with a column for one row."""
    own = -basis @ basis[row]
    own[row] += 1.0
    own -= basis @ (basis.T @ own)
    size = float(np.linalg.norm(own))
    return basis if size**2 <= FIXED else np.column_stack([basis, own / size])
