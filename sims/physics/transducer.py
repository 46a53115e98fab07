"""Output of a pressure transducer with its electronics, in millivolts."""

# ruff: noqa: N802  (a quantity's name ends in its unit, and units keep their own case)

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

from rig.sims.noise import normal
from rig.sims.physics.pressure_truth import TransducerTruth
from rig.sims.physics.undeclared import Effects, of_sensor

_drawn = lru_cache(maxsize=4096)(normal)
"""An error that is the same for all readings of a setting or a whole plot."""


class Conditions(NamedTuple):
    """All influences on the transducers' output, at one time.

    Attributes:
        t: virtual time.
        pressure_psia: at the transducers.
        sensor_degC: temperature of the transducers.
        sse_degC: temperature of their electronics.
        loop: hysteresis: width of the loop as a fraction of the maximum, negative after an upward approach.
        creep_psi: remaining first-order lag of earlier pressures.
        lag_degC: remaining first-order lag of earlier temperatures.
        degC_per_h: rate of change of the transducers' temperature.
        setting: number of the setting of the pressure, the key of the subplot error.
        set_psia: set pressure.
        whole_plot: number of the last change of temperature, the key of the whole-plot error.
    """

    t: float
    pressure_psia: float
    sensor_degC: float
    sse_degC: float
    loop: float
    creep_psi: float
    lag_degC: float
    degC_per_h: float
    setting: int
    set_psia: float
    whole_plot: int


class Transducer:
    """One transducer of the bench.

    Args:
        name: its name on the bench, and the key of its errors and its noise.
        truth: its true parameters.
        effects: undeclared effects.
        seed: key of all noise.

    Attributes:
        creep: fraction of a step of pressure that is delayed.
        lag: of its offset behind its temperature, mV/degC.
        gradient: change of its offset with the rate of its temperature, mV/(degC/h).
    """

    def __init__(self, name: str, truth: TransducerTruth, effects: Effects, seed: int) -> None:
        self.channel = f"sensor {name}"
        self.noise_mV = truth.noise_mV
        self._truth = truth
        self._seed = seed
        e = effects
        self._p3 = of_sensor(e.third_order_pressure.uV_per_psi3, name) * 1e-3
        self._p2_sensor = of_sensor(e.pressure_squared_temperature.sensor_nV_per_psi2_degC, name) * 1e-6
        self._p2_sse = of_sensor(e.pressure_squared_temperature.sse_nV_per_psi2_degC, name) * 1e-6
        self._p_sensor2 = of_sensor(e.pressure_temperature_squared.sensor_nV_per_psi_degC2, name) * 1e-6
        self._p_sse2 = of_sensor(e.pressure_temperature_squared.sse_nV_per_psi_degC2, name) * 1e-6
        self._sensor3 = of_sensor(e.third_order_temperature.sensor_nV_per_degC3, name) * 1e-6
        self._sse3 = of_sensor(e.third_order_temperature.sse_nV_per_degC3, name) * 1e-6
        self._hysteresis = of_sensor(e.hysteresis.uV, name) * 1e-3
        self.creep = of_sensor(e.carry_over.pct, name) * 1e-2
        self.lag = of_sensor(e.thermal_lag.uV_per_degC, name) * 1e-3
        self._offset_t = of_sensor(e.wholeplot_drift.uV_per_h, name) * 1e-3 / 3600.0
        self.gradient = of_sensor(e.thermal_gradient.uV_per_degC_per_h, name) * 1e-3
        self._jump, self._jump_at = of_sensor(e.offset_jump.jump_uV, name) * 1e-3, e.offset_jump.at_h * 3600.0
        self._excitation_sse = e.excitation_temperature.ppm_per_sse_degC * 1e-6
        self._excitation_t = of_sensor(e.excitation_drift.ppm_per_h, name) * 1e-6 / 3600.0

    def output_mV(self, c: Conditions) -> float:
        """Output without noise of the reading, mV."""
        supply = 1.0 + self._excitation_sse * (c.sse_degC - self._truth.sse_reference_degC)
        return supply * (self._offset(c) + self._response(c)) + self.wholeplot_error_mV(c) + self.subplot_error_mV(c)

    def wholeplot_error_mV(self, c: Conditions) -> float:
        """The whole-plot error: constant while the temperatures are."""
        return self._truth.wholeplot_mV * _drawn(self._seed, f"{self.channel} whole plot", c.whole_plot)

    def subplot_error_mV(self, c: Conditions) -> float:
        """The subplot error: constant while the set pressure is."""
        sd = self._truth.subplot_mV + self._truth.subplot_mV_per_psi * max(0.0, c.set_psia)
        return sd * _drawn(self._seed, f"{self.channel} setting", c.setting)

    def _offset(self, c: Conditions) -> float:
        """Output at zero pressure: bridge, electronics, and lags of both temperatures."""
        t = self._truth
        sensor, sse = c.sensor_degC - t.sensor_reference_degC, c.sse_degC - t.sse_reference_degC
        bridge = sensor * (
            t.offset_uV_per_degC * 1e-3 + sensor * (t.offset_nV_per_degC2 * 1e-6 + sensor * self._sensor3)
        )
        electronics = sse * (
            t.sse_offset_uV_per_degC * 1e-3 + sse * (t.sse_offset_nV_per_degC2 * 1e-6 + sse * self._sse3)
        )
        cross = t.cross_offset_nV_per_degC2 * 1e-6 * sensor * sse
        moved = self.lag * c.lag_degC + self.gradient * c.degC_per_h + self._offset_t * c.t
        return t.offset_mV + bridge + electronics + cross + moved + (self._jump if c.t >= self._jump_at else 0.0)

    def _response(self, c: Conditions) -> float:
        """Output due to pressure."""
        t = self._truth
        sensor, sse = c.sensor_degC - t.sensor_reference_degC, c.sse_degC - t.sse_reference_degC
        p = c.pressure_psia + self.creep * c.creep_psi
        scale = 1.0 + (t.sensitivity_ppm_per_degC * sensor + t.sse_gain_ppm_per_degC * sse) * 1e-6
        sensitivity = t.sensitivity_mV_per_psi * scale + self._p_sensor2 * sensor * sensor + self._p_sse2 * sse * sse
        square = t.nonlinearity_uV_per_psi2 * 1e-3 + self._p2_sensor * sensor + self._p2_sse * sse
        bent = p * (sensitivity + p * (square + p * self._p3))
        return bent * (1.0 + self._excitation_t * c.t) + self._hysteresis * c.loop
