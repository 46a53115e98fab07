"""Sensors with a loop: what the output is below a rising and above a falling pressure or pitch, in plain numpy."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rig.procedures.attitude.data import AttitudeData
from rig.procedures.pressure.data import WholePlotData

RISING = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 5.0])
TEMPERATURES = [(-20, -20), (60, -20), (-20, 60), (60, 60), (20, 20), (20, -20), (20, 60), (-20, 20), (60, 20)]


def whole_plots(seed: int, loop_mV: float, cubic_mV: float = 0.0) -> WholePlotData:
    """18 whole plots, pressures up and down in each; the loop is widest at half range. With a cubic that the model
    lacks, pressures are in random order.
    """
    rng, columns = np.random.default_rng(seed), []
    for plot, (sensor, sse) in enumerate(2 * TEMPERATURES):
        P = np.concatenate([RISING, RISING[-2::-1]])
        P = rng.permutation(P) if cubic_mV else P
        side = np.array([0.0, *np.sign(np.diff(P))])
        mV = cubic_mV * (P / 5.0) ** 3
        mV += transducer_output(P, sensor, sse)
        mV += 0.01 * rng.normal() + 0.004 * rng.normal(size=len(P)) - side * loop_mV / 2 * P * (5.0 - P) * 4 / 25
        each = np.ones(len(P))
        columns.append([plot * each, P, sensor * each, sse * each, mV, plot // 9 * each])
    plot, P, sensor, sse, mV, replicate = np.concatenate(columns, axis=1)
    order = np.arange(len(P))
    return WholePlotData(
        whole_plot=plot.astype(int),
        order=order,
        elapsed_s=60.0 * order.astype(np.float64),
        pressure_psia=P,
        sensor_temperature_degC=sensor,
        sse_temperature_degC=sse,
        outputs={"a_mV": mV},
        replicate=replicate.astype(int),
    )


def transducer_output(P: NDArray[np.float64], sensor_degC: float, sse_degC: float) -> NDArray[np.float64]:
    """(n,) output of `whole_plots` at (n,) psia, half-way between both sides and without any error."""
    return 1.0 + (20.0 + 0.002 * sensor_degC) * P + 0.02 * P**2 + 0.001 * sensor_degC + 0.0005 * sse_degC


def pitch_run(seed: int, side_V: float) -> AttitudeData:
    """Three replications of pitches up and down at two rolls, with a sensor whose output is half of `side_V` higher
    after a rising pitch.
    """
    rng = np.random.default_rng(seed)
    pitch = np.concatenate([np.arange(-90.0, 91.0, 15.0), np.arange(75.0, -91.0, -15.0)])
    side = np.array([0.0, *np.sign(np.diff(pitch))])
    a, s, roll = np.tile(pitch, 6), np.tile(side, 6), np.repeat(np.tile([0.0, 90.0], 3), len(pitch))
    x = 0.01 + 2.0 * np.sin(np.radians(a)) + s * side_V / 2 + 2e-5 * rng.normal(size=len(a))
    z = 0.02 + 1.9 * np.cos(np.radians(a)) * np.cos(np.radians(roll)) + 2e-5 * rng.normal(size=len(a))
    order = np.arange(len(a))
    return AttitudeData(
        replicate=np.repeat([0, 1, 2], 2 * len(pitch)),
        order=order,
        elapsed_s=30.0 * order.astype(np.float64),
        pitch_deg=a,
        roll_deg=roll,
        sensor_temperature_degC=None,
        outputs={"x_V": x, "z_V": z},
        pitch_side=s.astype(int),
    )
