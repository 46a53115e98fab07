"""Values for the columns of a whole-plot run's effects, and physics common to several of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import ClassVar

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.effects.entry import Entry
from rig.fitter.effects.manual_changes import ByHand
from rig.fitter.errors import FitError
from rig.procedures.pressure.data import WholePlotData
from rig.procedures.pressure.effects.manual_changes import FAMILIES

AMBIENT_PSIA = 14.7
_FOR_A_CUBIC = 6
ROOM_K = 295.0
"""Temperature of the pressure controller's end of the line."""
_ZERO_DEGC_K = 273.15
_TORR_PER_PSI = 51.7149
_NITROGEN = 12e5, 10e2, 14.0
"""Takaishi and Sensui's constants: K^2/(Torr mm)^2, K/(Torr mm), sqrt(K/(Torr mm))."""


_WEIGHT_K_PER_M = 0.02896 * 9.80665 / 8.314463
"""Of air: molar mass times gravity over the gas constant."""

LAST = 3
"""Readings with which a whole plot ends."""
REACHES = 0.7
"""Part of the way to a whole plot's temperature that something slow goes in it."""
TIMES_WARM = ", times T_sensor"
"""Ends the name of a term that is another one's change with the temperature."""

AT_EASE = "wait at one pressure of a whole plot and go on reading: an effect of the last step fades, a loop stays"
SOAK = "soak twice as long at a few temperatures: a lag is gone by then"
SECOND_GAUGE = (
    "read a second gauge at the transducers' end of the line: an error of the line shows in both, one of a transducer "
    "does not"
)


@dataclass(frozen=True, eq=False)
class PressureScene:
    """Observations of a whole-plot run and their references.

    Attributes:
        data: the observations.
        sensor_degC: reference temperature of the transducers.
        sse_degC: the same of the electronics.
        elapsed_s: reference time; drifts are zero there.
        begun_s: time at which the run began.
        sensitivity: of each transducer, mV/psi.
        zero: its output at zero pressure, mV.

    """

    data: WholePlotData
    sensor_degC: float
    sse_degC: float
    elapsed_s: float
    begun_s: float
    sensitivity: Mapping[str, float]
    zero: Mapping[str, float]

    @property
    def p(self) -> FloatArray:
        """(n,) pressure, psia."""
        return self.data.pressure_psia

    @property
    def sensor(self) -> FloatArray:
        """(n,) sensor temperature above the reference, degC."""
        return self.data.sensor_temperature_degC - self.sensor_degC

    @property
    def sse(self) -> FloatArray:
        """(n,) temperature of the electronics above the reference, degC."""
        return self.data.sse_temperature_degC - self.sse_degC

    @cached_property
    def hours(self) -> FloatArray:
        """(n,) time since the reference, h."""
        return (self.data.elapsed_s - self.elapsed_s) / 3600.0

    @property
    def begun_h(self) -> float:
        """When the run began, h from the reference."""
        return (self.begun_s - self.elapsed_s) / 3600.0

    @cached_property
    def since_h(self) -> FloatArray:
        """(n,) time since the first reading of the whole plot, h."""
        return self.data.since_s / 3600.0

    @cached_property
    def change_psia(self) -> FloatArray:
        """(n,) pressure minus the previous one; zero at the first of a whole plot where that is not known."""
        before = self.data.previous_pressure_psia
        return np.where(np.isnan(before), 0.0, self.p - before)

    @cached_property
    def ended_psia(self) -> FloatArray:
        """(n,) mean pressure with which the whole plot before ended; in the first the mean of these."""
        data = self.data
        index, executed = data.whole_plot_index, np.argsort(data.order, kind="stable")
        ends = [executed[index[executed] == plot][-LAST:] for plot in range(int(index.max()) + 1)]
        last = np.array([float(np.mean(self.p[rows])) for rows in ends])
        in_time = np.argsort([int(data.order[rows].max()) for rows in ends])
        out = np.empty(len(last))
        out[in_time] = np.concatenate([[float(np.mean(last))], last[in_time[:-1]]])
        return np.asarray(out[index])

    @cached_property
    def loop(self) -> FloatArray:
        """(n,) width of a hysteresis loop over the pressures of the run: one in the middle, zero at both ends."""
        low, high = float(self.p.min()), float(self.p.max())
        return 4.0 * (self.p - low) * (high - self.p) / (high - low) ** 2 if high > low else np.zeros_like(self.p)

    @cached_property
    def waited_h(self) -> FloatArray:
        """(n,) time between the previous reading and this one, h; the usual one at the first of a whole plot."""
        data = self.data
        executed = np.lexsort((data.order, data.whole_plot_index))
        wait = np.empty(len(data))
        wait[executed] = np.diff(self.hours[executed], prepend=self.hours[executed][0])
        first = data.position == 0
        return np.where(first, np.median(wait[~first]) if np.any(~first) else 0.0, wait)

    def behind(self, tau_h: float) -> FloatArray:
        """(n,) difference between the pressure and the state of an element with this time constant, psi.

        It is at rest before the first pressure of a whole plot, and every pressure is set directly after the previous
        reading.
        """
        index, fading = self.data.whole_plot_index, np.exp(-np.maximum(self.waited_h, 0.0) / tau_h)
        missing = np.where(self.data.position == 0, -self.change_psia * fading, 0.0)
        executed = np.lexsort((self.data.order, index))
        for last, row in pairwise(executed.tolist()):
            if index[last] == index[row]:
                missing[row] = (missing[last] + self.p[last] - self.p[row]) * fading[row]
        return missing

    @property
    def kelvin(self) -> FloatArray:
        """(n,) absolute temperature of the transducers, K."""
        return np.maximum(self.data.sensor_temperature_degC + _ZERO_DEGC_K, 1.0)

    @property
    def since_begun(self) -> FloatArray:
        """(n,) part of the run that is over."""
        return np.asarray((self.hours - self.begun_h) / max(self.run_h, np.finfo(float).tiny))

    @cached_property
    def run_h(self) -> float:
        """How long the run took, h."""
        return float(np.ptp(self.hours))

    @property
    def weight_per_m(self) -> FloatArray:
        """(n,) error of the pressure for every metre of air between reference and transducers, psi.

        The barometric formula's first order, P M g / (R T), with air at the transducers' temperature.
        """
        cold = np.maximum(self.data.sensor_temperature_degC + _ZERO_DEGC_K, 1.0)
        return self.p * _WEIGHT_K_PER_M / cold

    def rate(self, temperature: FloatArray) -> FloatArray:
        """(n,) rate of change of a temperature, degC/h: slope of a cubic through each whole plot's readings."""
        index, out = self.data.whole_plot_index, np.zeros(len(self.data))
        for plot in range(int(index.max()) + 1):
            rows = np.flatnonzero(index == plot)
            if rows.size >= _FOR_A_CUBIC:
                t = self.since_h[rows] - self.since_h[rows].mean()
                slope = np.linalg.lstsq(np.column_stack([t**0, t, t**2, t**3]), temperature[rows], rcond=None)[0]
                out[rows] = np.column_stack([0.0 * t, t**0, 2.0 * t, 3.0 * t**2]) @ slope
        return out

    @property
    def pull(self) -> FloatArray:
        """(n,) pressure difference that drives air into the line, psi."""
        return AMBIENT_PSIA - self.p

    def in_turn(self, values: FloatArray) -> tuple[FloatArray, IntArray]:
        """(W,) mean over each whole plot in the order of running, and (n,) the place of each row's in it."""
        order = self.mean(self.data.order.astype(np.float64))
        _, first, in_time = np.unique(order, return_index=True, return_inverse=True)
        return self.mean(values)[first], np.asarray(in_time, np.int64)

    def step(self, temperature: FloatArray) -> FloatArray:
        """(n,) change of a temperature from the previous whole plot to this one, degC; zero in the first."""
        each, in_time = self.in_turn(temperature)
        return np.diff(each, prepend=each[0])[in_time]

    def extreme(self, temperature: FloatArray, side: float) -> FloatArray:
        """(n,) lowest (`side` -1) or highest (+1) temperature up to this whole plot, minus that of the first, degC."""
        each, in_time = self.in_turn(temperature)
        return np.asarray((side * np.maximum.accumulate(side * each) - each[0])[in_time])

    def displaced(self, temperature: FloatArray, side: float, tau_h: float) -> FloatArray:
        """(n,) remaining effect of visits to one end of a temperature's range in the whole plots before, 0 to 1.

        Whatever is further than a half of the way from the middle to that end counts fully.

        Args:
            temperature: (n,) degC.
            side: -1 for the cold end, +1 for the warm one.
            tau_h: time constant of the recovery, h.

        """
        mean, index = self.mean(temperature), self.data.whole_plot_index
        half = max(float(np.ptp(mean)) / 2.0, np.finfo(float).tiny)
        depth = np.clip(2.0 * side * (mean - float(mean.max() + mean.min()) / 2.0) / half, 0.0, 1.0)
        count = int(index.max()) + 1
        begun, own = np.full(count, np.inf), np.zeros(count)
        np.minimum.at(begun, index, self.hours)
        own[index] = depth
        left, state = np.zeros(count), 0.0
        for last, plot in pairwise(np.argsort(begun, kind="stable").tolist()):
            state = max(state, float(own[last])) * float(np.exp(-(begun[plot] - begun[last]) / tau_h))
            left[plot] = state
        return left[index]

    def followed(self, value: FloatArray, tau_h: float) -> FloatArray:
        """(n,) what something has of a whole plot's value that goes most of the way to it while a whole plot lasts.

        The first whole plot has zero; from the end of one to the beginning of the next it fades.

        Args:
            value: (n,) one of each whole plot.
            tau_h: with which it fades, h.

        """
        mean, index = self.mean(value), self.data.whole_plot_index
        count = int(index.max()) + 1
        begun, own = np.full(count, np.inf), np.zeros(count)
        np.minimum.at(begun, index, self.hours)
        own[index] = mean
        left, state = np.zeros(count), 0.0
        for last, plot in pairwise(np.argsort(begun, kind="stable").tolist()):
            state += REACHES * (float(own[last]) - state)
            state *= float(np.exp(-(begun[plot] - begun[last]) / tau_h))
            left[plot] = state
        return left[index]

    def transpiration(self, bore_mm: float) -> FloatArray:
        """(n,) error of the pressure at a cold transducer whose line of this bore begins in the room, psi.

        In the molecular regime the ratio of pressures is the square root of that of the temperatures; the difference
        decreases with pressure: P1/P2 - 1 = (sqrt(T1/T2) - 1) / (1 + A X^2 + B X + C sqrt X), X = 2 P d / (T1 + T2),
        with the constants of nitrogen (Takaishi and Sensui, Trans. Faraday Soc. 59 (1963) 2503).
        """
        cold = np.maximum(self.data.sensor_temperature_degC + _ZERO_DEGC_K, 0.0)
        x = 2.0 * np.maximum(self.p, 0.0) * _TORR_PER_PSI * bore_mm / (cold + ROOM_K)
        a, b, c = _NITROGEN
        return self.p * (np.sqrt(cold / ROOM_K) - 1.0) / (1.0 + a * x**2 + b * x + c * np.sqrt(x))

    def mean(self, values: FloatArray) -> FloatArray:
        """(n,) mean over the whole plot of each row."""
        index = self.data.whole_plot_index
        return (np.bincount(index, values) / np.bincount(index))[index]


@dataclass(frozen=True)
class PressureTerm:
    """One column of an effect.

    Attributes:
        name: unique within its effect.
        column: (n,) in the unit that makes the coefficient the effect's; psi for effects of the line.
        formula: the same as a term of `rig.fitter.formula`, up to terms of lower order; empty if there is none.
        unit: of its coefficient, if the effect's terms have different units; otherwise empty.
        constant: its time constant, h, and the column for another one; None without a time constant.
    """

    name: str
    column: Callable[[PressureScene], FloatArray]
    formula: str = ""
    unit: str = ""
    constant: tuple[float, Callable[[float], Callable[[PressureScene], FloatArray]]] | None = None


@dataclass(frozen=True)
class PressureEffect(Entry):
    """An entry of the catalogue of whole-plot runs.

    An effect of scope "line" is an error of the pressure: a coefficient of one makes an error of its column, in psi, in
    all transducers, converted by the sensitivity of each. An effect of scope "voltmeter" is relative to every
    transducer's output. An effect of scope "sensor" belongs to one transducer, in mV. The search leaves out columns
    that are zero or part of the declared model.

    Attributes:
        terms: its columns, given the observations.
        searched: whether its terms are alternatives for values of a searched constant: together they have the share of
            the family's level of one term of another effect.
        at_most: the largest coefficient that the cause can have; a larger one has another cause.
        of_noise: whether it is reported as a finding about the noise, and predicts nothing.
        on_suspicion: whether it is named only if nothing else explains the data, and otherwise listed among the
            aliases.
    """

    terms: Callable[[WholePlotData], tuple[PressureTerm, ...]]
    searched: bool = False
    at_most: float = float("inf")
    of_noise: bool = False
    on_suspicion: bool = False

    family: ClassVar[str] = ""

    @property
    def columns(self) -> tuple[str, ...]:
        """Variables of its columns: what it is drawn over."""
        return (self.against,)

    @property
    def by_hand(self) -> tuple[ByHand, ...]:
        """Influences of changes by a person, those of its family by default; none of a laboratory's own effects."""
        families = {} if self.own else FAMILIES
        return families.get(self.source, ()) if self.manual_changes is None else self.manual_changes

    def __post_init__(self) -> None:
        """Refuse a bound that the search of whole-plot runs does not use. Raises FitError."""
        if self.largest is not None:
            raise FitError(f"effect {self.name}: the bound of a PressureEffect is at_most, not largest")


def settling(tau_h: float) -> PressureTerm:
    """The difference between pressure and an element with this time constant."""

    def column(tau_h: float) -> Callable[[PressureScene], FloatArray]:
        return lambda scene: scene.behind(tau_h)

    return PressureTerm(f"P({tau_h:g}h)-P", column(tau_h), constant=(tau_h, column))


def fixed(
    *terms: PressureTerm | tuple[str, Callable[[PressureScene], FloatArray]],
) -> Callable[..., tuple[PressureTerm, ...]]:
    """Terms that are equal for every run."""
    entries = tuple(one if isinstance(one, PressureTerm) else PressureTerm(*one) for one in terms)
    return lambda _data: entries
