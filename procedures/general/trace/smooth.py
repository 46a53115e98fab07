"""A smooth curve without a name, for a remainder that no effect of the catalogue explains."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from rig.fitter import ties
from rig.fitter.arrays import FloatArray
from rig.fitter.json_values import JsonValue
from rig.fitter.linear import orthonormal
from rig.fitter.trace.engine.judge import TableJudge
from rig.fitter.trace.outcome import Finding

MOST_ORDERS, PER_ORDER, ROWS_PER_ORDER = 12, 3, 4
"""Maximum order of a curve, and minimum numbers of distinct values and rows per order."""
WAVES = 3
"""Order from which a curve is also described by its period."""
FOLDS, SEED = 10, 7


@dataclass(frozen=True, eq=False)
class Smooth(Finding):
    """The remainder, with the curve that may be added for it.

    Attributes:
        variable: its variable.
        order: half waves of the curve over the variable's range.
        period: of the curve's largest part, unit of the variable; None for fewer than `WAVES` half waves.
        sigma_E: standard error of one row with the effects, and also with the curve.
        left_out: rms error of randomly left-out rows, without the curve and with it.
    """

    variable: str = field(kw_only=True)
    order: int = field(kw_only=True)
    period: float | None = field(kw_only=True)
    sigma_E: tuple[float, float] = field(kw_only=True)
    left_out: tuple[float, float] = field(kw_only=True)

    @property
    def own_keys(self) -> dict[str, JsonValue]:
        """Keys of JSON for tables only."""
        return {
            "variable": self.variable,
            "order": self.order,
            "period": self.period,
            "smooth": {
                "term": f"s({self.variable}, {self.order})",
                "sigma_E_before": self.sigma_E[0],
                "sigma_E_after": self.sigma_E[1],
                "left_out_before": self.left_out[0],
                "left_out_after": self.left_out[1],
            },
        }


def curve(v: FloatArray) -> FloatArray:
    """(n, m) half waves over the range of a variable (n,), the slowest first; the order is the number of columns."""
    distinct = len(np.unique(v))
    most = min(MOST_ORDERS, distinct // PER_ORDER, len(v) // ROWS_PER_ORDER)
    if most < 1:
        return np.empty((len(v), 0))
    u = (v - v.min()) / np.ptp(v)
    return np.asarray(np.cos(np.pi * np.arange(1, most + 1) * u[:, None]))


def offered(
    judge: TableJudge,
    chosen: tuple[int, ...],
    variable: str,
    v: FloatArray,
    share: float,
    *,
    where: str,
    stratum: str = "unnamed",
) -> Smooth:
    """The curve over a variable (n,) of the order that Schwarz' criterion prefers, beside the effects found.

    Args:
        judge: of the table.
        chosen: effects in the model.
        variable: its name.
        v: (n,) its values.
        share: its share of the remainder.
        where: its place, in words.
        stratum: see `Smooth`.
    """
    problem, waves = judge.problem, curve(v)
    y, model = judge.held(chosen), problem.model(chosen)
    basis = orthonormal(model)
    extra = np.linalg.qr(waves - basis @ (basis.T @ waves))[0]
    left = y - basis @ (basis.T @ y)
    rss = np.sum(left**2) - np.concatenate([[0.0], np.cumsum((extra.T @ left) ** 2)])
    rss = np.maximum(rss, np.finfo(float).tiny)
    n = problem.n
    order = ties.lowest(n * np.log(rss) + np.log(n) * np.arange(len(rss)))
    order = max(order, 1)
    after = np.hstack([model, waves[:, :order]])
    largest = 1 + ties.highest(np.abs(np.linalg.lstsq(after, y, rcond=None)[0][-order:]), 0.0)
    sigma = tuple(_sigma(problem.y, m) for m in (model, after))
    return Smooth(
        kind="unnamed",
        share=share,
        variable=variable,
        order=order,
        period=2.0 * float(np.ptp(v)) / largest if largest >= WAVES else None,
        sigma_E=(sigma[0], sigma[1]),
        left_out=(_left_out(problem.y, model), _left_out(problem.y, after)),
        cause=where,
        stratum=stratum,
    )


def _sigma(y: FloatArray, model: FloatArray) -> float:
    basis = orthonormal(model)
    left = y - basis @ (basis.T @ y)
    return float(np.sqrt(left @ left / max(len(y) - basis.shape[1], 1)))


def _left_out(y: FloatArray, model: FloatArray) -> float:
    fold = np.random.default_rng(SEED).permutation(np.arange(len(y)) % FOLDS)
    length = np.maximum(np.linalg.norm(model, axis=0), np.finfo(float).tiny)
    errors = np.empty(len(y))
    for one in range(FOLDS):
        kept = fold != one
        solved = np.linalg.lstsq(model[kept] / length, y[kept], rcond=1e-10)[0]
        errors[~kept] = y[~kept] - (model[~kept] / length) @ solved
    return float(np.sqrt(np.mean(errors**2)))
