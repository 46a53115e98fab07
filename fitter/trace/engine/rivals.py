"""Other effects that explain a table equally well; candidates are blocks of columns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rig.fitter import ties
from rig.fitter.arrays import FloatArray
from rig.fitter.trace.aliases import DELTA, PER_COLUMN, Rival, best_first
from rig.fitter.trace.engine.problem import Candidate, Problem
from rig.fitter.trace.engine.score import View

CLOSEST = 6
"""Number of effects tried with several terms if the found effect has several."""
ALIKE = 4.0
"""Difference of twice the log-likelihood up to which the order of the catalogue decides."""
SHAPES = ("kink", "clip", "square-root")
"""Kinds of curves that are not named after a power where they are more probable than it."""


def costs(problem: Problem, found: Sequence[Rival]) -> dict[Rival, float]:
    """Minus twice the log-likelihood of each alias, but for a constant, with its columns' price by Schwarz."""
    extra = np.log(problem.n) - PER_COLUMN
    return {r: r.sigmas**2 + extra * sum(problem.candidates[j].term.price for j in r.terms) for r in found if r.alias}


def lead(problem: Problem, found: Sequence[Rival]) -> Rival:
    """The most probable of the indistinguishable explanations, by `costs`.

    Among about equally probable ones the first in the catalogue; but a curve of `SHAPES` that is more probable than
    that leads: a power in its place is far off near a bend.
    """
    cost = costs(problem, found)
    least = min(cost.values())
    first = min((r for r in cost if cost[r] - least < ALIKE), key=lambda r: min(r.terms))
    shapes = [r for r in cost if problem.candidates[r.terms[0]].effect.kind.name in SHAPES]
    able = [first, *shapes]
    return able[ties.lowest([cost[r] for r in able])]


def rivals(problem: Problem, view: View, y: FloatArray, chosen: tuple[int, ...], effect: str) -> tuple[Rival, ...]:
    """All explanations for the terms of `effect` among `chosen`, including itself, best first.

    Args:
        problem: the table.
        view: the same whitened.
        y: (n,) whitened response.
        chosen: candidates in the model.
        effect: name of one among them.
    """
    candidates = problem.candidates
    group = tuple(j for j in chosen if candidates[j].effect.name == effect)
    rest = tuple(j for j in chosen if j not in group)
    held = {candidates[j].effect.name for j in rest}
    full = view.taken(chosen)
    left = y - full @ (full.T @ y)
    variance = max(float(left @ left) / max(len(y) - full.shape[1], 1), np.finfo(float).tiny)

    taken = view.taken(rest)
    beside = y - taken @ (taken.T @ y)
    path = _Path(candidates, view, beside, variance, rest)
    gains, _ = view.gains(rest, y)
    best = {name: int(own[ties.highest(gains[own], variance)]) for name, own in problem.named.items()}
    single = {name: j for name, j in best.items() if gains[j] > 0.0 and name not in held and name != effect}
    known = view.all_kept(rest)[view.start[:-1]] & (np.diff(view.start) == 1)
    paths = {effect: [(group, path.price(group))]}
    for name, j in single.items():
        paths[name] = [((j,), path.priced((j,), float(gains[j])) if known[j] else path.price((j,)))]
    if len(group) > 1:
        ahead, price = list(single), np.array([paths[name][0][1] for name in single])
        for name in [ahead[k] for k in ties.descending(-price)[:CLOSEST]]:
            paths[name] += path.longer(single[name], len(group))
    least = min(cost for steps in paths.values() for _, cost in steps)
    found = []
    for name, steps in paths.items():
        near = [step for step in steps if step[1] - least <= DELTA]
        terms, cost = near[0] if near else steps[ties.lowest([cost for _, cost in steps])]
        found.append(Rival(name, terms, float(np.sqrt(max(cost - least, 0.0)))))
    return best_first(found)


@dataclass(frozen=True, eq=False)
class _Path:
    """Explanations by one effect: its best term, its best two and so on.

    Attributes:
        candidates: of the table.
        view: the table whitened.
        y: (n,) whitened response, with the rest of the model removed.
        variance: of the whitened response's error.
        rest: candidates in the model that stay.
    """

    candidates: Sequence[Candidate]
    view: View
    y: FloatArray
    variance: float
    rest: tuple[int, ...]

    def price(self, terms: tuple[int, ...]) -> float:
        """Residual sum of squares with `terms` minus that without, plus the price of the columns."""
        return self.priced(terms, self.view.gain((*self.rest, *terms), self.y))

    def priced(self, terms: tuple[int, ...], gain: float) -> float:
        """The same where the reduction is known, because all of these columns are used."""
        return -gain / self.variance + PER_COLUMN * sum(self.candidates[j].term.price for j in terms)

    def longer(self, first: int, most: int) -> list[tuple[tuple[int, ...], float]]:
        """Up to `most` terms of the effect of `first`, each with the largest reduction, and their price."""
        name = self.candidates[first].effect.name
        terms = [j for j, c in enumerate(self.candidates) if c.effect.name == name]
        steps: list[tuple[tuple[int, ...], float]] = []
        held: tuple[int, ...] = (first,)
        while len(held) < min(most, len(terms)):
            others = [j for j in terms if j not in held]
            gains, _ = self.view.gains((*self.rest, *held), self.y)
            held = (*held, others[ties.highest(gains[others], self.variance)])
            steps.append((held, self.price(held)))
        return steps
