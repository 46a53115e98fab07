"""Which planted gross errors are named, and which good rows in their place: proving/notes/gross.md.

Beside it an oracle: a test at the same limit that is told which rows are bad, fits the true model to the others, and
judges each bad row alone. What the oracle misses nobody can find at that limit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy import special

from proving.frame import Figures, Part, Results, Study
from proving.ledger import Result
from proving.truth import attitude, whole_plot
from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.formula import Formula
from rig.fitter.gross import LEVEL, GrossErrors
from rig.fitter.gross.rows import Rows
from rig.fitter.nonlinear import Distance
from rig.fitter.own_span import NO_GROUP
from rig.procedures.attitude.gross import of_attitude
from rig.procedures.general.gross import of_table
from rig.procedures.general.rows import CurveRows
from rig.procedures.pressure.fit import named_formula
from rig.procedures.pressure.fit.models import of_whole_plot
from rig.procedures.pressure.gross import of_whole_plots

SIZES = (5.0, 7.0, 20.0, 100.0, 1e4, 1e6, 1e9)
"""In standard deviations of a reading; each bad row is one to one and a half times as far off."""
SHARES = (0.01, 0.05, 0.1, 0.2)
SD, SIGMA_DEG = 1e-3, 1e-3
FULL = named_formula("full", ())

Bad = Callable[[np.random.Generator, FloatArray, float], IntArray]
"""Rows that are bad: of (n,) abscissae, in ascending order or not, and their share."""


@dataclass(frozen=True, eq=False)
class Planted:
    """A table with gross errors.

    Attributes:
        bad: (m,) rows that are bad.
        found: what the search says.
        rows: rows of the true model.
        responses: of the table.
    """

    bad: IntArray
    found: GrossErrors
    rows: Rows
    responses: int = 1

    def missed_by_oracle(self) -> int:
        """Number of bad rows within the limit of a test that is told which rows are bad."""
        block, rows, left = self.rows.block(self.bad), self.rows, self.rows.df - self.bad.size
        good = rows.some(np.setdiff1d(np.arange(len(rows.y)), self.bad))
        inverse = np.linalg.inv(block)
        off = inverse @ rows.residual[self.bad]
        distance = off / (np.linalg.norm(good.residual) / np.sqrt(left) * np.sqrt(np.diag(inverse)))
        tail = 2.0 * special.stdtr(left, -np.abs(distance)) * (len(rows.y) - self.bad.size + 1) * self.responses
        return int(np.sum(tail >= LEVEL))


def _anywhere(rng: np.random.Generator, x: FloatArray, share: float) -> IntArray:
    return np.asarray(rng.choice(len(x), max(1, round(share * len(x))), replace=False), np.int64)


def _neighbours(rng: np.random.Generator, x: FloatArray, share: float) -> IntArray:
    count = max(2, round(share * len(x)))
    first = int(rng.integers(len(x) - count + 1))
    return np.asarray(np.argsort(x, kind="stable")[first : first + count])


def _last(rng: np.random.Generator, x: FloatArray, share: float) -> IntArray:
    bad = _anywhere(rng, x[:-1], share)
    bad[0] = len(x) - 1
    return bad


def _off(rng: np.random.Generator, count: int, size: float, *, one_side: bool = False) -> FloatArray:
    sign = 1.0 if one_side else rng.choice([-1.0, 1.0], count)
    return np.asarray(size * sign * rng.uniform(1.0, 1.5, count))


def table(
    x_of: Callable[[np.random.Generator], FloatArray],
    bad_rows: Bad = _anywhere,
    *,
    degree: int = 1,
    one_side: bool = False,
    same_value: bool = False,
    weighted: bool = False,
    u_x: float = 0.0,
) -> Callable[[np.random.Generator, float, float], Planted]:
    """A polynomial through rows of standard deviation `SD`, or of stated ones, or with errors in the abscissa."""

    def made(rng: np.random.Generator, size: float, share: float) -> Planted:
        x = x_of(rng)
        n = len(x)
        sd = SD * (np.exp(rng.uniform(-2.0, 2.0, n)) if weighted else np.ones(n))
        columns = x[:, None] ** np.arange(degree + 1)
        y = columns.sum(axis=1) + rng.normal(0.0, sd)
        bad = bad_rows(rng, x, share)
        whole = np.hypot(sd, u_x)  # of a response less the line, whose slope is one
        off = whole[bad] * _off(rng, bad.size, size, one_side=one_side)
        y[bad] = y[bad].max() + size * SD if same_value else y[bad] + off
        scale = SD / whole
        truth = Rows(columns * scale[:, None], y * scale, np.ones(n), np.full(n, NO_GROUP, np.int64))
        if u_x:
            curve, measured = Formula.parse("1 + x"), x + rng.normal(0.0, u_x, n)
            problem = Distance(curve, {"x": measured}, "x", y, np.full(n, u_x), sd)
            return Planted(bad, CurveRows(problem, np.array([0.5, 1.1]), None, None).gross(), _at(truth, measured))
        if weighted:
            return Planted(bad, of_table(truth.y, truth.columns, measured=y, scale=scale), truth)
        return Planted(bad, of_table(y, columns), truth)

    return made


def _at(rows: Rows, x: FloatArray) -> Rows:
    scale = rows.columns[:, 0]
    return replace(rows, columns=np.column_stack([scale, scale * x]))


def nights(plan: attitude.Plan, **bench: object) -> Callable[[np.random.Generator, float, float], Planted]:
    """One of the sensors of a pitch-roll calibration."""

    def made(rng: np.random.Generator, size: float, share: float) -> Planted:
        truth = attitude.Bench(sigma_deg=SIGMA_DEG, **bench)  # type: ignore[arg-type]
        data = attitude.simulate(truth, plan, int(rng.integers(1 << 30)))[0]
        name = next(iter(data.outputs))
        y = data.outputs[name].copy()
        bad = _anywhere(rng, y, share)
        y[bad] += float(np.radians(SIGMA_DEG)) * truth.sensors[0].S * _off(rng, bad.size, size)
        found = of_attitude(replace(data, outputs={**data.outputs, name: y}))[name]
        group = data.point if bench else np.full(len(y), NO_GROUP, np.int64)
        rows = Rows(data.rows.columns, y, np.ones(len(y)), group, data.replicate_index)
        return Planted(bad, found, rows, len(data.outputs))

    return made


def plots(rng: np.random.Generator, size: float, share: float) -> Planted:
    """A whole-plot calibration of twenty whole plots of eleven pressures."""
    data = whole_plot.simulate(whole_plot.Bench(), seed=int(rng.integers(1 << 30)))
    ((name, output),) = data.outputs.items()
    y = output.copy()
    bad = _anywhere(rng, y, share)
    y[bad] += whole_plot.SUBPLOT * _off(rng, bad.size, size)
    inside = np.array([not of_whole_plot(term) for term in FULL.terms])
    columns = FULL.columns(data.table)[1][:, inside]
    found = of_whole_plots(replace(data, outputs={name: y}), FULL)[name]
    return Planted(bad, found, Rows(columns, y, np.ones(len(y)), data.whole_plot_index))


def _sixty(rng: np.random.Generator) -> FloatArray:
    return np.asarray(np.sort(rng.uniform(0.0, 10.0, 60)))


def _far(rng: np.random.Generator) -> FloatArray:
    return np.asarray(np.r_[_sixty(rng)[1:], 100.0])


def _repeats(settings: int, repeats: int) -> Callable[[np.random.Generator], FloatArray]:
    return lambda rng: np.repeat(np.arange(float(settings)), repeats)


KINDS: dict[str, Callable[[np.random.Generator, float, float], Planted]] = {
    "line": table(_sixty),
    "line, one side": table(_sixty, one_side=True),
    "line, one value": table(_sixty, same_value=True),
    "line, neighbours of one value": table(_sixty, _neighbours, same_value=True),
    "line, row of high leverage": table(_far, _last),
    "line, stated sd": table(_sixty, weighted=True),
    "line, errors in the abscissa": table(_sixty, u_x=SD),
    "cubic": table(_sixty, degree=3),
    "5 settings 6 times": table(_repeats(5, 6)),
    "10 settings 6 times": table(_repeats(10, 6)),
    "10 settings 6 times, stated sd": table(_repeats(10, 6), weighted=True),
    "whole plots": plots,
    "attitude, 6 replications": nights(attitude.D1(180, 5, 5)),
    "attitude, 3 replications": nights(attitude.D1(180, 5, 9, replications=3)),
    "attitude, 6 replications, undeclared pads": nights(
        attitude.D1(180, 5, 5), compliance={("y", "x"): 4e-2}, offset_sd=2.0
    ),
}


def planted_errors() -> Study:
    """Bad rows missed, those that the oracle misses, and good rows named."""
    cases = {f"{kind}, {size:g} sd": partial(_seed, kind=kind, size=size) for kind in KINDS for size in SIZES}
    return Study(cases, _count, lambda found: {"all": _count([one for results in found.values() for one in results])})


def _seed(seed: int, kind: str, size: float) -> Result:
    return {f"{share:.0%}": _one(seed, kind, size, share) for share in SHARES}


def _one(seed: int, kind: str, size: float, share: float) -> dict[str, int]:
    rng = np.random.default_rng([seed, list(KINDS).index(kind), SIZES.index(size), SHARES.index(share)])
    planted = KINDS[kind](rng, size, share)
    bad, named = set(planted.bad.tolist()), set(planted.found.rows.tolist())
    return {
        "bad": len(bad),
        "missed": len(bad - named),
        "oracle": planted.missed_by_oracle(),
        "wrong": len(named - bad),
        "tables": bool(named - bad),
    }


def _count(results: Results) -> Figures:
    shares: Figures = {}
    for share in results[0]:
        bad, missed, oracle, wrong, tables = (
            sum(one[share][name] for one in results) for name in ("bad", "missed", "oracle", "wrong", "tables")
        )
        shares[share] = f"missed {missed} (oracle {oracle}) of {bad}, wrong {wrong} in {tables} of {len(results)}"
    return shares


PARTS = {"": Part(planted_errors, 12)}
