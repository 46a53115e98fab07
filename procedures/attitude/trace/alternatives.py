"""What every other member of an effect's class would add to the observations, if it were the cause."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fitter.arrays import FloatArray
from fitter.trace.aliases import Rival
from procedures.attitude.data import AttitudeData
from procedures.attitude.trace.estimate import Estimate
from procedures.attitude.trace.problem import Problem, raw_columns
from procedures.attitude.trace.score import errors

Volts = Mapping[str, Mapping[str, FloatArray]]
"""(n, q) V that the terms of effects add to the observations, by effect and sensor."""


@dataclass(frozen=True, eq=False)
class Alternative:
    """The effects of a run with another member of a class in the place of the one that was named.

    Attributes:
        named: the effect whose class it is.
        member: what stands in its place.
        effects: all effects then.

    """

    named: str
    member: str
    effects: Volts


def alternatives(
    problem: Problem, after: Estimate, classes: Mapping[str, Sequence[Rival]], data: AttitudeData
) -> tuple[Alternative, ...]:
    """One for every member of every class that was not named, the others as they were named.

    Args:
        problem: the run, without outliers.
        after: what was found.
        classes: all explanations of each effect found, by its name.
        data: the observations to tell volts of.

    """
    out = []
    for name, explanations in classes.items():
        rest = tuple(j for j in after.chosen if problem.candidates[j].effect.name != name)
        for rival in explanations:
            if rival.alias and rival.effect != name:
                chosen = (*rest, *rival.terms)
                gamma = _coefficients(problem, chosen, after)
                out.append(Alternative(name, rival.effect, volts(problem, chosen, gamma, data)))
    return tuple(out)


def _coefficients(problem: Problem, chosen: tuple[int, ...], after: Estimate) -> FloatArray:
    """(q,) of candidates fitted together; the shortest where some of them are alike, which moves no sum of them."""
    sigma = errors(problem, after.chosen)[:, None]
    columns = (problem.columns_at(after.level, chosen) / sigma[:, :, None]).reshape(-1, len(chosen))
    length = np.linalg.norm(columns, axis=0)
    length = np.where(length > 0, length, 1.0)
    outputs = (problem.outputs_at(after.level) / sigma).reshape(-1)
    return np.asarray(np.linalg.lstsq(columns / length, outputs, rcond=1e-8)[0] / length)


def volts(problem: Problem, chosen: tuple[int, ...], gamma: FloatArray, data: AttitudeData) -> Volts:
    """(n, p) what the terms of each effect, of these coefficients (q,), add to each sensor's output."""
    raw = raw_columns(problem.scene.on(data), [problem.candidates[j] for j in chosen])
    out: dict[str, dict[str, FloatArray]] = {}
    for name in dict.fromkeys(problem.candidates[j].effect.name for j in chosen):
        own = [k for k, j in enumerate(chosen) if problem.candidates[j].effect.name == name]
        added = {s: raw[i][:, own] * gamma[own] for i, s in enumerate(problem.sensors)}
        out[name] = {s: v for s, v in added.items() if np.any(v)}
    return out
