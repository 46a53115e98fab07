"""Uncertainty budgets of several results after the GUM, computed by GTC."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, sqrt
from typing import Any, Literal

import numpy as np

from rig.fitter import ties
from rig.fitter.arrays import FloatArray
from rig.fitter.budget.coverage import EXCESS, either_side_factor, shape_factor
from rig.fitter.budget.influence import CANCELLED, Correlation, Influence, Inputs, TypeA, checked
from rig.fitter.budget.many_rows import combine

DOMINATED = 1.0
"""Largest standard uncertainty of all other errors, beside that of one or two rectangular errors that dominate: these
have half of the variance. At 0.3, which EA-4/02 has, 1.96 still covers 98.7 %; at 1 it covers 95.5 %, and the coverage
factor changes by 1.4 % there."""
SIDES = 0.5
"""Share of the variance from which a deviation of either sign, and no other shape, has the coverage factor."""
Shapes = bool | Literal["where limits dominate"]
"""Of which results coverage factors are by the shapes of the distributions."""


@dataclass(frozen=True)
class Contribution:
    """One line of a budget.

    Attributes:
        name: of the influence.
        source: what it is traced to.
        kind: "A" or "B".
        standard_uncertainty: of the result, by this influence alone; in the result's unit.
        df: degrees of freedom.
        share: of the result's variance. Half of each covariance with another influence is counted here, so that all
            shares add up to 1; a share is negative if correlations reduce more than the influence adds.

    """

    name: str
    source: str
    kind: Literal["A", "B"]
    standard_uncertainty: float
    df: float
    share: float


@dataclass(frozen=True)
class Budgeted:
    """One result with its budget.

    Attributes:
        name: of the result.
        unit: of all its numbers.
        value: of the result.
        standard_uncertainty: combined.
        df: effective degrees of freedom (Welch-Satterthwaite); infinite if no finite one counts.
        coverage_probability: of the expanded uncertainty.
        coverage_factor: of Student's t with the effective degrees of freedom, with a deviation of either sign if there
            is one, or by the shapes of the distributions.
        expanded_uncertainty: coverage factor times standard uncertainty.
        contributions: the largest first.
        by_shape: whether the coverage factor is by the shapes of the distributions.

    """

    name: str
    unit: str
    value: float
    standard_uncertainty: float
    df: float
    coverage_probability: float
    coverage_factor: float
    expanded_uncertainty: float
    contributions: tuple[Contribution, ...]
    by_shape: bool = False


def budgets(
    names: Sequence[str],
    units: Sequence[str],
    values: FloatArray,
    type_a: TypeA | Sequence[TypeA],
    influences: Sequence[Influence],
    *,
    probability: float = 0.95,
    correlations: Sequence[Correlation] | None = None,
    shapes: Shapes = False,
    forecast: bool = False,
) -> tuple[Budgeted, ...]:
    """A budget for each of m results (JCGM 100, 5.1, 5.2 and annex G).

    Combined uncertainties and degrees of freedom are GTC's. With correlated influences of finite degrees of freedom,
    each group counts as one component of the Welch-Satterthwaite formula (Willink, Metrologia 44 (2007) 340).

    Args:
        names: of the results.
        units: of the results.
        values: (m,) of the results.
        type_a: one covariance of the results, or several; () for none.
        influences: with (m,) sensitivities each.
        probability: coverage probability.
        correlations: between influences.
        shapes: True for coverage factors by the shapes of the distributions instead of Student's t, as in EA-4/02,
            S9 and S10; for about 95 %. They are smaller where limits of error dominate. "where limits dominate": only
            for results in which one or two rectangular errors dominate (`DOMINATED`).
        forecast: combined by `combine` in numpy, the same to 1e-9: a forecast need not wait 0.2 s until GTC is loaded.

    Raises:
        FitError: what `checked` refuses, or a probability that is not between 0 and 1.

    Example:
        >>> fit = TypeA(np.array([[0.09]]), df=10.0)
        >>> meter = Influence("gain of dvm", "certificate K-1234", "B", np.array([0.4]))
        >>> (one,) = budgets(["offset"], ["mV"], np.array([5.0]), fit, [meter])
        >>> round(one.standard_uncertainty, 3), round(one.expanded_uncertainty, 2)
        (0.5, 1.0)
        >>> [(line.name, round(line.share, 2)) for line in one.contributions]
        [('gain of dvm', 0.64), ('repeatability', 0.36)]

    """
    inputs = checked(names, values, type_a, influences, correlations)
    if len(units) != len(names):
        raise ValueError(f"{len(units)} units for {len(names)} results")
    found = []
    for j, (combined, df) in enumerate(_in_numpy(inputs) if forecast else _combined(inputs)):
        by_shape = shapes is True or (bool(shapes) and dominated(inputs, j, combined))
        side = _either_side(inputs, j) / combined if combined else 0.0
        by_shape = by_shape and side**2 < SIDES
        k = float(
            shape_factor(probability, _index(inputs, j, combined, df) - side**4 / 3.0)
            if by_shape
            else either_side_factor(probability, side, df)
        )
        lines = ties.ordered(_lines(inputs, j), key=lambda one: -one.standard_uncertainty)
        value = float(inputs.values[j])
        expanded = k * combined
        found.append(
            Budgeted(names[j], units[j], value, combined, df, probability, k, expanded, tuple(lines), by_shape)
        )
    return tuple(found)


def covariance(
    type_a: TypeA | Sequence[TypeA],
    influences: Sequence[Influence],
    correlations: Sequence[Correlation] | None = None,
    *,
    count: int,
) -> FloatArray:
    """(m, m) covariance of `count` results, from all type A covariances and all influences."""
    inputs = checked([str(j) for j in range(count)], np.zeros(count), type_a, influences, correlations)
    s = inputs.sensitivities
    total: FloatArray = s.T @ inputs.correlation @ s
    for one in inputs.type_a:
        total = total + one.covariance
    return total


def _combined(inputs: Inputs) -> list[tuple[float, float]]:
    """Standard uncertainty and degrees of freedom of each result, from GTC."""
    from GTC import core, function  # noqa: PLC0415  # 0.2 s, for those who ask for a budget

    units: list[Any] = [None] * len(inputs.influences)
    for group in inputs.groups:
        size, df = len(group), inputs.influences[group[0]].df
        alike = core.multiple_ureal([0.0] * size, [1.0] * size, df) if size > 1 else [core.ureal(0.0, 1.0, df)]
        for a, i in enumerate(group):
            units[i] = alike[a]
            for b, j in enumerate(group[:a]):
                core.set_correlation(float(inputs.correlation[i, j]), alike[b], alike[a])
    found = []
    for j, value in enumerate(inputs.values.tolist()):
        s = inputs.sensitivities[:, j]
        terms = [core.constant(value)]
        if s @ inputs.correlation @ s > CANCELLED * (s @ s):
            terms += [number * unit for number, unit in zip(s.tolist(), units, strict=True) if number]
        for one in inputs.type_a:
            sd, df = sqrt(float(one.covariance[j, j])), _df(one, j)
            terms += [core.ureal(0.0, sd, df)] if sd else []
        result = function.sum(terms)
        u = float(core.uncertainty(result))
        found.append((u, float(core.dof(result)) if u else inf))
    return found


def _in_numpy(inputs: Inputs) -> list[tuple[float, float]]:
    dfs = np.array([one.df for one in inputs.influences], dtype=np.float64)
    type_a = [(np.diag(one.covariance), one.df) for one in inputs.type_a]
    found = combine(inputs.sensitivities.T, dfs, type_a, correlation=inputs.correlation)
    return list(zip(found.standard_uncertainty.tolist(), found.df.tolist(), strict=True))


def dominated(inputs: Inputs, j: int, combined: float) -> bool:
    """Whether one or two independent rectangular errors dominate result j."""
    alone = (group[0] for group in inputs.groups if len(group) == 1)
    variances = sorted(
        (float(inputs.sensitivities[i, j]) ** 2 for i in alone if inputs.influences[i].distribution == "rectangular"),
        reverse=True,
    )
    largest = sum(variances[:2])
    return largest > 0.0 and combined**2 - largest <= DOMINATED**2 * largest


def _index(inputs: Inputs, j: int, combined: float, df: float) -> float:
    """Index of `shape_factor` for result j; correlated influences count as normal."""
    alone = [i for group in inputs.groups if len(group) == 1 for i in group] if combined else []
    shares = {i: float(inputs.sensitivities[i, j] / combined) ** 4 for i in alone}
    return 1.0 / df + sum(share * EXCESS[inputs.influences[i].distribution] for i, share in shares.items())


def _lines(inputs: Inputs, j: int) -> list[Contribution]:
    """Lines of the budget of result j; one that contributes nothing has its line, too."""
    s = inputs.sensitivities[:, j]
    with_others = s * (inputs.correlation @ s)
    variances = [float(one.covariance[j, j]) for one in inputs.type_a]
    total = float(np.sum(with_others)) + sum(variances)
    lines = []
    for fit, variance in zip(inputs.type_a, variances, strict=True):
        share = variance / total if total else 0.0
        lines.append(Contribution(fit.name, fit.source, fit.kind, sqrt(variance), _df(fit, j), share))
    for i, one in enumerate(inputs.influences):
        share = float(with_others[i]) / total if total else 0.0
        lines.append(Contribution(one.name, one.source, one.kind, abs(float(s[i])), one.df, share))
    return lines


def _either_side(inputs: Inputs, j: int) -> float:
    """Size of the largest deviation of either sign of result j; others count by their variance."""
    return max((abs(float(one.deviation[j])) for one in inputs.type_a if one.deviation is not None), default=0.0)


def _df(one: TypeA, j: int) -> float:
    return float(np.broadcast_to(one.df, len(one.covariance))[j])
