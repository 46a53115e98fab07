"""One hidden effect for every entry of the attitude catalogue, of any size: benches of `attitude` with one fault.

Sizes are stated as the root mean square of what the declared model cannot take up, over the reading's standard
deviation, in the sensor that shows most of it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from proving.truth.attitude import Bench, Plan, Sensor, simulate

CLEAN = Bench()
PADS_AND_TEMPERATURE = Bench(
    sensors=tuple(Sensor(axis, S_per_degC=1.1e-4) for axis in "xyz"),
    compliance={("y", "x"): 8e-4},
)
"""At the sizes of NASA/TP-1999-209835: pads 4e-4 deg on x; temperature as row 28(a) to (b) of its Table 2."""


def on_x(**errors: Any) -> Bench:
    """The bench with errors of the x sensor."""
    return Bench(sensors=(Sensor("x", **errors), Sensor("y"), Sensor("z")))


@dataclass(frozen=True)
class Hidden:
    """An effect of the catalogue, and the bench that has `c` of it."""

    effect: str
    bench: Callable[[float], Bench]
    unit: float
    """A size at which it is small and yet far above rounding."""
    options: Mapping[str, Any] = field(default_factory=dict)


BREAK = {"break_at": 0.4}

HIDDEN = {
    "pads": Hidden("isolation-pad-deflection", lambda c: Bench(compliance={("y", "x"): c}), 1e-3),
    "pads, weight across": Hidden("isolation-pad-deflection", lambda c: Bench(compliance={("x", "z"): c}), 1e-3),
    "offset, temperature": Hidden("offset-temperature", lambda c: on_x(b_per_degC=c), 1e-4),
    "sensitivity, temperature": Hidden("sensitivity-temperature", lambda c: on_x(S_per_degC=c), 1e-4),
    "alignment, temperature": Hidden("alignment-temperature", lambda c: on_x(Omega_deg_per_degC=c), 1e-2),
    "lag": Hidden("thermal-lag", lambda c: on_x(b_per_lagged_degC=c), 1e-4),
    "gradient": Hidden("thermal-gradient", lambda c: on_x(b_per_degC_per_h=c), 1e-4),
    "offset step": Hidden("offset-step", lambda c: on_x(b_step=c), 1e-4, BREAK),
    "sensitivity step": Hidden("sensitivity-step", lambda c: on_x(S_step=c), 1e-4, BREAK),
    "offset step, unrecorded": Hidden("offset-step-unrecorded", lambda c: on_x(b_unrecorded=c), 1e-4),
    "offset drift": Hidden("offset-drift", lambda c: on_x(b_per_h=c), 1e-5),
    "sensitivity drift": Hidden("sensitivity-drift", lambda c: on_x(S_per_h=c), 1e-6),
    "daily": Hidden("daily-cycle", lambda c: on_x(b_daily=c), 1e-4),
    "backlash, pitch": Hidden("backlash-pitch", lambda c: Bench(pitch_backlash_deg=c), 1e-3),
    "backlash, roll": Hidden("backlash-roll", lambda c: Bench(roll_backlash_deg=c), 1e-3),
    "hysteresis, pitch": Hidden("hysteresis-pitch", lambda c: on_x(b_pitch_side=c), 1e-4),
    "hysteresis, roll": Hidden("hysteresis-roll", lambda c: on_x(b_roll_side=c), 1e-4),
    "settling, pitch": Hidden("settling-pitch", lambda c: Bench(pitch_unsettled=c), 1e-4),
    "settling, roll": Hidden("settling-roll", lambda c: Bench(roll_unsettled=c), 1e-4),
    "creep": Hidden("creep", lambda c: on_x(creep=c), 1e-4),
    "square": Hidden("sensor-second-order", lambda c: on_x(quadratic=c), 1e-5),
    "cube": Hidden("sensor-third-order", lambda c: on_x(cubic=c), 1e-5),
    "voltmeter bends": Hidden("voltmeter-nonlinearity", lambda c: Bench(v_squared=c), 1e-6),
    "pitch scale, once": Hidden("head-once-per-turn", lambda c: Bench(pitch_error_deg=(c, 0.6 * c, 0, 0)), 1e-3),
    "pitch scale, twice": Hidden("head-twice-per-turn", lambda c: Bench(pitch_error_deg=(0, 0, c, 0.6 * c)), 1e-3),
    "roll scale, once": Hidden("roll-head-once-per-turn", lambda c: Bench(roll_error_deg=(c, 0.6 * c, 0, 0)), 1e-3),
    "roll scale, twice": Hidden("roll-head-twice-per-turn", lambda c: Bench(roll_error_deg=(0, 0, c, 0.6 * c)), 1e-3),
    "index": Hidden("index-error", lambda c: Bench(pitch_zero_deg=c), 1e-3),
    "tilt": Hidden("head-tilt", lambda c: Bench(lean_deg=c), 1e-3),
    "square axes": Hidden("axes-not-square", lambda c: Bench(not_square_deg=c), 1e-3),
    "wobble": Hidden("roll-wobble", lambda c: Bench(wobble_deg=(c, 0.6 * c, 0, 0)), 1e-3),
    "wobble, twice": Hidden("roll-wobble", lambda c: Bench(wobble_deg=(0, 0, c, 0.6 * c)), 1e-3),
    "product": Hidden("cross-axis", lambda c: on_x(cross=c), 1e-5),
    "voltmeter zero": Hidden("voltmeter-zero-drift", lambda c: Bench(meter_per_h=(c, 0.0)), 1e-6),
    "voltmeter gain": Hidden("voltmeter-gain-drift", lambda c: Bench(meter_per_h=(0.0, c)), 1e-6),
    "voltmeter range": Hidden("voltmeter-range", lambda c: Bench(range_V=(c, 0.5 * c)), 1e-4),
    "index shift": Hidden("index-shift", lambda c: Bench(pitch_shift_deg=c), 1e-3),
    "slip": Hidden("mounting-slip", lambda c: Bench(slip_deg=(0.5 * c, c, 0.3 * c)), 1e-3),
    "scale, attitude": Hidden("scale-attitude", lambda c: Bench(scale_per_g=(c, 0.5 * c, -0.3 * c)), 1e-6),
    "cable": Hidden("cable-wind-up", lambda c: Bench(cable_deg=(c, 0.4 * c)), 1e-3),
    "asymmetry": Hidden("sensor-asymmetry", lambda c: on_x(asymmetry=c), 1e-5),
    "stiction": Hidden("dead-zone", lambda c: on_x(sticks_g=c), 1e-6),
    "saturation": Hidden("saturation", lambda c: on_x(saturates=c), 1e-4),
    "level field": Hidden("magnetic-heading", lambda c: on_x(magnetic_V=(c, 0.5 * c, -0.3 * c)), 1e-5),
    "backlash, warm": Hidden("backlash-temperature", lambda c: Bench(backlash_deg_per_degC=(c, 0.5 * c)), 1e-3),
    "tilt, time": Hidden("tilt-drift", lambda c: Bench(tilt_deg_per_h=(c, 0.5 * c)), 1e-4),
    "tilt, day": Hidden("tilt-daily", lambda c: Bench(tilt_daily_deg=(c, 0.5 * c)), 1e-3),
    "sensitivity step, unrecorded": Hidden(
        "sensitivity-step-unrecorded", lambda c: replace(on_x(S_since=c), since=3), 1e-5
    ),
    "slip, unrecorded": Hidden(
        "mounting-slip-unrecorded", lambda c: Bench(slip_unrecorded_deg=(0.5 * c, c, 0.3 * c)), 1e-3
    ),
    "gear, pitch": Hidden("gear-pitch", lambda c: Bench(pitch_gear_deg=(c, 0.6 * c)), 1e-3),
    "gear, roll": Hidden("gear-roll", lambda c: Bench(roll_gear_deg=(c, 0.6 * c)), 1e-3),
}


def sized(name: str, rms: float, plan: Plan) -> Bench:
    """The bench with as much of one effect as leaves `rms` in the sensor that shows most of it."""
    hidden = HIDDEN[name]
    faulty = hidden.bench(hidden.unit)
    data, with_it = simulate(faulty, plan, 0, **hidden.options)
    without = simulate(CLEAN, plan, 0, **hidden.options)[1]
    a, r = np.radians(data.pitch_deg), np.radians(data.roll_deg)
    model = np.linalg.qr(np.column_stack([np.ones_like(a), np.sin(a), np.cos(a) * np.sin(r), np.cos(a) * np.cos(r)]))[0]
    worst = 0.0
    for sensor in faulty.sensors:
        shape = with_it[f"{sensor.axis}_V"] - without[f"{sensor.axis}_V"]
        left = shape - model @ (model.T @ shape)
        worst = max(worst, np.sqrt(np.mean(left**2)) / (np.radians(faulty.sigma_deg) * sensor.S))
    return hidden.bench(hidden.unit * rms / worst)


def together(benches: Sequence[Bench], clean: Bench = CLEAN) -> Bench:
    """One bench with the faults of several."""
    changed: dict[str, Any] = {}
    for f in fields(Bench):
        for bench in benches:
            if f.name != "sensors" and getattr(bench, f.name) != getattr(clean, f.name):
                changed[f.name] = getattr(bench, f.name)
    sensors = []
    for i, sensor in enumerate(clean.sensors):
        own: dict[str, Any] = {}
        for f in fields(Sensor):
            for bench in benches:
                if getattr(bench.sensors[i], f.name) != getattr(sensor, f.name):
                    own[f.name] = getattr(bench.sensors[i], f.name)
        sensors.append(replace(sensor, **own))
    return replace(clean, sensors=tuple(sensors), **changed)
