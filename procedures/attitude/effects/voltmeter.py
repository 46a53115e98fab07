"""Errors of the voltmeter that reads all sensors: one coefficient holds for every output, in volts."""

from __future__ import annotations

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.effects.entry import Alias, Largest
from rig.fitter.effects.sizes import each, micro
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.effects.effect import Effect, Term, fixed
from rig.procedures.attitude.effects.scene import Scene

_CALIBRATOR = "read a voltage standard in place of a sensor, at several voltages"
_STANDARD = "read a voltage standard on a spare channel through the night"
_RANGES_V = (0.1, 1.0, 10.0)
UP, DOWN = 1.2, 1.0
"""Fractions of a range: autoranging leaves it upwards, and returns to it (10 % of the next one)."""


def _upper(v: FloatArray, order: IntArray, low: float, high: float) -> FloatArray:
    """(n,) one while the meter is on the upper range: from |v| above `high` until it falls below `low`."""
    ahead = np.argsort(order)
    size = np.abs(v[ahead])
    known = np.where(size > high, 1, np.where(size < low, 0, -1))
    last = np.maximum.accumulate(np.where(known >= 0, np.arange(size.size), 0))
    out = np.empty(size.size)
    out[ahead] = np.maximum(known[last], 0)
    return out


def _range_terms(data: AttitudeData) -> tuple[Term, ...]:
    swing = [np.abs(v) for v in data.outputs.values()]
    least, most = min(float(v.min()) for v in swing), max(float(v.max()) for v in swing)
    found: list[Term] = []
    for range_V in _RANGES_V:
        for low, high in ((DOWN, DOWN), (UP, UP), (DOWN, UP)):
            if least < low * range_V < most:
                found += _change(low * range_V, high * range_V)
    return tuple(found)


def _change(low_V: float, high_V: float) -> tuple[Term, Term]:
    at = f"|v|>{high_V:g} V" if low_V == high_V else f"|v|>{high_V:g} V until <{low_V:g} V"

    def upper(scene: Scene, sensor: str) -> FloatArray:
        return scene.kept((at, sensor), lambda: _upper(scene.volts(sensor), scene.data.order, low_V, high_V))

    return (
        Term(f"({at})", upper, group=at),
        Term(f"v*({at})", lambda scene, sensor: scene.volts(sensor) * upper(scene, sensor), group=at),
    )


VOLTMETER_RANGE = Effect(
    name="voltmeter-range",
    cause="zero and gain of the voltmeter differ from one of its ranges to the next",
    source="voltmeter",
    scope="voltmeter",
    stratum="between-point",
    unit="V and V/V",
    size=each(""),
    against="pitch_deg",
    terms=_range_terms,
    largest=Largest(0.01, "0.01 V or 1 %"),
    separate_by="fix the voltmeter's range and repeat a few points of small output",
    usual_size="1e-5 of the range",
    searched=True,
)

VOLTMETER_NONLINEARITY = Effect(
    name="voltmeter-nonlinearity",
    cause="the voltmeter's reading has a term in the square or the cube of the voltage, whichever sensor it reads",
    source="voltmeter",
    scope="voltmeter",
    stratum="between-point",
    unit="V per power of V",
    size=each(""),
    against="pitch_deg",
    terms=fixed(
        Term("v^2", lambda scene, sensor: scene.volts(sensor) ** 2),
        Term("v^3", lambda scene, sensor: scene.volts(sensor) ** 3),
    ),
    separate_by=_CALIBRATOR,
    usual_size="1e-6 of the range",
    known_aliases={
        "sensor-second-order": Alias("for a sensor by itself", _CALIBRATOR),
        "sensor-third-order": Alias("for a sensor by itself", _CALIBRATOR),
    },
    needs=("several sensors",),
)

VOLTMETER_ZERO_DRIFT = Effect(
    name="voltmeter-zero-drift",
    cause="the voltmeter's zero drifts with time, and with it all outputs alike",
    source="voltmeter",
    scope="voltmeter",
    stratum="point-by-replication",
    unit="V/h",
    size=micro("uV/h"),
    against="elapsed_s",
    terms=fixed(Term("time", lambda scene, _sensor: scene.hours())),
    separate_by=_STANDARD,
    usual_size="1 uV in a night",
    known_aliases={"offset-drift": Alias("if all sensors drift alike in volts", _STANDARD)},
    needs=("time", "several sensors"),
)

VOLTMETER_GAIN_DRIFT = Effect(
    name="voltmeter-gain-drift",
    cause="the voltmeter's gain drifts with time, and with it all outputs in proportion",
    source="voltmeter",
    scope="voltmeter",
    stratum="point-by-replication",
    unit="V/V/h",
    size=micro("ppm/h"),
    against="elapsed_s",
    terms=fixed(Term("time*v", lambda scene, sensor: scene.hours() * scene.volts(sensor))),
    separate_by=_STANDARD,
    usual_size="5e-6 in a night",
    known_aliases={"sensitivity-drift": Alias("if all sensors drift alike in proportion", _STANDARD)},
    needs=("time", "several sensors"),
)
