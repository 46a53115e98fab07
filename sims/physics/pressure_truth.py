"""World-file tables of a pressure bench: its chambers and its transducers."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf

from rig.sims.physics.fields import Switch, accepts, quantity


@dataclass(frozen=True)
class ChamberTruth:
    """A chamber and the body in it: `[sensor_chamber]` and `[sse_chamber]`.

    Attributes:
        start_setpoint_degC: setpoint at the start of the world.
        start_controlled: whether control is on at the start; the chamber is in its steady state in both cases.
        time_constant_s: time constant of the control of air temperature.
        damping: damping ratio of that control; below 1 the air overshoots.
        slew_degC_per_min: maximum rate of the air, by its limited power.
        free_time_constant_s: time constant of the air relative to the laboratory with control off.
        authority_degC: difference from the laboratory that full power reaches.
        wall_time_constant_s: time constant of walls and load relative to the air.
        wall_exchange_s: time constant of the air relative to the walls alone.
        body_time_constant_s: time constant of the body (transducers or electronics) relative to its surroundings.
        body_sees_wall: wall's fraction of its surroundings; the controller's own sensor does not see it.
        body_sees_lab: laboratory's fraction, by leads and tubes: the gradient between sensor and body.
        new_draw_degC: change of temperature above which a new whole plot begins.
    """

    start_setpoint_degC: float = quantity(23.0, -200.0, 200.0)
    start_controlled: bool = field(default=False, metadata=accepts(Switch()))
    time_constant_s: float = quantity(120.0, 1.0, 1e5)
    damping: float = quantity(0.8, 0.1, 10.0)
    slew_degC_per_min: float = quantity(5.0, 1e-3, 100.0)
    free_time_constant_s: float = quantity(7200.0, 1.0, 1e6)
    authority_degC: float = quantity(500.0, 0.1, 1000.0)
    wall_time_constant_s: float = quantity(1500.0, 1.0, 1e6)
    wall_exchange_s: float = quantity(5400.0, 1.0, 1e6)
    body_time_constant_s: float = quantity(480.0, 1.0, 1e6)
    body_sees_wall: float = quantity(0.02, 0.0, 0.5)
    body_sees_lab: float = quantity(0.002, 0.0, 0.5)
    new_draw_degC: float = quantity(1.0, 1e-3, 100.0)


@dataclass(frozen=True)
class TransducerTruth:
    """A pressure transducer with its support electronics (SSE): `[sensors.NAME]`, NAME as on the bench.

    A strain-gauge bridge whose offset and sensitivity depend on its temperature. The electronics add to the offset and
    change the gain with their own temperature. The result is the full second order of the paper's eq. (1).

    Attributes:
        offset_mV: output at zero pressure and both reference temperatures.
        sensitivity_mV_per_psi: output per psi at both reference temperatures.
        nonlinearity_uV_per_psi2: quadratic term of the diaphragm.
        sensor_reference_degC: reference temperature of the bridge.
        offset_uV_per_degC: temperature coefficient of the offset, bridge.
        offset_nV_per_degC2: quadratic temperature coefficient of the offset, bridge.
        sensitivity_ppm_per_degC: temperature coefficient of the sensitivity, bridge.
        sse_reference_degC: reference temperature of the electronics.
        sse_offset_uV_per_degC: temperature coefficient of the offset, electronics.
        sse_offset_nV_per_degC2: quadratic temperature coefficient of the offset, electronics.
        sse_gain_ppm_per_degC: temperature coefficient of the gain, electronics.
        cross_offset_nV_per_degC2: coefficient of the offset for the product of both temperatures.
        wholeplot_mV: standard deviation of the whole-plot error, new at every change of a temperature.
        subplot_mV: standard deviation of the subplot error, new at every setting of the pressure, at zero pressure.
        subplot_mV_per_psi: growth of that standard deviation with pressure.
        noise_mV: standard deviation of a mean over 1 s; over t seconds it is this divided by sqrt(t).
    """

    offset_mV: float = quantity(0.0, -1000.0, 1000.0)
    sensitivity_mV_per_psi: float = quantity(2.0, -1000.0, 1000.0)
    nonlinearity_uV_per_psi2: float = quantity(0.0)
    sensor_reference_degC: float = quantity(-90.0, -273.15, 1000.0)
    offset_uV_per_degC: float = quantity(0.0)
    offset_nV_per_degC2: float = quantity(0.0)
    sensitivity_ppm_per_degC: float = quantity(0.0)
    sse_reference_degC: float = quantity(0.0, -273.15, 1000.0)
    sse_offset_uV_per_degC: float = quantity(0.0)
    sse_offset_nV_per_degC2: float = quantity(0.0)
    sse_gain_ppm_per_degC: float = quantity(0.0)
    cross_offset_nV_per_degC2: float = quantity(0.0)
    wholeplot_mV: float = quantity(0.0155, 0.0, inf)
    subplot_mV: float = quantity(0.0049, 0.0, inf)
    subplot_mV_per_psi: float = quantity(0.0, 0.0, inf)
    noise_mV: float = quantity(0.0005, 0.0, inf)


_TURN = 0.6180339887498949
"""Multiples of the golden section are distributed evenly between 0 and 1."""


def ordinary(number: int) -> TransducerTruth:
    """The default transducer of a world without its table; every number (1, 2, ...) gets another one."""

    def about(middle: float, spread: float, key: int) -> float:
        return middle + spread * (2.0 * ((number * _TURN * key) % 1.0) - 1.0)

    return TransducerTruth(
        offset_mV=round(about(0.1, 0.3, 1), 4),
        sensitivity_mV_per_psi=round(about(2.0, 0.1, 2), 4),
        nonlinearity_uV_per_psi2=round(about(-3.0, 1.0, 3), 2),
        offset_uV_per_degC=round(about(0.8, 0.6, 4), 3),
        offset_nV_per_degC2=round(about(12.0, 4.0, 5), 2),
        sensitivity_ppm_per_degC=round(about(-350.0, 100.0, 6), 1),
        sse_offset_uV_per_degC=round(about(0.0, 0.4, 7), 3),
        sse_offset_nV_per_degC2=round(about(0.0, 3.0, 8), 2),
        sse_gain_ppm_per_degC=round(about(120.0, 40.0, 9), 1),
        cross_offset_nV_per_degC2=round(about(0.0, 3.0, 10), 2),
    )
