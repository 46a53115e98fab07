"""What is left of a run over smooth shapes without a name, and whether each name found is better than they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import special

from fitter.arrays import FloatArray
from fitter.linear import orthonormal
from fitter.trace.flexible import Remainder, evidence, remainders, tried
from fitter.trace.search import names_of
from procedures.attitude.trace.levels import LEVELS, Level
from procedures.attitude.trace.places import Place, places_of
from procedures.attitude.trace.problem import Problem
from procedures.attitude.trace.score import errors, rounding
from procedures.attitude.trace.walks import SPREAD, likelihood_ratio

WALKED = 0.05
"""What is less clear than this is not held against a random walk too."""


@dataclass(frozen=True, eq=False)
class Left:
    """What a residual still follows.

    Attributes:
        place: where.
        remainder: how clearly.
        p: over all places, orders and sensors.

    """

    place: Place
    remainder: Remainder
    p: float


@dataclass(frozen=True, eq=False)
class Nameless:
    """A run beside what was found in it.

    Attributes:
        problem: the run.
        chosen: candidates in the model.

    """

    problem: Problem
    chosen: tuple[int, ...]

    @cached_property
    def places(self) -> tuple[Place, ...]:
        return places_of(self.problem.scene)

    @cached_property
    def sigma(self) -> FloatArray:
        return errors(self.problem, self.chosen)

    @cached_property
    def able(self) -> bool:
        return bool(np.all(self.sigma > 10 * rounding(self.problem)))

    def left(self) -> list[Left]:
        """Places that the residual follows, the clearest first."""
        if not self.able:
            return []
        count = tried(place.block for place in self.places)
        found = []
        views = {level: _View(self.problem, level, self.chosen, self.sigma) for level in LEVELS[1:]}
        rho = _memory(self.problem, views["points"].outputs)
        for place in self.places:
            view, n = views[place.level], len(self.problem.scene.data)
            at = slice(None) if place.sensor is None else slice(place.sensor * n, (place.sensor + 1) * n)
            y = view.outputs.reshape(-1)[at]
            rows = y.size // n
            df = rows * self.problem.levels.df(place.level) - len(self.chosen)
            if df < 3:
                continue
            white = view.white(y, place.sensor, rho)
            for one in remainders(
                white, df, [place.block], lambda c, place=place, view=view: view.white(view.project(c, place.sensor), place.sensor, rho)
            ):
                p = one.p
                if p * count < WALKED:
                    p = max(p, self._against_a_walk(place, y, one.basis))
                found.append(Left(place, one, min(p * count, 1.0)))
        return sorted(found, key=lambda one: one.p)

    def earned(self, name: str) -> tuple[float, float, str]:
        """Evidence for an effect found, in nats; the best evidence for a shape without a name; and where that lives."""
        problem = self.problem
        mine = [j for j in self.chosen if problem.candidates[j].effect.name == name]
        rest = tuple(j for j in self.chosen if j not in mine)
        level = problem.judged_at[mine[0]]
        view = _View(problem, level, rest, self.sigma)
        own = view.of(mine)
        y = view.outputs.reshape(-1)
        effect = problem.candidates[mine[0]].effect
        units = len({problem.unit_of[j] for j, c in enumerate(problem.candidates) if c.effect.name == name and c.sensor == problem.candidates[mine[0]].sensor})
        named = evidence(y, own) - np.log(CATALOGUE_SIZE) - (np.log(units) if effect.searched else 0.0)
        n, best, where = len(problem.scene.data), -np.inf, ""
        sensors = [i for i in range(len(problem.sensors)) if np.any(own.reshape(len(problem.sensors), n, -1)[i] != 0)]
        by_name: dict[tuple[str, Level], dict[int | None, Place]] = {}
        for place in self.places:
            if place.level == level:
                by_name.setdefault((place.block.place, level), {})[place.sensor] = place
        for (text, _), of in by_name.items():
            total = 0.0
            for i, place in of.items():
                if i is not None and i not in sensors:
                    continue
                at = slice(None) if i is None else slice(i * n, (i + 1) * n)
                total += evidence(y[at], view.project(place.block.columns, i), place.block.roughness)
            total -= np.log(len(by_name))
            if total > best:
                best, where = total, text
        return float(named), float(best), where

    def _against_a_walk(self, place: Place, y: FloatArray, columns: FloatArray) -> float:
        """P by chance of columns beside a random walk of the offset that is as wide as makes the residual likeliest."""
        n = len(self.problem.scene.data)
        ys = list(y.reshape(-1, n))
        xs = list(columns.reshape(len(ys), n, -1))
        spread = SPREAD if place.level == "points" else 1.0
        ratio = likelihood_ratio(self.problem.levels.walks(place.level), ys, xs, spread)
        return float(special.chdtrc(columns.shape[1], max(ratio, 0.0)))


CATALOGUE_SIZE = 40.0


class _View:
    """What a level leaves of outputs and columns over the sensors' errors, beside some candidates."""

    def __init__(self, problem: Problem, level: Level, rest: Sequence[int], sigma: FloatArray) -> None:
        self.problem, self.level, self.sigma = problem, level, sigma
        picked = list(rest)
        taken = problem.columns_at(level, picked) / sigma[:, None, None]
        length = np.linalg.norm(problem.length[:, picked] / sigma[:, None], axis=0)
        self.basis = orthonormal(taken.reshape(taken.shape[0] * taken.shape[1], len(picked)), length, 1e-4)
        y = (problem.outputs_at(level) / sigma[:, None]).reshape(-1)
        self.outputs = (y - self.basis @ (self.basis.T @ y)).reshape(len(sigma), -1)

    def of(self, picked: Sequence[int]) -> FloatArray:
        columns = self.problem.columns_at(self.level, list(picked)) / self.sigma[:, None, None]
        flat = columns.reshape(columns.shape[0] * columns.shape[1], len(picked))
        return np.asarray(flat - self.basis @ (self.basis.T @ flat))

    def project(self, columns: FloatArray, sensor: int | None) -> FloatArray:
        """What is left of (n, m) of one sensor, or (S n, m) of all."""
        n = len(self.problem.scene.data)
        if sensor is not None:
            left = self.problem.left(sensor, columns, self.level) / self.sigma[sensor]
            basis = self.basis[sensor * n : (sensor + 1) * n]
            if basis.shape[1]:
                basis = orthonormal(basis, None, 1e-4)
                left = left - basis @ (basis.T @ left)
            return np.asarray(left)
        parts = [
            self.problem.left(i, columns[i * n : (i + 1) * n], self.level) / self.sigma[i]
            for i in range(len(self.sigma))
        ]
        left = np.concatenate(parts)
        return np.asarray(left - self.basis @ (self.basis.T @ left))

    def white(self, columns: FloatArray, sensor: int | None, rho: FloatArray) -> FloatArray:
        """The same less what the row before predicts."""
        own = rho if sensor is None else rho[sensor : sensor + 1]
        if not np.any(own):
            return columns
        n = len(self.problem.scene.data)
        rows, replicate = self.problem.levels.executed, self.problem.levels.replicate
        first = np.concatenate([[True], np.diff(replicate[rows]) != 0])
        flat = columns.reshape(own.size, n, -1)
        out = np.empty_like(flat)
        for k, r in enumerate(own):
            ordered = flat[k][rows]
            before = np.concatenate([ordered[:1], ordered[:-1]])
            out[k][rows] = np.where(first[:, None], ordered * np.sqrt(1 - r**2), ordered - r * before)
        return out.reshape(columns.shape)


def _memory(problem: Problem, left: FloatArray) -> FloatArray:
    """(S,) correlation of neighbouring rows where it is clear, else zero."""
    rows, replicate = problem.levels.executed, problem.levels.replicate
    same = np.diff(replicate[rows]) == 0
    out = np.zeros(len(left))
    for i, one in enumerate(left):
        e = one[rows]
        square = float(e @ e)
        if square <= 0 or same.sum() < 16:
            continue
        r = float(np.sum(e[1:][same] * e[:-1][same])) / square
        if r * np.sqrt(same.sum()) > 3.0:
            out[i] = min(r, 0.95)
    return out


def report(problem: Problem, chosen: tuple[int, ...]) -> list[str]:
    one = Nameless(problem, chosen)
    lines = []
    for left in one.left()[:3]:
        if left.p < 0.05:
            lines.append(f"LEFT {left.place.block.place} {left.place.sensor} p={left.p:.1e} share={left.remainder.share:.3f}")
    for name in names_of(problem.candidates, chosen):
        a, b, w = one.earned(name)
        lines.append(f"{name}: named {a:.1f} nameless {b:.1f} diff {a - b:.1f} {w}")
    return lines
