"""Further runs as they could come about, given what the first one read."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import special

from fitter.arrays import FloatArray
from fitter.confirm.compare import searched
from fitter.confirm.question import Question
from fitter.confirm.together import Candidates, Together, left
from fitter.trace.aliases import PER_COLUMN

SELECTED = 3.5e-4
"""Probability at which a trace takes up one candidate: 3.5 % of a run, over the hundred or so that it tries."""
MORE = 20
"""Sizes drawn for each that is kept when those are weighed by how easily a trace would have found them."""
RANK = 1e-8


@dataclass(frozen=True, eq=False)
class Fit:
    """Coefficients of columns that may not all be determined.

    Attributes:
        estimate: (q,) or (q, k) the shortest that fit best, columns being of length one.
        spread: (q, r) times r independent standard errors: what they are uncertain by.

    """

    estimate: FloatArray
    spread: FloatArray

    @classmethod
    def of(cls, columns: FloatArray, outputs: FloatArray) -> Fit:
        """Least squares of columns (n, q) to outputs (n,) or, for as many estimates side by side, (n, k)."""
        length = np.linalg.norm(columns, axis=0)
        length = np.where(length > 0, length, 1.0)
        u, s, vt = np.linalg.svd(columns / length, full_matrices=False)
        kept = s > RANK * s.max(initial=0.0)
        spread = (vt[kept].T / s[kept]) / length[:, None]
        return cls(spread @ (u[:, kept].T @ outputs), spread)


@dataclass(frozen=True, eq=False)
class Could:
    """Both runs as they could be: the first as it was read, the later one drawn.

    Each time: how large the error is, which is known with few degrees of freedom only; the sizes of the effects and
    the declared model's parameters, as the first run leaves them uncertain; what each replication or whole plot has of
    its own; the errors of readings. Sizes are weighed by what it took to be found: of effects just large enough for
    that, those are seen of which chance made more (Yekutieli, J. R. Statist. Soc. B 74, 2012).

    Attributes:
        both: the first run and a planned one.
        question: whose members are the explanations.

    """

    both: Together
    question: Question

    @cached_property
    def likely(self) -> FloatArray:
        """(M,) probability of each member by the first run alone."""
        costs = []
        for member in self.question.members:
            columns = self._first.columns_of([*member.terms, *self.question.rest])
            rss = float(np.sum(left(columns, self._first.outputs) ** 2))
            costs.append(rss + PER_COLUMN * (len(member.terms) + searched(member)))
        weights = np.exp(-0.5 * (np.array(costs) - min(costs)))
        return np.asarray(weights / weights.sum())

    def outputs(self, member: int, draws: int) -> FloatArray:
        """(S n, draws) both runs if one member is true; weighed, the declared model taken out."""
        rng, both = np.random.default_rng([draws, member]), self.both
        error = np.sqrt(both.df / rng.chisquare(both.df, draws))
        terms = [*self.question.members[member].terms, *self.question.rest]
        sizes = self._sizes(terms, error, rng)
        raw = both.raw(terms)
        return np.concatenate([self._of_sensor(i, raw[i], sizes, error, rng) for i in range(len(both.sensors))])

    @cached_property
    def _first(self) -> Together:
        return self.both.only(~self.both.fresh)

    def _sizes(self, terms: Candidates, error: FloatArray, rng: np.random.Generator) -> FloatArray:
        """(q, draws) coefficients of effects."""
        fit = Fit.of(self._first.columns_of(terms), self._first.outputs)
        many = rng.standard_normal((fit.spread.shape[1], MORE * error.size)) * np.repeat(error, MORE)
        sizes = fit.estimate[:, None] + fit.spread @ many
        weights = np.ones(sizes.shape[1])
        for group in _groups(terms):
            weights /= _found(sizes[group], fit.spread[group])
        of_error = weights.reshape(error.size, MORE)
        reached = np.cumsum(of_error, axis=1)
        chosen = np.argmax(reached >= rng.random((error.size, 1)) * reached[:, -1:], axis=1)
        return np.asarray(sizes[:, np.arange(error.size) * MORE + chosen])

    def _of_sensor(
        self, i: int, effects: FloatArray, sizes: FloatArray, error: FloatArray, rng: np.random.Generator
    ) -> FloatArray:
        """(n, draws) of one sensor."""
        both, fresh = self.both, self.both.fresh
        declared, effects = both.weigh(i, both.declared[i]), both.weigh(i, effects)
        read = both.weigh(i, both.raw_outputs[i][:, None])
        first = Fit.of(declared[~fresh], (read - effects @ sizes)[~fresh])
        parameters = first.estimate + first.spread @ (rng.standard_normal((first.spread.shape[1], error.size)) * error)
        errors = rng.standard_normal((fresh.size, error.size)) * error
        self._own(i, declared, errors, error, rng)
        drawn = np.where(fresh[:, None], declared @ parameters + effects @ sizes + errors, read)
        return both.without_declared(i, drawn)

    def _own(
        self, i: int, declared: FloatArray, errors: FloatArray, error: FloatArray, rng: np.random.Generator
    ) -> None:
        """Give each replication or whole plot its own, of a variance that the first run knows from a few of them."""
        groups = [own for own in self.both.own[i] if not self.both.fresh[own.rows[0]]]
        if not groups:
            return
        means = np.array([declared[own.rows].mean(0) for own in groups])
        df = max(len(groups) - int(np.linalg.matrix_rank(means, tol=1e-6 * np.abs(means).max())), 1)
        more = np.sqrt(df / rng.chisquare(df, error.size))
        for own in self.both.own[i]:
            if self.both.fresh[own.rows[0]]:
                part = own.basis.T @ errors[own.rows] / error
                sd = np.where(own.kept[:, None] < 1.0, np.maximum(more, own.kept[:, None] * error), error)
                errors[own.rows] += own.basis @ (part * (sd - error))


def _groups(terms: Candidates) -> list[list[int]]:
    """Terms that were found together: those of one effect on one sensor."""
    groups: dict[tuple[str, str | None], list[int]] = {}
    for k, term in enumerate(terms):
        groups.setdefault((term.effect.name, term.sensor), []).append(k)
    return list(groups.values())


def _found(sizes: FloatArray, spread: FloatArray) -> FloatArray:
    """(draws,) probability that a trace finds an effect of these sizes (q, draws)."""
    _, s, vt = np.linalg.svd(spread.T, full_matrices=False)
    kept = s > RANK * s.max(initial=0.0)
    if not kept.any():
        return np.ones(sizes.shape[1])
    strength = np.linalg.norm((vt[kept] @ sizes) / s[kept][:, None], axis=0)
    limit = np.sqrt(special.chdtri(int(kept.sum()), SELECTED))
    return np.asarray(special.ndtr(strength - limit) + special.ndtr(-strength - limit))
