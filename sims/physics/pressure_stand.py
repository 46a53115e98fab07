"""A pressure bench: one line, two chambers, and the transducers connected to all three."""

# ruff: noqa: N802  (a quantity's name ends in its unit, and units keep their own case)

from __future__ import annotations

from collections.abc import Mapping
from math import sqrt

from rig.sims.noise import event_at, normal
from rig.sims.physics.by_hand import OTHER_GAUGE, Drawn, changed
from rig.sims.physics.chamber import Chamber
from rig.sims.physics.pressure_line import PressureLine
from rig.sims.physics.pressure_truth import TransducerTruth
from rig.sims.physics.steps import Steps
from rig.sims.physics.thermal import Lab
from rig.sims.physics.transducer import Conditions, Transducer
from rig.sims.physics.truth import Truth

PRESSURE, SENSORS, SSE = "pressure_psia", "sensor_temperature_degC", "sse_temperature_degC"
"""Factors, as named in a bench file's `[factors]`."""


class Line(PressureLine):
    """A pressure line with a history of its settings.

    Args:
        world: the whole truth of the world.
        name: the controller's name on the bench.
        start: virtual time of its first known state.

    Attributes:
        settings: history of set pressures; a setting is a command to another pressure, or the first one after control
            was off.
    """

    def __init__(self, world: Truth, name: str, start: float) -> None:
        super().__init__(world.pressure_line, name, world.seed, start)
        self.settings = Steps(start, self.truth.start_psia)

    def command(self, now: float, setpoint_psia: float, slew_psi_per_s: float, *, overshoot: bool = False) -> None:
        """Control to a setpoint of the controller's own reading."""
        if not self.controlling or setpoint_psia != self.setpoint_psia:
            self._set(now, setpoint_psia, slew_psi_per_s)
        super().command(now, setpoint_psia, slew_psi_per_s, overshoot=overshoot)

    def vent(self, now: float, rate_psi_per_s: float) -> None:
        """Vent the line to the atmosphere at this maximum rate; the vent stays open until the next command."""
        self._set(now, self.truth.ambient_psia, rate_psi_per_s)
        super().vent(now, rate_psi_per_s)

    def _set(self, now: float, psia: float, rate_psi_per_s: float) -> None:
        rate = min(rate_psi_per_s, self.truth.valve_psi_per_s)
        self.settings.set(now, psia, abs(psia - self.settings.value(now)) / rate)


class PressureStand:
    """The transducers and all influences on them. Pure functions of virtual time between commands.

    Args:
        truth: the world.
        factors: the bench's `[factors]`: instrument by factor. A factor without instrument has the laboratory's value.
        lab: its surroundings.
        start: virtual time of its first known state.

    Attributes:
        transducers: by name on the bench.
    """

    def __init__(self, truth: Truth, factors: Mapping[str, str], lab: Lab, start: float) -> None:
        self._truth = truth
        self._lab = lab
        self._start = start
        self._lines: dict[str, Line] = {}
        self._line = self.line(factors.get(PRESSURE, ""))
        self._chambers: dict[str, Chamber] = {}
        for factor, chamber in ((SSE, truth.sse_chamber), (SENSORS, truth.sensor_chamber)):
            if factor in factors:
                self._chambers[factors[factor]] = Chamber(chamber, lab, start)
        self._effects, self._gauge = truth.effects, (1.0, 0.0)
        self._sensors, self._sse = (self._chambers.get(factors.get(factor, "")) for factor in (SENSORS, SSE))
        self._climate = [chamber for chamber in (self._sensors, self._sse) if chamber]
        self._connect()

    def _connect(self) -> None:
        """Connect the transducers, under the present effects."""
        truth = self._truth
        self.transducers = {
            name: Transducer(name, sensor, self._effects, truth.seed)
            for name, sensor in truth.sensors.items()
            if isinstance(sensor, TransducerTruth)
        }
        felt = self.transducers.values()
        # what no transducer feels need not be known
        self._creeps, self._lags = any(one.creep for one in felt), any(one.lag for one in felt)
        self._gradients = any(one.gradient for one in felt)

    def by_hand(self, change: str, drawn: Drawn) -> None:
        """A person changes the bench by hand."""
        self._effects = changed(self._effects, change, drawn)
        if change == OTHER_GAUGE:
            self._gauge = drawn.gauge()
        self._connect()

    def line(self, instrument: str) -> Line:
        """The line behind a pressure controller; the transducers are on that of the factor."""
        if instrument not in self._lines:
            self._lines[instrument] = Line(self._truth, instrument, self._start)
        return self._lines[instrument]

    def chamber(self, instrument: str) -> Chamber | None:
        """The chamber of a temperature controller, if it sets one of the factors."""
        return self._chambers.get(instrument)

    def sensors_degC(self, t: float) -> float:
        """Temperature of the transducers."""
        return self._sensors.package_degC(t) if self._sensors else self._lab.degC(t)

    def sse_degC(self, t: float) -> float:
        """Temperature of their support electronics."""
        return self._sse.package_degC(t) if self._sse else self._lab.degC(t)

    def pressure_psia(self, t0: float, t1: float) -> float:
        """Mean pressure in the line at the transducers."""
        return self._line.mean_psia(t0, t1)

    def output_V(self, sensor: str, t0: float, t1: float) -> float:
        """Mean output of a transducer over an integration window, noise included; see `clean_V` and `noise_V`."""
        return self.clean_V(sensor, t0, t1) + self.noise_V(sensor, t0, t1)

    def clean_V(self, sensor: str, t0: float, t1: float) -> float:
        """Mean output of a transducer over an integration window, without noise.

        The temperatures are those at the middle of the window.

        Args:
            sensor: its name on the bench.
            t0: begin of the window, virtual seconds.
            t1: its end, later than `t0`.
        """
        return self.transducers[sensor].output_mV(self.conditions(t0, t1)) * 1e-3

    def noise_V(self, sensor: str, t0: float, t1: float) -> float:
        """Noise of a transducer's mean output; a function of the window."""
        transducer = self.transducers[sensor]
        noise = normal(self._truth.seed, transducer.channel, event_at(t0))
        return transducer.noise_mV / sqrt(t1 - t0) * noise * 1e-3

    def conditions(self, t0: float, t1: float) -> Conditions:
        """Influences on the transducers over a window."""
        t = (t0 + t1) / 2.0
        effects, settings = self._effects, self._line.settings
        pressure, sensor = self._line.mean_psia(t0, t1), self.sensors_degC(t)
        bore = effects.thermal_transpiration.bore_mm
        if bore:
            pressure = at_the_sensor_psia(pressure, bore, sensor, self._lab.degC(t))
        pressure *= effects.cold_column.over(sensor, self._lab.degC(t))
        pressure += effects.reference_nonlinearity.upsi_per_psi3 * 1e-6 * pressure**3
        gain, zero_psi = self._gauge
        pressure = pressure * gain + zero_psi
        creep = settings.behind(t, effects.carry_over.time_constant_s) if self._creeps else 0.0
        lag = rate = 0.0
        if self._lags and self._sensors:
            lag = self._sensors.temperatures.behind(t, effects.thermal_lag.time_constant_s)
        if self._gradients and t > (ago := max(self._start, t - 1.0)):
            rate = 3600.0 * (sensor - self.sensors_degC(ago)) / (t - ago)
        return Conditions(
            t=t,
            pressure_psia=pressure,
            sensor_degC=sensor,
            sse_degC=self.sse_degC(t),
            loop=-settings.direction(t) * effects.hysteresis.shape(pressure),
            creep_psi=creep,
            lag_degC=lag,
            degC_per_h=rate,
            setting=event_at(settings.since(t)),
            set_psia=settings.value(t),
            whole_plot=self.whole_plot(t),
        )

    def side(self, t: float) -> int:
        """Direction of the last approach of the pressure: 1 upwards, -1 downwards, 0 if it was never set."""
        return self._line.settings.direction(t)

    def whole_plot(self, t: float) -> int:
        """A number for the stay at a pair of temperatures: time of the last change, and the chambers that have drifted
        off.
        """
        latest = max([c.temperatures.since(t) for c in self._climate], default=self._start)
        drifted = sum([c.drifted(t) << bit for bit, c in enumerate(self._climate)])
        return 4 * event_at(latest) + drifted


_TORR_PER_PSI = 51.714932572
_ZERO_DEGC_K = 273.15
_A, _B, _C = 12.0e5, 10.0e2, 14.0
"""Takaishi and Sensui's constants of nitrogen: K^2/(Torr mm)^2, K/(Torr mm) and sqrt(K/(Torr mm))."""


def at_the_sensor_psia(pressure_psia: float, bore_mm: float, sensor_degC: float, gauge_degC: float) -> float:
    """Pressure at the sensor's end of a line whose other end is at `pressure_psia`, psia.

    Takaishi and Sensui, Trans. Faraday Soc. 59 (1963) 2503: with r the ratio of the cold to the warm pressure, (r - m)
    / (1 - m) = (A X^2 + B X + C sqrt X) / (A X^2 + B X + C sqrt X + 1), where m is the root of the ratio of the
    temperatures, the limit of r in a vacuum, and X = 2 p d / (T1 + T2). Air is taken for nitrogen.

    Args:
        pressure_psia: at the gauge's end.
        bore_mm: diameter d of the line.
        sensor_degC: temperature of the sensor's end.
        gauge_degC: temperature of the gauge's end.
    """
    if pressure_psia <= 0.0:
        return pressure_psia
    sensor, gauge = sensor_degC + _ZERO_DEGC_K, gauge_degC + _ZERO_DEGC_K
    x = 2.0 * pressure_psia * _TORR_PER_PSI * bore_mm / (sensor + gauge)
    viscous = _A * x * x + _B * x + _C * sqrt(x)
    vacuum = sqrt(max(sensor, 0.0) / gauge)
    return pressure_psia * (viscous + vacuum) / (viscous + 1.0)
