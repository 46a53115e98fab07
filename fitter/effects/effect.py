"""What an effect is: a physical cause, and the columns it would add to the model of each sensor."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np

from fitter.arrays import FloatArray
from fitter.data import AttitudeData
from fitter.effects.sizes import Size
from fitter.errors import FitError

Stratum = Literal["between-point", "point-by-replication", "replication", "whole-plot", "subplot", "noise"]

Source = Literal[
    "package",
    "pitch axis",
    "roll axis",
    "line",
    "chamber",
    "temperature",
    "time",
    "interruption",
    "sensor",
    "setting",
    "covariate",
    "group",
    "direction",
    "voltmeter",
]

Scope = Literal["package", "line", "voltmeter", "sensor"]


@dataclass(frozen=True, eq=False)
class Scene:
    """Observations, and what their columns are computed from.

    Attributes:
        data: the observations.
        axes: (3,) sensitive axis times sensitivity of each sensor, V/g in package axes, from the declared model.
        offsets: offset of each sensor, V, from the declared model.
        nominal: nominal axis of each sensor, 0, 1, 2.
        roll: whether the declared model has roll; without it the package's axes are those at zero roll.
        temperature_degC: reference temperature; temperature effects are zero there. None where none was recorded.
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
        """The same references for other observations."""
        return replace(self, data=data)

    @cached_property
    def pitch(self) -> FloatArray:
        """(n,) pitch, rad."""
        return np.asarray(np.radians(self.data.pitch_deg))

    @cached_property
    def rolled(self) -> FloatArray:
        """(n,) roll, rad; zero where the model has none."""
        return np.asarray(np.radians(self.data.roll_deg)) if self.roll else np.zeros(len(self.data))

    @cached_property
    def g(self) -> FloatArray:
        """(n, 3) gravity in package axes."""
        return self.mounted(_gravity(self.pitch, self.rolled))

    def mounted(self, vectors: FloatArray) -> FloatArray:
        """(n, 3) in package axes what is (n, 3) in axes of the head's table."""
        turned = self.data.turned if not self.roll else self.data.mounting
        return vectors if turned is None else np.asarray(np.einsum("nij,nj->ni", turned, vectors))

    @cached_property
    def g_before(self) -> FloatArray:
        """(n, 3) gravity in package axes at the observation executed before."""
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

    def along(self, sensor: str) -> FloatArray:
        """(n,) gravity along the sensitive axis, in g."""
        m = self.axes[sensor]
        return np.asarray(self.g @ (m / np.linalg.norm(m)))

    def volts(self, sensor: str) -> FloatArray:
        """(n,) output by the declared model, V."""
        return np.asarray(self.offsets[sensor] + self.g @ self.axes[sensor])

    def per_pitch(self, sensor: str) -> FloatArray:
        """(n,) output per degree of pitch, V/deg."""
        return self._slopes(sensor)[0]

    def per_roll(self, sensor: str) -> FloatArray:
        """(n,) output per degree of roll, V/deg."""
        return self._slopes(sensor)[1]

    def _slopes(self, sensor: str) -> tuple[FloatArray, FloatArray]:
        if sensor not in self._kept:
            m = np.radians(self.axes[sensor])
            self._kept[sensor] = self.g_per_pitch @ m, self.g_per_roll @ m
        return self._kept[sensor]

    @cached_property
    def lagged(self) -> dict[float, FloatArray]:
        """Lagged temperatures that were computed, by time constant."""
        return {}

    @cached_property
    def _kept(self) -> dict[str, tuple[FloatArray, FloatArray]]:
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


Column = Callable[[Scene, str], FloatArray]


@dataclass(frozen=True)
class Term:
    """One column of an effect.

    Attributes:
        name: unique within its effect.
        column: (n,) volts for a coefficient of one, for a given sensor.
        shown: for a given sensor, the term as a formula and the factor from the coefficient to that formula's, in
            the effect's unit; without it the name is the formula and the factor is one.
        group: terms of one effect with the same group are judged together, as sine and cosine of one frequency are;
            a term without one is judged by itself.
        finer: where a constant in the column is searched: groups of terms that try it about this one's value, more
            closely than the catalogue does.

    """

    name: str
    column: Column
    shown: Callable[[Scene, str], tuple[str, float]] | None = None
    group: str = ""
    finer: Callable[[AttitudeData], tuple[tuple[Term, ...], ...]] | None = None

    def as_formula(self, scene: Scene, sensor: str) -> tuple[str, float]:
        """Formula and factor for one sensor; on a turned package the name, since formulas are in angles of the head."""
        text, factor = self.shown(scene, sensor) if self.shown else (self.name, 1.0)
        return (text, factor) if scene.data.mounting is None else (self.name, factor)


@dataclass(frozen=True)
class Alias:
    """Another effect that is confounded with it.

    Attributes:
        when: on which designs, in which sensors.
        separate_by: the measurement that would tell the two apart.

    """

    when: str
    separate_by: str


@dataclass(frozen=True)
class Signed:
    """The sign that physics leaves the coefficients of an effect.

    Attributes:
        quantity: what would have to be negative: "compliance", "backlash".
        where: for each term that has one, by name, the sign of its coefficient where the quantity is positive; a term
            that is not named may have either. A number holds for all terms.
        otherwise: what a negative value would take, for who reads that it was refused; "" if
            nothing is known that does it.

    """

    quantity: str
    where: Mapping[str, int] | int
    otherwise: str

    def of(self, term: str) -> int:
        """+1 or -1, or 0 where either is possible."""
        return self.where if isinstance(self.where, int) else self.where.get(term, 0)


@dataclass(frozen=True)
class Largest:
    """The most that a coefficient of an effect can plausibly be; what needs more has another cause.

    Attributes:
        value: in the unit of the terms; of the sensitivity where `relative`.
        text: the same for people: "1 deg".
        relative: whether it is a part of the sensor's sensitivity.

    """

    value: float
    text: str
    relative: bool = False

    def of(self, sensitivity: float) -> float:
        """In the unit of the terms, for a sensor."""
        return self.value * abs(sensitivity) if self.relative else self.value


@dataclass(frozen=True)
class Entry:
    """What every catalogue says of an effect, whatever kind of run it is looked for in.

    Attributes:
        name: as reported.
        cause: what happens physically.
        source: what it comes from; effects of different sources are told apart by changing one of them.
        scope: "package", "line" or "voltmeter" if one cause moves all sensors together (one coefficient for all),
            "sensor" if each sensor has its own coefficient.
        stratum: where it varies when the order of the run is balanced. Pitch-roll: between the points of the design,
            or point by replication, that is with time, temperature or direction. Whole plots: from one whole plot to
            the next, or within them.
        unit: of the reported coefficients.
        size: the same in the terms of who works on the bench.
        against: the field of the data its residual is best looked at against.
        separate_by: the measurement that would confirm it, or tell it from what is not among the known aliases.
        usual_size: what instruments of this kind show.
        known_aliases: effects that are confounded with it on common designs.
        own: whether a laboratory added it: of what it looks like only its own entry knows.
        signed: the sign that its coefficients have physically; None where either is possible.
        largest: size beyond which it is no explanation; None where none is known.

    """

    name: str
    cause: str
    source: Source
    scope: Scope
    stratum: Stratum
    unit: str
    size: Size
    against: str
    separate_by: str
    usual_size: str
    known_aliases: Mapping[str, Alias]
    own: bool = field(default=False, kw_only=True)
    signed: Signed | None = field(default=None, kw_only=True)
    largest: Largest | None = field(default=None, kw_only=True)

    def sign(self, term: str) -> int:
        """Sign of a term's coefficient, +1 or -1; 0 where either is possible."""
        return 0 if self.signed is None else self.signed.of(term)


@dataclass(frozen=True)
class Effect(Entry):
    """An entry of the attitude catalogue. Adding an effect to the tracer is adding one of these.

    Attributes:
        terms: its columns, given the observations (an effect may have as many as there were interruptions).
        needs: what the observations must have: a key of `PREREQUISITES` each.
        searched: whether its terms are one another's alternatives, for as many values of a constant that is searched.
            A value counts as a coefficient in comparisons with other effects.

    """

    terms: Callable[[AttitudeData], tuple[Term, ...]]
    needs: tuple[str, ...] = ()
    searched: bool = False

    def applies_to(self, data: AttitudeData) -> bool:
        """Whether these observations have what it takes to look for it."""
        return all(PREREQUISITES[need](data) for need in self.needs)


PREREQUISITES: Mapping[str, Callable[[AttitudeData], bool]] = {
    "roll": lambda data: data.has_roll,
    "temperature": lambda data: (
        data.sensor_temperature_degC is not None and bool(np.ptp(data.sensor_temperature_degC) > 1e-3)
    ),
    "time": lambda data: bool(np.ptp(data.elapsed_s) > 0),
    "pitch sides": lambda data: bool(np.ptp(data.pitch_side) > 0),
    "roll sides": lambda data: bool(np.ptp(data.roll_side) > 0) and data.has_roll,
    "blocks": lambda data: bool(np.ptp(data.block) > 0),
    "starts": lambda data: data.replicates.size > 1 or bool(np.ptp(data.block) > 0),
    "several sensors": lambda data: len(data.sensors) > 1,
    "a night": lambda data: bool(np.ptp(data.elapsed_s) > 6 * 3600.0),
}


def fixed(*terms: Term) -> Callable[[AttitudeData], tuple[Term, ...]]:
    """Terms that are the same whatever the observations."""
    return lambda _data: terms
