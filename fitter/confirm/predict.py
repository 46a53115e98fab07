"""Expected result of a planned run: separation of the explanations of an effect.

Many further runs are simulated, given the readings of the first one, and judged by the judge's own code. So the
forecast includes the parameters estimated again from the further run, the price of columns, and the own errors of
replications and whole plots.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import special

from rig.fitter.arrays import FloatArray
from rig.fitter.confirm.compare import NOTHING, Comparison, Pair, behind, costs_so_far, possible
from rig.fitter.confirm.minor_causes import notable
from rig.fitter.confirm.question import Hypothesis, Question
from rig.fitter.confirm.reduced import reduced
from rig.fitter.confirm.together import RANK, Candidates, Fit, Together

SELECTED = 3.5e-4
"""Probability at which a trace selects one candidate: 3.5 % of a run, over the hundred or so that it tries."""
MORE = 20
"""Number of drawn sizes per kept one, when they are weighted by their probability of detection by a trace."""


@dataclass(frozen=True, eq=False)
class Could:
    """All runs with simulated outputs: those that were made as measured, the last one drawn.

    Each draw has a variance of error, known with few degrees of freedom only; sizes of the effects and parameters of
    the declared model, with the uncertainty left by the first run; sizes after a change by a person, of the order of
    those before; the own error of each replication or whole plot; errors of readings. Sizes are weighted by their
    probability of detection: small effects are detected if chance increased them (Yekutieli, J. R. Statist. Soc. B 74,
    2012).

    Attributes:
        both: the first run and a planned one.
        question: its members are the explanations.
    """

    both: Together
    question: Question

    @cached_property
    def likely(self) -> FloatArray:
        """(M,) probability of each member by the first run alone."""
        weights = np.exp(-0.5 * (self._costs - min(self._costs)))
        return np.asarray(weights / weights.sum())

    @cached_property
    def possible(self) -> list[int]:
        """Numbers of the members that may be true by the runs that were made."""
        return possible(self._costs, self.question, self.both.df)

    @cached_property
    def _costs(self) -> FloatArray:
        return costs_so_far(self._first, self.question)

    def outputs(self, member: int, draws: int) -> FloatArray:
        """(S n, draws) both runs if one member is true; weighted, with the declared model removed."""
        rng, both = np.random.default_rng([draws, member]), self.both
        error = np.sqrt(both.df / rng.chisquare(both.df, draws))
        terms = [*self.question.members[member].terms, *self.question.rest]
        sizes, resized = self._sizes(self.question.members[member], error, rng), both.resized(terms)
        raw = np.concatenate([both.raw(terms), resized.raw], axis=2)
        others = np.abs(sizes[list(resized.of)]) * rng.standard_normal((len(resized.of), draws))
        sizes = np.concatenate([sizes, others])
        return np.concatenate([self._of_sensor(i, raw[i], sizes, error, rng) for i in range(len(both.sensors))])

    @cached_property
    def _first(self) -> Together:
        """The runs that were made."""
        return self.both.only(~self.both.last)

    def _sizes(self, member: Hypothesis, error: FloatArray, rng: np.random.Generator) -> FloatArray:
        """(q, draws) coefficients of a member and the other effects."""
        terms = [*member.terms, *self.question.rest]
        fit = Fit.of(self._first.columns_of(terms), self._first.outputs)
        many = rng.standard_normal((fit.spread.shape[1], MORE * error.size)) * np.repeat(error, MORE)
        sizes = fit.estimate[:, None] + fit.spread @ many
        if member.last:
            return notable(self._first, member, self.question.rest, sizes[:, ::MORE])
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
        """(n, draws) readings of one sensor."""
        both, fresh = self.both, self.both.last
        declared, effects = both.weigh(i, both.declared[i]), both.weigh(i, effects)
        read = both.weigh(i, both.raw_outputs[i][:, None])
        first = Fit.of(declared[~fresh], (read - effects @ sizes)[~fresh])
        parameters = first.estimate + first.spread @ (rng.standard_normal((first.spread.shape[1], error.size)) * error)
        errors = np.zeros((fresh.size, error.size))
        errors[fresh] = rng.standard_normal((int(fresh.sum()), error.size)) * error
        self._own(i, errors, error, rng)
        drawn = np.where(fresh[:, None], declared @ parameters + effects @ sizes + errors, read)
        return both.without_declared(i, drawn)

    def _own(self, i: int, errors: FloatArray, error: FloatArray, rng: np.random.Generator) -> None:
        """Add each replication's or whole plot's own error, with a variance estimated from a few of them in the first
        run.
        """
        df = self.both.own_df[i]
        if not df:
            return
        more = np.sqrt(df / rng.chisquare(df, error.size))
        for own in self.both.own[i]:
            if self.both.last[own.rows[0]]:
                part = own.basis.T @ errors[own.rows] / error
                sd = np.where(own.kept[:, None] < 1.0, np.maximum(more, own.kept[:, None] * error), error)
                errors[own.rows] += own.basis @ (part * (sd - error))


def _groups(terms: Candidates) -> list[list[int]]:
    """Terms found together: those of one effect on one sensor."""
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


DRAWS = 200
INTERVAL = 0.05, 0.95
LEAST_OF_A_PAIR = 20
"""Minimum number of draws for each member, however unlikely it is by the first run."""


@dataclass(frozen=True)
class Separation:
    """Expected separation of the explanations of one effect. The member `NOTHING` means: the effect of the first run is
    absent in the later one.

    Attributes:
        effect: the named one.
        sigmas: for each pair of members the median of the standard errors between them if one of them is true; each is
            true with its probability by the first run.
        intervals: 90 % intervals of these.
        chances: probability that the later run excludes the false one, or shows the true one.
    """

    effect: str
    sigmas: Mapping[Pair, float]
    intervals: Mapping[Pair, tuple[float, float]]
    chances: Mapping[Pair, float]

    @property
    def least(self) -> float:
        """Those of the nearest pair."""
        return min(self.sigmas.values())


def separation(both: Together | Sequence[Together], questions: Sequence[Question]) -> tuple[Separation, ...]:
    """Expectations for a planned run; its outputs are not used.

    Args:
        both: the first run and the planned one; or several equally probable courses of the planned one.
        questions: open questions.
    """
    ways = [both] if isinstance(both, Together) else both
    return tuple(_separation(own, question) for own, question in reduced(ways, questions))


def _separation(ways: Sequence[Together], question: Question) -> Separation:
    could, judges = [Could(both, question) for both in ways], [Comparison(both, question) for both in ways]
    limits, likely = [member.limit(ways[0].df) for member in question.members], could[0].likely
    true = could[0].possible
    counts = np.maximum(np.round(DRAWS / len(ways) * likely).astype(int), LEAST_OF_A_PAIR)
    told = _drawn(could, judges, {j: int(counts[j]) for j in true})
    counts *= len(ways)
    weight = likely / counts
    names = [member.effect for member in question.members]
    figures: dict[Pair, tuple[FloatArray, NDArray[np.bool_], FloatArray]] = {}
    for i, j in itertools.combinations(range(len(names)), 2):
        pairs = [(k, i + j - k) for k in (i, j) if k in told]
        # a cause alone does not exclude a pair with it
        pairs = [(k, other) for k, other in pairs if not question.members[other].has(question.members[k])]
        if not pairs:
            continue
        every = [_fallen(told[k], k, other, limits) for k, other in pairs]
        weights = np.concatenate([np.repeat(weight[k], counts[k]) for k, _ in pairs])
        values = np.concatenate([between for between, _ in every])
        figures[names[i], names[j]] = values, np.concatenate([alone for _, alone in every]), weights
    for i in true:
        figures[names[i], NOTHING] = told[i].shown, told[i].shown >= limits[i], np.ones(counts[i])
    return Separation(
        question.effect,
        {pair: _quantile(f[0], f[2], 0.5) for pair, f in figures.items()},
        {pair: (_quantile(f[0], f[2], INTERVAL[0]), _quantile(f[0], f[2], INTERVAL[1])) for pair, f in figures.items()},
        {pair: float(np.average(f[1], weights=f[2])) for pair, f in figures.items()},
    )


@dataclass(frozen=True, eq=False)
class _Drawn:
    """Results of the judge for k simulated runs, if one member is true.

    Attributes:
        costs: (M, k) as `Apart.costs`.
        shown: (k,) standard errors by which the later run shows that member.
    """

    costs: FloatArray
    shown: FloatArray

    @cached_property
    def behind(self) -> FloatArray:
        """(M, k) as `Apart.behind`."""
        return behind(self.costs)


def _drawn(could: Sequence[Could], judges: Sequence[Comparison], counts: Mapping[int, int]) -> dict[int, _Drawn]:
    """Results of the judge for so many runs of each course, for each member that may be true."""
    ends = np.cumsum([0, *counts.values()])
    parts: dict[int, list[tuple[FloatArray, FloatArray]]] = {member: [] for member in counts}
    for course, judge in zip(could, judges, strict=True):
        outputs = [course.outputs(member, count) for member, count in counts.items()]
        costs = judge.costs(np.hstack(outputs))
        for k, (member, own) in enumerate(zip(counts, outputs, strict=True)):
            parts[member].append((costs[:, ends[k] : ends[k + 1]], judge.shown(member, own)))
    return {
        member: _Drawn(np.hstack([costs for costs, _ in own]), np.concatenate([shown for _, shown in own]))
        for member, own in parts.items()
    }


def _fallen(drawn: _Drawn, true: int, false: int, limits: Sequence[float]) -> tuple[FloatArray, NDArray[np.bool_]]:
    """(k,) standard errors between a true and a false member, and whether only the false one is excluded."""
    costs, far = drawn.costs, drawn.behind
    between = np.sqrt(np.abs(costs[false] - costs[true]))
    return between, (far[false] > limits[false]) & (far[true] <= limits[true])


def _quantile(values: FloatArray, weights: FloatArray, level: float) -> float:
    order = np.argsort(values)
    reached = (np.cumsum(weights[order]) - 0.5 * weights[order]) / np.sum(weights)
    return float(np.interp(level, reached, values[order]))
