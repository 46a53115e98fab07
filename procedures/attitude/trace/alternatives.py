"""Contribution of every other member of an effect's class to the observations, if it were the cause."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.trace.aliases import Rival
from rig.procedures.attitude.trace.estimate import Estimate, coefficients
from rig.procedures.attitude.trace.problem import Problem, raw_columns

Volts = Mapping[str, Mapping[str, FloatArray]]
"""(n, q) contribution of the terms of effects to the observations, V, by effect and sensor."""


@dataclass(frozen=True, eq=False)
class Alternative:
    """The effects of a run with another member of a class in place of the named one.

    Attributes:
        named: the named effect of the class.
        member: its replacement.
        effects: all effects with the replacement.
    """

    named: str
    member: str
    effects: Volts


def alternatives(problem: Problem, after: Estimate, classes: Mapping[str, Sequence[Rival]]) -> tuple[Alternative, ...]:
    """One for every unnamed member of every class, with the other effects as named.

    Args:
        problem: the run.
        after: the findings.
        classes: all explanations of each effect found, by its name.
    """
    out = []
    for name, explanations in classes.items():
        rest = tuple(j for j in after.chosen if problem.candidates[j].effect.name != name)
        for rival in explanations:
            if rival.alias and rival.effect != name:
                chosen = (*rest, *rival.terms)
                gamma = coefficients(problem, chosen).value
                out.append(Alternative(name, rival.effect, volts(problem, chosen, gamma)))
    return tuple(out)


def volts(problem: Problem, chosen: tuple[int, ...], gamma: FloatArray) -> Volts:
    """(n, p) contribution of the terms of each effect, with these coefficients (q,), to each sensor's output."""
    raw = raw_columns(problem.scene, [problem.candidates[j] for j in chosen])
    out: dict[str, dict[str, FloatArray]] = {}
    for name in dict.fromkeys(problem.candidates[j].effect.name for j in chosen):
        own = [k for k, j in enumerate(chosen) if problem.candidates[j].effect.name == name]
        added = {s: raw[i][:, own] * gamma[own] for i, s in enumerate(problem.sensors)}
        out[name] = {s: v for s, v in added.items() if np.any(v)}
    return out
