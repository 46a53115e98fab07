"""Weights of readings by the noise estimated with the effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.trace.chance import ALPHA, COUNTED
from rig.fitter.trace.growing_noise import Noise, noise_of
from rig.procedures.pressure.trace.problem import Problem

REWEIGHTED = 3
"""Number of iterations between weights and noise."""


def stands_out(noise: Noise, tests: int) -> bool:
    """Whether noise grows, for one of this number of tested transducers."""
    return noise.per_unit > 0.0 and noise.p * tests / COUNTED <= ALPHA


def weighted(
    problem: Problem, chosen: tuple[int, ...], noise: tuple[Noise, ...], grows: Sequence[bool]
) -> tuple[Problem, tuple[Noise, ...]]:
    """The problem with readings weighted if noise grows, and the noise from residuals with these weights.

    With equal weights the noise of high pressures affects the residuals of low ones.
    """
    if not any(grows):
        return problem, noise
    for _ in range(REWEIGHTED):
        problem = replace(problem, weight=weights_of(noise, grows, problem.pressure_psia))
        again = noises(problem, chosen)
        noise = tuple(replace(new, p=old.p) for new, old in zip(again, noise, strict=True))
    return problem, noise


def weights_of(noise: Sequence[Noise], grows: Sequence[bool], pressure_psia: FloatArray) -> FloatArray:
    """(S, n) weights of readings, mean one; all one if noise does not grow or is unknown."""
    weight = np.ones((len(grows), pressure_psia.size))
    for i, one in enumerate(noise):
        if grows[i]:
            weight[i] = one.sd(pressure_psia) ** -2.0
    return np.asarray(weight / weight.mean(axis=1, keepdims=True))


def noises(problem: Problem, chosen: tuple[int, ...]) -> tuple[Noise, ...]:
    """Dependence of each transducer's scatter within whole plots on pressure, with the `chosen` candidates.

    It is on the pressure, or on its distance from the middle of the range, whichever is clearer.
    """
    pressure_psia = problem.pressure_psia
    middle = float(pressure_psia.min() + pressure_psia.max()) / 2.0
    found = []
    for i in range(len(problem.sensors)):
        left = problem.left_within(chosen, i)
        both = [noise_of(*left, pressure_psia, about) for about in (None, middle)]
        grows = [one for one in both if one.per_unit > 0.0] or both
        clearer = min(grows, key=lambda one: one.p)
        found.append(replace(clearer, p=min(len(both) * clearer.p, 1.0)))
    return tuple(found)
