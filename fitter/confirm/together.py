"""Two runs as one problem: the declared model anew for every mounting, replications with errors of their own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from fitter.arrays import FloatArray
from fitter.attitude import attitude_columns
from fitter.confirm.question import Noise
from fitter.data import AttitudeData
from fitter.effects import Scene
from fitter.linear import orthonormal
from fitter.trace.aliases import NOTHING_LEFT
from fitter.trace.problem import Candidate, raw_columns

_ADDED = {"replicate": 1, "order": 1, "block": 1}


def join(first: AttitudeData, later: AttitudeData, after_s: float) -> AttitudeData:
    """The observations of both runs, those of the first in front.

    Args:
        first: the run that was traced.
        later: the one made to confirm it; with the same sensors.
        after_s: how long after the first run's zero of elapsed time the later one's is.

    Raises:
        ValueError: the later run lacks a sensor of the first.

    """
    missing = [name for name in first.sensors if name not in later.outputs]
    if missing:
        raise ValueError(f"the run to confirm by has no {missing[0]}, which the run that was traced has")
    given: dict[str, Any] = {}
    for name in (f.name for f in fields(AttitudeData) if f.init and f.name not in ("outputs", "axes", "mounting")):
        a, b = getattr(first, name), getattr(later, name)
        if name in _ADDED:
            b = b - b.min() + a.max() + _ADDED[name]
        elif name == "elapsed_s":
            b = b + after_s
        given[name] = None if a is None or b is None else np.concatenate([a, b])
    given["outputs"] = {name: np.concatenate([v, later.outputs[name]]) for name, v in first.outputs.items()}
    given["mounting"] = np.concatenate([mountings(run) for run in (first, later)])
    return AttitudeData(axes=first.axes, **given)


def mountings(data: AttitudeData) -> FloatArray:
    """(n, 3, 3) from table to package, the usual mounting written out."""
    return np.broadcast_to(np.eye(3), (len(data), 3, 3)) if data.mounting is None else data.mounting


@dataclass(frozen=True, eq=False)
class Together:
    """A first run and what came later, with all that a comparison of explanations needs.

    Attributes:
        scene: of all observations; its references are those of the first run's trace.
        noise: by sensor.
        fresh: (n,) whether an observation is of the later run.

    """

    scene: Scene
    noise: Mapping[str, Noise]
    fresh: NDArray[np.bool_]

    @classmethod
    def of(
        cls, first: AttitudeData, scene: Scene, noise: Mapping[str, Noise], later: AttitudeData, after_s: float
    ) -> Self:
        """A run (rows that were fitted), the references and noise of its trace, and a later run (see `join`)."""
        both = join(first, later, after_s)
        fresh = np.arange(len(both)) >= len(first)
        return cls(replace(scene, data=both, roll=both.has_roll), noise, fresh)

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return self.scene.data.sensors

    @cached_property
    def declared(self) -> tuple[FloatArray, ...]:
        """For each sensor, (n, d) the declared model: anew for every mounting, since a package sits as it sits."""
        data = self.scene.data
        h = attitude_columns(data.pitch_deg, data.roll_deg, roll=self.scene.roll)
        turned = np.unique(np.round(mountings(data).reshape(len(data), 9), 9), axis=0, return_inverse=True)[1]
        own = [np.where((np.ravel(turned) == k)[:, None], h, 0.0) for k in range(int(turned.max()) + 1)]
        columns = np.column_stack(own)
        out = []
        for sensor in self.sensors:
            warm = self.noise[sensor].temperature
            beside = [] if warm is None else [warm.columns(_narrow(h, warm.direction.size + 1), data)]
            out.append(np.column_stack([columns, *beside]))
        return tuple(out)

    def stacked(self, columns: FloatArray) -> FloatArray:
        """(S n, q) weighed, the declared model taken out: columns (S, n, q) of all sensors under one another."""
        return np.concatenate([self._left(i, own) for i, own in enumerate(columns)])

    @cached_property
    def outputs(self) -> FloatArray:
        """(S n,) the outputs so."""
        data = self.scene.data
        return self.stacked(np.stack([data.outputs[s] for s in self.sensors])[:, :, None])[:, 0]

    def columns_of(self, terms: Sequence[Candidate]) -> FloatArray:
        """(S n, q) the columns of effects so; zero where next to nothing is left of one."""
        raw = raw_columns(self.scene, terms)
        left = self.stacked(raw)
        whole = np.sqrt(sum(np.sum((self.weigh(i, own)) ** 2, axis=0) for i, own in enumerate(raw)))
        return np.where(np.linalg.norm(left, axis=0) > NOTHING_LEFT * whole, left, 0.0)

    def columns_in(self, terms: Sequence[Candidate], where: NDArray[np.bool_]) -> FloatArray:
        """(S n, q) the columns of effects as they are in some of the observations, zero in the others."""
        return self.stacked(raw_columns(self.scene, terms) * where[:, None])

    @property
    def shifts(self) -> FloatArray:
        """(S n, S) an offset of its own for the later run, of each sensor."""
        fresh = np.einsum("n,ij->inj", self.fresh.astype(np.float64), np.eye(len(self.sensors)))
        return self.stacked(fresh)

    def only(self, rows: NDArray[np.bool_]) -> Together:
        """The same with some of the observations."""
        return replace(self, scene=self.scene.on(self.scene.data.take(np.flatnonzero(rows))), fresh=self.fresh[rows])

    def weigh(self, i: int, columns: FloatArray) -> FloatArray:
        """(n, q) columns of sensor `i` in units of its error, what replications have of their own weighed down."""
        noise = self.noise[self.sensors[i]]
        weighed = columns / noise.sigma_V
        for rows, basis, kept in self._own[i]:
            part = weighed[rows]
            weighed[rows] = part - basis @ ((1.0 - kept)[:, None] * (basis.T @ part))
        return np.asarray(weighed)

    def _left(self, i: int, columns: FloatArray) -> FloatArray:
        weighed, basis = self.weigh(i, columns), self._bases[i]
        return np.asarray(weighed - basis @ (basis.T @ weighed))

    @cached_property
    def _bases(self) -> tuple[FloatArray, ...]:
        return tuple(orthonormal(self.weigh(i, own)) for i, own in enumerate(self.declared))

    @cached_property
    def _own(self) -> tuple[list[tuple[NDArray[np.int64], FloatArray, FloatArray]], ...]:
        """For each sensor and replication: its rows, directions of its own parameters, and what is kept of them."""
        data = self.scene.data
        h = attitude_columns(data.pitch_deg, data.roll_deg, roll=self.scene.roll)
        out = []
        for sensor in self.sensors:
            spread, parts = self.noise[sensor].spread, []
            if spread.any():
                own = _narrow(h, spread.size)
                for index in range(data.replicates.size):
                    rows = np.flatnonzero(data.replicate_index == index)
                    u, s, _ = np.linalg.svd(own[rows] * np.sqrt(spread), full_matrices=False)
                    parts.append((rows, u, 1.0 / np.sqrt(1.0 + s**2)))
            out.append(parts)
        return tuple(out)


def _narrow(h: FloatArray, width: int) -> FloatArray:
    """(n, width) rows `h` for what was fitted without roll, where the later run has some."""
    return h if h.shape[1] == width else h[:, [0, 1, 3]]
