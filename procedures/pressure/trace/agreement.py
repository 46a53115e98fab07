"""Choice between one coefficient of the line and one for each transducer.

An error of pressure is one number in psi for all transducers. If each of them could have the same column separately,
the line must be supported by them: they agree, or the line with corrections for some of them explains the data better,
at the price of the columns, than separate coefficients. The search does not ensure this: a common column reduces the
residual more than any separate one, is selected first, and disagreements are then corrected one by one.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, replace

import numpy as np

from rig.fitter import ties
from rig.fitter.arrays import IntArray
from rig.fitter.linear import orthonormal
from rig.fitter.trace.aliases import DELTA, Rival, best_first
from rig.fitter.trace.search import names_of, prune, search_and_name
from rig.procedures.pressure.trace.judge import WholePlotJudge
from rig.procedures.pressure.trace.problem import Problem

SAME = 1e-3
"""Sine of the angle between two columns below which they are the same: an excitation's output times time is pressure
times time, except for a small zero.
"""
ROUNDS = 3


@dataclass(frozen=True)
class Ways:
    """Two explanations of one effect.

    Attributes:
        line: candidates of the line, each with the same column in every transducer.
        corrections: candidates of single transducers, with these columns, in addition to the line.
        own: candidates of all transducers, with these columns.
        rest: other candidates in the model.
        behind: cost of `own` minus that of `line` and `corrections`, residual and columns, in the error's variance.
    """

    line: tuple[int, ...]
    corrections: tuple[int, ...]
    own: tuple[int, ...]
    rest: tuple[int, ...]
    behind: float


def named(judge: WholePlotJudge, chosen: tuple[int, ...] = ()) -> tuple[int, ...]:
    """The candidates that belong in the model, starting with those `chosen`, by their final names."""
    for _ in range(ROUNDS):
        chosen = search_and_name(judge, chosen, judge.lead)[1]
        agreed = supported(judge, chosen)
        if frozenset(agreed) == frozenset(chosen):
            break
        chosen = agreed
    return chosen


def supported(judge: WholePlotJudge, chosen: tuple[int, ...]) -> tuple[int, ...]:
    """The transducers' own candidates in place of those of the line that they do not support.

    If all of them agree, the line has fewer columns and is kept unless the data reject it; with corrections to a few of
    them the cheaper of both is kept. A line that half of them or more do not support, or that is only suspected, is
    replaced if the transducers' own are within `DELTA`.
    """
    for name in names_of(judge.candidates, chosen):
        ways = ways_of(judge, chosen, name)
        if ways is None:
            continue
        allowed = 0.0 if ways.corrections else -DELTA
        many = not _few(len(ways.corrections), judge.problem)
        if many or judge.candidates[ways.line[0]].effect.on_suspicion:
            allowed = DELTA
        if ways.behind <= allowed:
            chosen = (*ways.rest, *ways.own)
    return chosen


def ways_of(judge: WholePlotJudge, chosen: tuple[int, ...], name: str) -> Ways | None:
    """Both explanations of an effect of the line among the `chosen`; None if there is only one. The transducers' own
    must be significant separately, or are left out.
    """
    line, every = _counterparts(judge.problem, [j for j in chosen if judge.candidates[j].effect.name == name])
    if not line:
        return None
    corrections = tuple(j for j in chosen if j in every)
    rest = tuple(j for j in chosen if j not in (*line, *corrections))
    kept = prune(judge, (*rest, *every))
    own = tuple(j for j in every if j in kept)
    if not own:
        return None
    products = judge.products((*rest, *every), rest)
    behind = products.price(own) - products.price((*line, *corrections))
    return Ways(line, corrections, own, rest, behind)


def classes(judge: WholePlotJudge, chosen: tuple[int, ...]) -> dict[str, tuple[Rival, ...]]:
    """Every explanation of each effect found, including a line with few corrections, and all transducers separately."""
    found = {name: judge.rivals(chosen, name) for name in names_of(judge.candidates, chosen)}
    for name, rivals in found.items():
        own = next(rival for rival in rivals if rival.effect == name)
        found[name] = _ranked(
            [*rivals, *_all_by_themselves(judge, chosen, own), *_corrected(judge, chosen, own, rivals)]
        )
    return found


def _few(corrections: int, problem: Problem) -> bool:
    """Whether most transducers agree: a line and a correction to all but one of them can explain anything."""
    return 2 * corrections < len(problem.sensors)


def _all_by_themselves(judge: WholePlotJudge, chosen: tuple[int, ...], line: Rival) -> list[Rival]:
    """The transducers' own in place of a line in the model, with the existing corrections."""
    ways = ways_of(judge, chosen, line.effect)
    if ways is None or not ways.corrections:
        return []
    terms = tuple(j for j in ways.own if j not in ways.corrections)
    return _rival(judge, terms, line, ways.behind) if terms else []


def _corrected(judge: WholePlotJudge, chosen: tuple[int, ...], own: Rival, rivals: tuple[Rival, ...]) -> list[Rival]:
    """A line, with corrections for few transducers, in place of separate candidates of all transducers."""
    found = []
    for rival in rivals:
        line, every = _counterparts(judge.problem, rival.terms)
        if not line or any(judge.candidates[j].effect.name != own.effect for j in every):
            continue
        mine = tuple(j for j in chosen if j in every)
        rest = tuple(j for j in chosen if j not in mine)
        if len(mine) < len(judge.problem.sensors):
            continue
        products = judge.products((*rest, *every), rest)
        terms, price = line, products.price(line)
        while _few(len(terms) - len(line) + 1, judge.problem):
            left = [j for j in mine if j not in terms]
            better = left[ties.lowest([products.price((*terms, j)) for j in left])]
            if products.price((*terms, better)) >= price:
                break
            terms, price = (*terms, better), products.price((*terms, better))
        if terms != line:
            found += _rival(judge, terms, own, price - products.price(mine))
    return found


def _rival(judge: WholePlotJudge, terms: tuple[int, ...], than: Rival, behind: float) -> list[Rival]:
    """An explanation with a higher cost than another; its sigmas are the root of a price that may be below
    the best's.
    """
    price = than.sigmas**2 + behind
    return [Rival(judge.candidates[terms[0]].effect.name, terms, float(np.sign(price) * np.sqrt(abs(price))))]


def _ranked(rivals: list[Rival]) -> tuple[Rival, ...]:
    """The cheapest of every name, best first, relative to the best of all."""
    cheapest: dict[str, tuple[float, Rival]] = {}
    for rival in rivals:
        price = float(np.sign(rival.sigmas)) * rival.sigmas**2
        if rival.effect not in cheapest or price < cheapest[rival.effect][0]:
            cheapest[rival.effect] = price, rival
    best = min(price for price, _ in cheapest.values())
    return best_first([replace(rival, sigmas=float(np.sqrt(price - best))) for price, rival in cheapest.values()])


def _counterparts(problem: Problem, of: list[int] | tuple[int, ...]) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Candidates of the line that every transducer could have separately, with the corresponding candidates."""
    line, every = list[int](), list[int]()
    for j in of:
        if problem.candidates[j].sensor is not None or len(problem.sensors) == 1:
            continue
        alike = defaultdict[tuple[str, str], list[int]](list)
        for k in _alike(problem, j).tolist():
            alike[problem.candidates[k].effect.name, problem.candidates[k].term.name].append(k)
        whole = [same for same in alike.values() if len(same) == len(problem.sensors)]
        if whole and (not line or problem.judged_at[j] == problem.judged_at[line[0]]):
            line.append(j)
            every += [k for k in whole[0] if k not in every]
    return tuple(line), tuple(every)


def _alike(problem: Problem, j: int) -> IntArray:
    """Candidates of one transducer with the same column as `j`, beside the declared model."""
    same, basis = np.zeros(len(problem.candidates), np.bool_), orthonormal(problem.model)
    for raw, sensor in zip(problem.raw, problem.sensors, strict=True):
        mine = [k for k, one in enumerate(problem.candidates) if one.sensor == sensor]
        own = raw[:, [j, *mine]]
        own = own - basis @ (basis.T @ own)
        lengths = np.linalg.norm(own, axis=0)
        same[mine] = np.abs(own[:, 0] @ own[:, 1:]) > (1.0 - SAME**2 / 2) * lengths[0] * lengths[1:]
    return np.flatnonzero(same)
