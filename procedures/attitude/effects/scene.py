"""Observations of a package on a dividing head, with the reference values for columns of effects."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.procedures.attitude.data import AttitudeData


@dataclass(frozen=True, eq=False)
class Scene:
    """Observations, and the values from which their columns are computed.

    Attributes:
        data: the observations.
        axes: (3,) sensitive axis times sensitivity of each sensor, V/g in package axes, from the declared model.
        offsets: offset of each sensor, V, from the declared model.
        nominal: nominal axis of each sensor, 0, 1, 2.
        roll: whether the declared model has roll; without it the package's axes are those at zero roll.
        temperature_degC: reference temperature; temperature effects are zero there. None if not recorded.
        elapsed_s: reference time; drifts are zero there.
    """

    data: AttitudeData
    axes: Mapping[str, FloatArray]
    offsets: Mapping[str, float]
    nominal: Mapping[str, int]
    roll: bool
    temperature_degC: float | None
    elapsed_s: float

    def on(self, data: AttitudeData) -> Scene:
        """A scene of other observations, with the references of this one."""
        return replace(self, data=data)

    @cached_property
    def pitch(self) -> FloatArray:
        """(n,) pitch, rad."""
        return np.asarray(np.radians(self.data.pitch_deg))

    @cached_property
    def rolled(self) -> FloatArray:
        """(n,) roll, rad; zero if the model has none."""
        return np.asarray(np.radians(self.data.roll_deg)) if self.roll else np.zeros(len(self.data))

    @cached_property
    def g(self) -> FloatArray:
        """(n, 3) gravity in package axes."""
        return self.mounted(_gravity(self.pitch, self.rolled))

    def mounted(self, vectors: FloatArray) -> FloatArray:
        """(n, 3) in package axes from (n, 3) in axes of the head's table."""
        turned = self.data.turned if not self.roll else self.data.mounting
        return vectors if turned is None else np.asarray(np.einsum("nij,nj->ni", turned, vectors))

    @cached_property
    def g_before(self) -> FloatArray:
        """(n, 3) gravity in package axes at the previous observation in executed order."""
        before = np.radians(self.data.previous_roll_deg) if self.roll else np.zeros(len(self.data))
        return self.mounted(_gravity(np.radians(self.data.previous_pitch_deg), before))

    @cached_property
    def g_per_pitch(self) -> FloatArray:
        """(n, 3) derivative of `g` with respect to pitch, 1/rad."""
        a, r = self.pitch, self.rolled
        return self.mounted(np.column_stack([np.cos(a), np.sin(r) * np.sin(a), np.cos(r) * np.sin(a)]))

    @cached_property
    def g_per_roll(self) -> FloatArray:
        """(n, 3) derivative of `g` with respect to roll, 1/rad."""
        a, r = self.pitch, self.rolled
        return self.mounted(np.column_stack([np.zeros_like(a), -np.cos(r) * np.cos(a), np.sin(r) * np.cos(a)]))

    @cached_property
    def sideways(self) -> FloatArray:
        """(n, 3) direction of the pitch axis in package axes."""
        r = self.rolled
        return self.mounted(np.column_stack([np.zeros_like(r), np.cos(r), -np.sin(r)]))

    @cached_property
    def g_ahead(self) -> FloatArray:
        """(n, 3) level direction across the pitch axis in package axes."""
        return np.asarray(np.cross(self.g, self.sideways))

    def along(self, sensor: str) -> FloatArray:
        """(n,) gravity along the sensitive axis, in g."""
        m = self.axes[sensor]
        return np.asarray(self.g @ (m / np.linalg.norm(m)))

    def volts(self, sensor: str) -> FloatArray:
        """(n,) output by the declared model, V."""
        return self.kept(("volts", sensor), lambda: np.asarray(self.offsets[sensor] + self.g @ self.axes[sensor]))

    def per_pitch(self, sensor: str) -> FloatArray:
        """(n,) output per degree of pitch, V/deg."""
        return self.kept(("pitch", sensor), lambda: np.asarray(self.g_per_pitch @ np.radians(self.axes[sensor])))

    def per_roll(self, sensor: str) -> FloatArray:
        """(n,) output per degree of roll, V/deg."""
        return self.kept(("roll", sensor), lambda: np.asarray(self.g_per_roll @ np.radians(self.axes[sensor])))

    def turned_about(self, sensor: str) -> FloatArray:
        """(3, n) output per radian by which gravity turns about each axis of the package, V."""
        return self.kept(("turned", sensor), lambda: np.ascontiguousarray(np.cross(self.g, self.axes[sensor]).T))

    def crossed(self, axis: int) -> FloatArray:
        """(n, 3) change of gravity, in package axes, for a turn of one radian about one of these axes."""
        return self.kept(("crossed", axis), lambda: np.asarray(np.cross(np.eye(3)[axis], self.g)))

    def kept(self, name: Hashable, compute: Callable[[], FloatArray]) -> FloatArray:
        """What several columns have in common, computed once."""
        if name not in self._known:
            self._known[name] = compute()
        return self._known[name]

    def forget(self) -> None:
        """Drop what was computed once; it is computed again if it is asked for."""
        for known in (self._known, self._turns, self.lagged):
            known.clear()

    @cached_property
    def lagged(self) -> dict[float, FloatArray]:
        """Cache of computed lagged temperatures, by time constant."""
        return {}

    def turns(self, angle: str, k: float) -> tuple[FloatArray, FloatArray]:
        """Sine and cosine (n,) of k periods per turn in "pitch" or "roll", computed once for all sensors."""
        if (angle, k) not in self._turns:
            turned = k * (self.pitch if angle == "pitch" else self.rolled)
            self._turns[angle, k] = np.sin(turned), np.cos(turned)
        return self._turns[angle, k]

    @cached_property
    def _turns(self) -> dict[tuple[str, float], tuple[FloatArray, FloatArray]]:
        return {}

    @cached_property
    def _known(self) -> dict[Hashable, FloatArray]:
        return {}

    def warmth(self) -> FloatArray:
        """(n,) sensor temperature above the reference, degC.

        Raises:
            FitError: the sensor's temperature was not recorded, here or in the run of the reference.

        """
        if self.data.sensor_temperature_degC is None or self.temperature_degC is None:
            raise FitError("an effect of temperature cannot be computed: no sensor temperature was recorded")
        return self.data.sensor_temperature_degC - self.temperature_degC

    def hours(self) -> FloatArray:
        """(n,) time since the reference, h."""
        return (self.data.elapsed_s - self.elapsed_s) / 3600.0


def _gravity(a: FloatArray, r: FloatArray) -> FloatArray:
    return np.column_stack([np.sin(a), -np.sin(r) * np.cos(a), -np.cos(r) * np.cos(a)])
