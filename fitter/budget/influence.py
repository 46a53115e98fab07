"""Input quantities of an uncertainty budget: influences with mean zero, type A covariances, correlations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import Literal

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError

Distribution = Literal["normal", "t", "rectangular", "triangular", "arcsine"]
"""Shape of an influence's distribution. It counts in a Monte Carlo simulation; "t" has the influence's degrees of
freedom, and a standard uncertainty that is its scale (JCGM 101, 6.4.9)."""

CANCELLED = 1e-14
"""Variance of correlated influences, as a share of the variance that they have alone, below which they cancel."""


@dataclass(frozen=True, eq=False)
class Influence:
    """One input quantity of a budget: a source of error with mean zero.

    One source that acts on several results, or in several ways on one, is one influence: its sensitivities are signed,
    and so common errors add or cancel.

    Attributes:
        name: such as "gain of dvm"; different for every influence of a budget.
        source: what it is traced to, such as "certificate K-1234 of asset 17" or "model".
        kind: "A" if evaluated by statistics of repeated observations, else "B" (JCGM 100, 4.2 and 4.3).
        sensitivities: (m,) displacement of each result for one standard uncertainty of the influence, with its sign.
            In the units of the results.
        df: degrees of freedom of the standard uncertainty.
        distribution: shape.

    """

    name: str
    source: str
    kind: Literal["A", "B"]
    sensitivities: FloatArray
    df: float = inf
    distribution: Distribution = "normal"


@dataclass(frozen=True, eq=False)
class TypeA:
    """Covariance of the results by statistics of repeated observations, such as that of a fit.

    Attributes:
        covariance: (m, m) of the results, in products of their units.
        df: (m,) degrees of freedom of each variance, or one number for all.
        name: of this source of error.
        source: what it is traced to.
        kind: "B" for many independent errors of one source that are stated, not observed.
        deviation: (m,) part of known size and of either sign, with the signs that it has together; its square is in the
            covariance. None for none.

    """

    covariance: FloatArray
    df: FloatArray | float
    name: str = "repeatability"
    source: str = "repeatability"
    kind: Literal["A", "B"] = "A"
    deviation: FloatArray | None = None


@dataclass(frozen=True)
class Correlation:
    """Correlation between two influences.

    Both have infinite degrees of freedom, or the same finite number from one simultaneous evaluation (Willink,
    Metrologia 44 (2007) 340, 4.1).

    Attributes:
        first: name of an influence.
        second: name of another.
        coefficient: from -1 to 1.

    """

    first: str
    second: str
    coefficient: float


@dataclass(frozen=True, eq=False)
class Inputs:
    """All inputs of a budget of m results, checked.

    Attributes:
        names: of the results.
        values: (m,) their values.
        type_a: covariances of the results.
        influences: p influences.
        correlation: (p, p) of the influences.

    """

    names: tuple[str, ...]
    values: FloatArray
    type_a: tuple[TypeA, ...]
    influences: tuple[Influence, ...]
    correlation: FloatArray

    @property
    def sensitivities(self) -> FloatArray:
        """(p, m) displacement of each result for one standard uncertainty of each influence."""
        return np.array([one.sensitivities for one in self.influences]).reshape(len(self.influences), len(self.values))

    @property
    def df(self) -> FloatArray:
        """(p,) degrees of freedom of each influence."""
        return np.array([one.df for one in self.influences], dtype=np.float64)

    @property
    def groups(self) -> tuple[tuple[int, ...], ...]:
        """Influences that are correlated, directly or through others; each alone where it is not."""
        return connected(self.correlation)


def checked(
    names: Sequence[str],
    values: FloatArray,
    type_a: TypeA | Sequence[TypeA],
    influences: Sequence[Influence],
    correlations: Sequence[Correlation] | None,
) -> Inputs:
    """The inputs of a budget, with arrays of the right shapes.

    Raises:
        FitError: a number is not finite, a degree of freedom not positive, two influences have one name, a correlation
            names none, or is impossible. ValueError: an array has another shape.

    """
    m = len(names)
    given = _finite("values of the results", np.asarray(values, dtype=np.float64), (m,))
    covariances = (type_a,) if isinstance(type_a, TypeA) else tuple(type_a)
    found = tuple(_checked_type_a(one, m) for one in covariances)
    inputs = tuple(_checked_influence(one, m) for one in influences)
    known = [one.name for one in inputs]
    twice = sorted({name for name in known if known.count(name) > 1})
    if twice:
        raise FitError(
            f"two influences are called {twice[0]}: an influence on several results is one, with a sign for each"
        )
    return Inputs(tuple(names), given, found, inputs, _correlation_matrix(inputs, correlations or ()))


def connected(correlation: FloatArray) -> tuple[tuple[int, ...], ...]:
    """Groups of numbers that are correlated, directly or through others.

    Args:
        correlation: (p, p) matrix.

    """
    left, groups = set(range(len(correlation))), []
    while left:
        group, edge = set[int](), {min(left)}
        while edge:
            group |= edge
            edge = {int(j) for i in edge for j in np.flatnonzero(correlation[i])} - group
        left -= group
        groups.append(tuple(sorted(group)))
    return tuple(groups)


def _finite(what: str, array: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    if array.shape != shape:
        raise ValueError(f"{what}: expected shape {shape}, found {array.shape}")
    if not np.all(np.isfinite(array)):
        raise FitError(f"{what}: a number is not finite")
    return array


def _checked_influence(one: Influence, m: int) -> Influence:
    sensitivities = _finite(f"influence {one.name}", np.asarray(one.sensitivities, dtype=np.float64), (m,))
    _positive_df(f"influence {one.name}", one.df)
    return Influence(one.name, one.source, one.kind, sensitivities, float(one.df), one.distribution)


def _checked_type_a(one: TypeA, m: int) -> TypeA:
    covariance = _finite(f"type A covariance, {one.name}", np.asarray(one.covariance, dtype=np.float64), (m, m))
    variances = np.diag(covariance)
    if np.any(variances < 0.0):
        raise FitError(f"type A covariance, {one.name}: variance {float(np.min(variances)):g} is negative")
    df = np.broadcast_to(np.asarray(one.df, dtype=np.float64), (m,))
    for number in df.tolist():
        _positive_df(f"type A covariance, {one.name}", number)
    return replace(one, covariance=covariance, df=df)


def _positive_df(what: str, df: float) -> None:
    if not df > 0.0:
        raise FitError(f"{what}: {df:g} degrees of freedom; more than 0 are needed")


def _correlation_matrix(influences: Sequence[Influence], correlations: Sequence[Correlation]) -> FloatArray:
    place = {one.name: i for i, one in enumerate(influences)}
    matrix = np.eye(len(influences))
    for one in correlations:
        both = f"correlation of {one.first} and {one.second}"
        for name in (one.first, one.second):
            if name not in place:
                raise FitError(f"{both}: no influence is called {name}; there are {', '.join(place) or 'none'}")
        i, j = place[one.first], place[one.second]
        if i == j or not abs(one.coefficient) <= 1.0:
            raise FitError(f"{both}: {one.coefficient:g}; needed are two influences, and a number from -1 to 1")
        if influences[i].df != influences[j].df:
            raise FitError(
                f"{both}: they have {influences[i].df:g} and {influences[j].df:g} degrees of freedom; correlated "
                "influences have infinitely many, or the same number from one evaluation"
            )
        matrix[i, j] = matrix[j, i] = one.coefficient
    if len(matrix) and float(np.min(np.linalg.eigvalsh(matrix))) < -1e-9:
        raise FitError(
            "the correlations between influences contradict each other: their matrix has a negative eigenvalue"
        )
    return matrix
