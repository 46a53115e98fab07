"""Pitch-roll runs as one problem: the declared model again for every mounting, drift between replications."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.confirm import Together
from rig.fitter.confirm.runs import Later, changes, join_all, numbers
from rig.fitter.confirm.together import Candidates, Own
from rig.fitter.effects.manual_changes import Done
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.effects import Scene
from rig.procedures.attitude.model import attitude_columns
from rig.procedures.attitude.temperature import Temperature
from rig.procedures.attitude.trace import SensorTrace, Trace
from rig.procedures.attitude.trace.places import places_of
from rig.procedures.attitude.trace.problem import raw_columns


@dataclass(frozen=True, eq=False)
class SensorNoise:
    """Scatter of readings and replications of one sensor, with the effects found.

    Attributes:
        sigma_V: standard deviation of one reading.
        df: its degrees of freedom.
        spread: (k,) variance of a replication's own parameters, each over `sigma_V`^2; zero without drift.
        temperature: temperature terms of the declared model; None without.
    """

    sigma_V: float
    df: int
    spread: FloatArray
    temperature: Temperature | None

    @classmethod
    def of(cls, sensor: SensorTrace, data: AttitudeData, kept: IntArray) -> SensorNoise:
        """From the traced run, without outliers.

        The variance of a replication's own parameters is their scatter beyond that of readings. It is known with a few
        degrees of freedom only; zero for a single replication.
        """
        table = sensor.after
        known = np.isfinite(table.sigma_pr)
        sigma = table.sigma_pr if known else table.sigma_E
        df = (table.n_replications - 1) * (table.n_points - len(sensor.fit.names)) if known else sensor.fit.df
        h = attitude_columns(data.pitch_deg, data.roll_deg, roll=data.has_roll)[kept]
        rest, replicate = sensor.residual_after_V[kept], data.replicate_index[kept]
        own, spread = [], []
        for index in np.unique(replicate):
            rows = h[replicate == index]
            if rows.shape[0] > rows.shape[1]:
                inverse = np.linalg.pinv(rows)
                own.append(inverse @ rest[replicate == index])
                spread.append(np.sum(inverse**2, axis=1))
        beyond = np.zeros(h.shape[1])
        if len(own) > 1:
            beyond = np.maximum(np.var(np.array(own), axis=0, ddof=1) / sigma**2 - np.mean(spread, axis=0), 0.0)
        return cls(float(sigma), max(int(df), 1), beyond, sensor.temperature)


@dataclass(frozen=True, eq=False)
class AttitudeTogether(Together):
    """Two or more runs of the package, with the references of the first trace.

    Attributes:
        scene: of all observations; its references are those of the first run's trace.
        noise: by sensor.
        part: (n,) number of the part of an observation; the declared model has parameters of its own in each: in every
            run since the package was mounted again or touched, and after every change that touches it.
        unknown: (n,) observations of later runs whose parameters the first run does not determine: those in such parts,
            and a run with roll after one without.
    """

    scene: Scene
    noise: Mapping[str, SensorNoise]
    part: IntArray
    unknown: NDArray[np.bool_]

    @classmethod
    def of(cls, found: Trace, first: AttitudeData, later: Sequence[Later]) -> Self:
        """A run, its trace, and later runs.

        Raises:
            FitError: a later run lacks a sensor of the first.
        """
        kept = np.setdiff1d(np.arange(len(first)), found.outliers)
        mine = first.take(kept)
        every = join_all(mine, later)
        mounting = np.concatenate([mountings(mine), *(mountings(one.data) for one in later)])
        every = replace(every, mounting=mounting, axes=first.axes)
        noise = {name: SensorNoise.of(sensor, first, kept) for name, sensor in found.sensors.items()}
        scene = replace(found.scene, data=every, roll=every.has_roll)
        run, done = numbers(kept.size, later), changes(kept.size, later)
        part = _parts(run, mounting, done)
        roll = np.array([one.data.has_roll and not mine.has_roll for one in later], np.bool_)
        return cls(run, scene, noise, part, (part > 0) | np.concatenate([[False], roll])[run], done=done)

    @property
    def data(self) -> AttitudeData:
        """Observations of both runs."""
        return self.scene.data

    @property
    def df(self) -> int:
        """Degrees of freedom of the error's estimate."""
        return min(noise.df for noise in self.noise.values())

    @property
    def realigned(self) -> bool:
        """Whether the package was mounted again or touched, or only a later run has roll."""
        return bool(np.any(self.unknown))

    @property
    def predicted(self) -> NDArray[np.bool_]:
        """(n,) observations of later runs with the parameters of the first one."""
        return self.fresh & ~self.unknown

    @property
    def own_response(self) -> bool:
        """True: offset and sensitivity drift from run to run."""
        return True

    @property
    def loose(self) -> FloatArray:
        """(n, 0) or, if the package was mounted again or touched, (n, 4) its offset and axes, each time again."""
        rows = [self.unknown & (self.part == k) for k in np.unique(self.part[self.unknown])]
        return np.column_stack([np.empty((len(self.data), 0)), *(np.where(own[:, None], self._h, 0.0) for own in rows)])

    @property
    def sigma(self) -> FloatArray:
        """(S, n) V."""
        return np.stack([np.full(len(self.data), self.noise[s].sigma_V) for s in self.sensors])

    @property
    def slope(self) -> FloatArray:
        """(S,) V/g; for a sensor that the first run, without roll, hardly determines, by the later one."""
        out = []
        for name, volts in zip(self.sensors, self.raw_outputs, strict=True):
            later = np.linalg.lstsq(self._h[self.fresh], volts[self.fresh], rcond=1e-6)[0][1:]
            out.append(max(float(np.linalg.norm(self.scene.axes[name])), float(np.linalg.norm(later))))
        return np.array(out)

    @cached_property
    def declared(self) -> tuple[FloatArray, ...]:
        """(n, d) columns of the declared model for each sensor, again for every part."""
        h = self._h
        columns = np.column_stack([np.where((self.part == k)[:, None], h, 0.0) for k in np.unique(self.part)])
        out = []
        for sensor in self.sensors:
            warm = self.noise[sensor].temperature
            beside = [] if warm is None else [warm.columns(_narrow(h, warm.direction.size + 1), self.data)]
            out.append(np.column_stack([columns, *beside]))
        return tuple(out)

    @cached_property
    def own(self) -> tuple[tuple[Own, ...], ...]:
        """Own parameters of each replication for each sensor, if replications drift."""
        replications = [np.flatnonzero(self.data.replicate_index == k) for k in range(self.data.replicates.size)]
        out = []
        for sensor in self.sensors:
            spread = self.noise[sensor].spread
            columns = _narrow(self._h, spread.size) * np.sqrt(spread)
            out.append(tuple(Own.of(rows, columns[rows]) for rows in replications) if spread.any() else ())
        return tuple(out)

    def untouched(self, terms: Candidates) -> FloatArray:
        """(S, n, q) V per unit coefficient."""
        return raw_columns(self.scene, terms)

    def shapes(self, *, lasting: bool) -> Iterator[tuple[str, FloatArray]]:
        """(S, n, m) smooth unweighted columns over what was recorded in the later run, each place after its name. The
        places where a trace looks for shapes without a name.
        """
        count, n = len(self.sensors), len(self.data)
        for place in places_of(self.scene):
            if lasting and place.level != "replications":
                continue
            columns = place.columns()
            raw = np.zeros((count, n, columns.shape[1]))
            if place.sensor is None:
                raw[:] = columns.reshape(raw.shape)
            else:
                raw[place.sensor] = columns
            yield place.text, raw * self.fresh[:, None]

    def only(self, rows: NDArray[np.bool_]) -> Self:
        """These runs with some of the observations only."""
        done = tuple(one.at(rows) for one in self.done)
        scene = self.scene.on(self.data.take(np.flatnonzero(rows)))
        run, part, unknown = self.run[rows], self.part[rows], self.unknown[rows]
        return replace(self, scene=scene, run=run, part=part, unknown=unknown, done=done)

    @cached_property
    def _h(self) -> FloatArray:
        return attitude_columns(self.data.pitch_deg, self.data.roll_deg, roll=self.scene.roll)


def _parts(run: IntArray, mounting: FloatArray, done: Sequence[Done]) -> IntArray:
    """(n,) see `AttitudeTogether.part`; what is mounted again never stands exactly as before."""
    part = np.zeros(run.size, np.int64)
    for k in range(1, int(run.max()) + 1):
        rows = np.flatnonzero(run == k)
        after = [one.after[rows] for one in done if one.anew and one.after[rows].any()]
        turned = np.any(~np.isclose(mounting[rows], mounting[0], atol=1e-9), axis=(1, 2))
        if part.any() or after or turned.any():
            orientations = np.cumsum(np.any(np.diff(mounting[rows], axis=0, prepend=mounting[rows[:1]]), axis=(1, 2)))
            part[rows] = part.max() + 1 + orientations + np.sum(after, axis=0, dtype=np.int64)
    return part


def mountings(data: AttitudeData) -> FloatArray:
    """(n, 3, 3) from table to package, with the usual mounting as identity."""
    return np.broadcast_to(np.eye(3), (len(data), 3, 3)) if data.mounting is None else data.mounting


def _narrow(h: FloatArray, width: int) -> FloatArray:
    """(n, width) rows `h` for a model fitted without roll, if the later run has roll."""
    return h if h.shape[1] == width else h[:, [0, 1, 3]]
