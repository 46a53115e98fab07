"""A table prepared for the search: response, declared columns, candidates' columns, and possible common noise
of rows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.resolution import resolution
from rig.fitter.trace.engine.noise import Noise
from rig.fitter.trace.engine.term import TableTerm
from rig.fitter.trace.jointly import nearest, ranks
from rig.fitter.trace.not_kept import NotKept

NEAR, FEWEST_FOR_NEAR = 6, 30
"""Rows that are near each one, and the fewest rows of a table in which these are near."""
SPARED = 2
"""Minimum degrees of freedom beside a candidate."""
MOST_TERMS = 3
"""Maximum number of terms of one effect with a searched constant: more knots or harmonics are not a description."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """One term of an effect.

    Attributes:
        effect: its entry in a catalogue, a `rig.fitter.effects.entry.Entry` of the kind.
        term: its columns.
        sensor: whose it is; None for all of the run, or for the only one.
        sign: of the coefficient of its only column, +1 or -1; 0 if both are possible.
        most: the largest possible size of that coefficient.
    """

    effect: Any
    term: TableTerm
    sensor: str | None = None
    sign: int = 0
    most: float = np.inf


@dataclass(frozen=True, eq=False)
class Quantities:
    """Recorded numbers (n, d), and what problems of the same rows share about them."""

    values: FloatArray

    @cached_property
    def near(self) -> IntArray:
        """(n, NEAR) rows nearest to each, in ranks."""
        return nearest(ranks(self.values), NEAR)


@dataclass(frozen=True, eq=False)
class Problem:
    """Data of a search.

    Attributes:
        y: (n,) response.
        declared: (n, k) columns of the declared model.
        candidates: in catalogue order, cheapest first.
        noise: possible common noise of rows.
        sd: (n,) standard deviation of each row's own error over the usual one.
        ordered: whether rows have an order, of measurement or of a setting.
        presumed: whether that order is only assumed.
        left_out: candidates that cannot be used in computation.
        sensors: of the run, each of which is searched: findings by chance are counted over all.
        quantities: recorded numbers, none of them constant.
        effort: share of the work of a simulation that this one may take, among others of the same run.
    """

    y: FloatArray
    declared: FloatArray
    candidates: tuple[Candidate, ...]
    noise: Noise
    sd: FloatArray
    ordered: bool
    presumed: bool = False
    left_out: tuple[NotKept, ...] = ()
    sensors: int = 1
    quantities: Quantities | None = None
    effort: float = 1.0

    @property
    def n(self) -> int:
        """Number of rows."""
        return len(self.y)

    @cached_property
    def step(self) -> FloatArray:
        """(n,) rounding step of the response, over each row's `sd`; zero if none is detected."""
        return np.asarray(resolution(self.y) / self.sd)

    @property
    def group(self) -> IntArray | None:
        """(n,) group of each row, beside whose others it may be isolated; None without components of groups."""
        found: IntArray | None = getattr(self.noise, "of_group", None)
        return found

    @property
    def near(self) -> IntArray | None:
        """(n, NEAR) rows with about the same quantities as each; None where there are too few rows, or none."""
        return None if self.quantities is None or self.n < FEWEST_FOR_NEAR else self.quantities.near

    @cached_property
    def columns(self) -> FloatArray:
        """(n, D) columns of all candidates side by side."""
        blocks = [c.term.columns for c in self.candidates]
        return np.hstack(blocks) if blocks else np.empty((self.n, 0))

    @property
    def scaled(self) -> FloatArray:
        """(n, D) the same over each row's `sd`: themselves where that is one, since they are large."""
        return self.columns if np.all(self.sd == 1.0) else self.columns / self.sd[:, None]

    @cached_property
    def start(self) -> IntArray:
        """(J + 1,) first column of each candidate."""
        widths = [c.term.columns.shape[1] for c in self.candidates]
        return np.concatenate([[0], np.cumsum(widths)]).astype(np.int64)

    @cached_property
    def named(self) -> dict[str, IntArray]:
        """Candidates of each effect, in order."""
        out: dict[str, list[int]] = {}
        for j, candidate in enumerate(self.candidates):
            out.setdefault(candidate.effect.name, []).append(j)
        return {name: np.array(own) for name, own in out.items()}

    @cached_property
    def signs(self) -> FloatArray:
        """(J,) `Candidate.sign`."""
        return np.array([c.sign for c in self.candidates], np.float64)

    @cached_property
    def most(self) -> FloatArray:
        """(J,) `Candidate.most`."""
        return np.array([c.most for c in self.candidates], np.float64)

    @cached_property
    def bounded(self) -> bool:
        """Whether any candidate has a sign or a largest size."""
        return bool(np.any(self.signs) or np.any(np.isfinite(self.most)))

    @cached_property
    def price(self) -> FloatArray:
        """(J,) `TableTerm.price` of each candidate."""
        return np.array([c.term.price for c in self.candidates], np.float64)

    def of(self, terms: Sequence[int]) -> FloatArray:
        """(n, d) columns of some candidates."""
        blocks = [self.candidates[j].term.columns for j in terms]
        return np.hstack(blocks) if blocks else np.empty((self.n, 0))

    def model(self, chosen: Sequence[int]) -> FloatArray:
        """(n, k + d) declared columns and those of some candidates."""
        return np.hstack([self.declared, self.of(chosen)])

    def crowded(self, chosen: Sequence[int], j: int) -> bool:
        """Whether an effect has the maximum number of terms, or one next to `j` on the grid of its constant."""
        own, profile = self.candidates[j], self.candidates[j].term.profile
        same = [self.candidates[k] for k in chosen if self.candidates[k].effect.name == own.effect.name]
        if profile is None or not same:
            return False
        near = any(k.term.profile and profile.low <= k.term.profile.value <= profile.high for k in same)
        return near or len(same) >= MOST_TERMS

    def rows(self, kept: IntArray) -> Problem:
        """The same for some of the rows."""
        columns, ends = self.columns[kept], self.start[1:-1]
        each = np.split(columns, ends, axis=1) if self.candidates else []
        return replace(
            self,
            y=self.y[kept],
            declared=self.declared[kept],
            candidates=tuple(
                replace(c, term=c.term.rows(kept, own)) for c, own in zip(self.candidates, each, strict=True)
            ),
            noise=self.noise.rows(kept),
            sd=self.sd[kept],
            quantities=None if self.quantities is None else Quantities(self.quantities.values[kept]),
        )._stacked(columns)

    def with_terms(self, terms: dict[int, TableTerm]) -> Problem:
        """The same with other terms in place of some candidates, each of as many columns."""
        candidates, columns = list(self.candidates), self.columns.copy()
        for j, term in terms.items():
            candidates[j] = replace(candidates[j], term=term)
            columns[:, self.start[j] : self.start[j + 1]] = term.columns
        return replace(self, candidates=tuple(candidates))._stacked(columns)

    def only(self, terms: Sequence[int]) -> Problem:
        """The same with some of the candidates alone; neighbours share their columns with it."""
        some = replace(self, candidates=tuple(self.candidates[j] for j in terms))
        if len(terms) and np.array_equal(terms, np.arange(terms[0], terms[0] + len(terms))):
            return some._stacked(self.columns[:, self.start[terms[0]] : self.start[terms[-1] + 1]])
        return some

    def given(
        self, *, y: FloatArray | None = None, noise: Noise | None = None, sd: FloatArray | None = None
    ) -> Problem:
        """The same candidates for another response, covariance or row errors; what is None stays."""
        return replace(
            self,
            y=self.y if y is None else y,
            noise=self.noise if noise is None else noise,
            sd=self.sd if sd is None else sd,
        )._stacked(self.columns)

    def _stacked(self, columns: FloatArray) -> Problem:
        """This problem, whose `columns` are known."""
        vars(self)["columns"] = columns
        return self
