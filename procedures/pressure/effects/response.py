"""The transducer's own response to pressure and temperature: possible missing terms of a declared model.

Sizes that are usual are those of piezoresistive transducers of about 2 mV/psi, read below 5 psia.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.effects.entry import Alias
from rig.fitter.effects.sizes import Size, by_term, each, micro
from rig.procedures.pressure.data import WholePlotData
from rig.procedures.pressure.effects.scene import ROOM_K, TIMES_WARM, PressureEffect, PressureScene, PressureTerm

_MORE_PRESSURES = "read more pressures between those of the design, up and down, at one temperature"
_MORE_TEMPERATURES = (
    "add temperature pairs off the circle of the design, such as full corners: third-order terms can be separated there"
)


def _smooth(
    name: str,
    cause: str,
    *terms: tuple[str, Callable[[PressureScene], FloatArray]],
    unit: str,
    usual_size: str,
    whole_plot: bool = False,
    size: Size | None = None,
) -> PressureEffect:
    """A term of the transducer's own response to pressure and temperature."""
    return PressureEffect(
        name=name,
        cause=cause,
        source="temperature" if whole_plot else "sensor",
        scope="sensor",
        stratum="whole-plot" if whole_plot else "subplot",
        unit=unit,
        size=size or each(unit),
        against="sensor_temperature_degC" if whole_plot else "pressure_psia",
        separate_by=_MORE_TEMPERATURES if whole_plot else _MORE_PRESSURES,
        usual_size=usual_size,
        terms=lambda _data: tuple(PressureTerm(text, column, text.replace("*", ":")) for text, column in terms),
    )


OFFSET_TEMPERATURE = _smooth(
    "offset-temperature",
    "the offset follows the temperature of the transducer or of its electronics",
    ("T_sensor", lambda s: s.sensor),
    ("T_SSE", lambda s: s.sse),
    unit="mV/degC",
    usual_size="1e-3 mV/degC",
    whole_plot=True,
    size=micro("nV/degC"),
)
OFFSET_TEMPERATURE_SQUARED = _smooth(
    "offset-temperature-second-order",
    "the offset follows the square of a temperature, or the product of both",
    ("T_sensor^2", lambda s: s.sensor**2),
    ("T_sensor*T_SSE", lambda s: s.sensor * s.sse),
    ("T_SSE^2", lambda s: s.sse**2),
    unit="mV/degC^2",
    usual_size="1e-5 mV/degC^2",
    whole_plot=True,
)
SENSITIVITY_TEMPERATURE = _smooth(
    "sensitivity-temperature",
    "the sensitivity follows the temperature of the transducer or of its electronics",
    ("P*T_sensor", lambda s: s.p * s.sensor),
    ("P*T_SSE", lambda s: s.p * s.sse),
    unit="mV/psi/degC",
    usual_size="2e-4 of the sensitivity per degC",
)
PRESSURE_SQUARED = _smooth(
    "pressure-second-order",
    "the output bends with pressure",
    ("P^2", lambda s: s.p**2),
    unit="mV/psi^2",
    usual_size="1e-3 of the range",
)
PRESSURE_SQUARED_TEMPERATURE = _smooth(
    "pressure-squared-temperature",
    "the bend of the output with pressure follows a temperature",
    ("P^2*T_sensor", lambda s: s.p**2 * s.sensor),
    ("P^2*T_SSE", lambda s: s.p**2 * s.sse),
    unit="mV/psi^2/degC",
    usual_size="1e-5 of the range per degC",
)
PRESSURE_TEMPERATURE_SQUARED = _smooth(
    "pressure-temperature-squared",
    "the sensitivity follows the square of a temperature, or the product of both",
    ("P*T_sensor^2", lambda s: s.p * s.sensor**2),
    ("P*T_sensor*T_SSE", lambda s: s.p * s.sensor * s.sse),
    ("P*T_SSE^2", lambda s: s.p * s.sse**2),
    unit="mV/psi/degC^2",
    usual_size="1e-6 of the sensitivity per degC^2",
)


def _cubic(name: str, what: str, term: str, column: Callable[[PressureScene], FloatArray]) -> PressureEffect:
    cause = f"the offset follows {what}"
    return _smooth(name, cause, (term, column), unit="mV/degC^3", usual_size="3e-7 mV/degC^3", whole_plot=True)


SENSOR_TEMPERATURE_CUBED = _cubic(
    "sensor-temperature-third-order", "the cube of its temperature", "T_sensor^3", lambda s: s.sensor**3
)
SSE_TEMPERATURE_CUBED = _cubic(
    "sse-temperature-third-order", "the cube of its electronics' temperature", "T_SSE^3", lambda s: s.sse**3
)
SENSOR_BY_SSE_SQUARED = _cubic(
    "sensor-by-sse-squared",
    "its temperature times the square of its electronics'",
    "T_sensor*T_SSE^2",
    lambda s: s.sensor * s.sse**2,
)
SSE_BY_SENSOR_SQUARED = _cubic(
    "sse-by-sensor-squared",
    "its electronics' temperature times the square of its own",
    "T_sensor^2*T_SSE",
    lambda s: s.sensor**2 * s.sse,
)


BENDS = (0.08, 0.16, 0.3)
"""Searched shares of the highest pressure: where a bend of low pressures is half over."""
BANDS = (0.02, 0.05, 0.1, 0.2)
"""Searched shares of the highest pressure: where a transducer begins to answer."""
ENDS = (0.5, 0.6, 0.7, 0.75, 0.8, 0.85, 0.9)
"""Searched shares of the highest pressure: from where on the sensitivity is smaller."""
SOFT = 0.03
"""Share of the highest pressure over which it becomes so, where it does softly."""
THIN = (0.05, 0.2, 0.6)
"""Searched shares of the highest pressure: where gas cools half as well as a dense one."""
KNEES = (0.2, 0.35, 0.5, 0.65, 0.8)
"""Searched shares of the range of a temperature: where the offset or the sensitivity turns."""

_LOW = "read more pressures at the low end of the range, at two temperatures"


def _touch_down(share: float, most: float, *, warm: bool = False) -> PressureTerm:
    at = share * most

    def column(scene: PressureScene) -> FloatArray:
        bend = (scene.p / at) ** 2 / (1.0 + (scene.p / at) ** 2)
        return np.asarray(bend * scene.sensor if warm else bend)

    text = f"bend that is half over at {at:.3g} psi"
    return PressureTerm(f"{text}{TIMES_WARM}" if warm else text, column, unit="mV/degC" if warm else "mV")


def _band(share: float, most: float) -> PressureTerm:
    at = share * most
    return PressureTerm(f"min(P, {at:.3g} psi)", lambda scene: np.asarray(np.minimum(scene.p, at)))


def _end(share: float, most: float) -> PressureTerm:
    at = share * most
    return PressureTerm(f"P beyond {at:.3g} psi", lambda scene: np.asarray(np.maximum(scene.p - at, 0.0)))


def _soft_end(share: float, most: float) -> PressureTerm:
    at, width = share * most, SOFT * most
    return PressureTerm(
        f"P softly beyond {at:.3g} psi", lambda scene: width * np.logaddexp(0.0, (scene.p - at) / width)
    )


def _cooled(share: float, most: float, power: float = 1.0) -> PressureTerm:
    at = share * most

    def column(scene: PressureScene) -> FloatArray:
        dense = scene.p / at * ROOM_K / scene.kelvin
        return np.asarray(1.0 / (1.0 + np.maximum(dense, 0.0) ** power))

    how = "conduction" if power == 1.0 else "convection"
    return PressureTerm(f"{how}, half at {at:.3g} psi", column)


def _each_of(
    shares: tuple[float, ...], term: Callable[[float, float], PressureTerm]
) -> Callable[[WholePlotData], tuple[PressureTerm, ...]]:
    """Terms for every share of the highest pressure of a run."""

    def terms(data: WholePlotData) -> tuple[PressureTerm, ...]:
        most = float(np.max(data.pressure_psia))
        return tuple(term(share, most) for share in shares) if most > 0 else ()

    return terms


STIFFENS = (0.2, 1.0)
"""Tension of a stretched membrane over its stiffness, at the highest pressure."""


def _stretched(ratio: float, most: float) -> PressureTerm:
    """Deflection of a membrane that stretches, z + ratio z^3 = P: a cube of the pressure only where that is small."""

    def column(scene: PressureScene) -> FloatArray:
        half = scene.p / most / (2.0 * ratio)
        root = np.sqrt(half**2 + 1.0 / (27.0 * ratio**3))
        return np.asarray(np.cbrt(half + root) + np.cbrt(half - root))

    return PressureTerm(f"membrane stretched {ratio:g} times", column, unit="mV")


PRESSURE_CUBED = PressureEffect(
    name="pressure-third-order",
    cause="the output has a term in the cube of the pressure: a membrane that stretches",
    source="sensor",
    scope="sensor",
    stratum="subplot",
    unit="mV/psi^3",
    size=by_term(lambda name: each("mV/psi^3" if name == "P^3" else "mV")),
    against="pressure_psia",
    separate_by=_MORE_PRESSURES,
    usual_size="5e-4 of the range",
    terms=lambda data: (PressureTerm("P^3", lambda s: s.p**3, "P^3"), *_each_of(STIFFENS, _stretched)(data)),
)

_BENDING = by_term(lambda name: micro("nV per degC") if name.endswith("T_sensor") else each("mV"))
"""Every coefficient in millivolts, or for a degree in nanovolts."""

TOUCH_DOWN = PressureEffect(
    name="touch-down",
    cause="the output bends at low pressure and no more above: a part of the diaphragm touches a stop",
    source="sensor",
    scope="sensor",
    stratum="subplot",
    unit="mV, mV/degC",
    size=_BENDING,
    against="pressure_psia",
    separate_by=_LOW,
    usual_size="5e-4 of the range",
    terms=lambda data: (
        *_each_of(BENDS, _touch_down)(data),
        *_each_of(BENDS, partial(_touch_down, warm=True))(data),
    ),
    searched=True,
)
DEAD_BAND = PressureEffect(
    name="dead-band",
    cause="below a small pressure the transducer does not answer, or not with its whole sensitivity",
    source="sensor",
    scope="sensor",
    stratum="subplot",
    unit="mV/psi",
    size=each("mV/psi of sensitivity that is missing there"),
    against="pressure_psia",
    separate_by=_LOW,
    usual_size="1e-2 of the sensitivity",
    terms=_each_of(BANDS, _band),
    searched=True,
)
GAS_COOLING = PressureEffect(
    name="gas-cooling",
    cause="the bridge is warm by its own current, and warmer in thin gas, which cools it less: the zero follows it",
    source="line",
    scope="sensor",
    stratum="subplot",
    unit="mV",
    size=each("mV from vacuum to dense gas"),
    against="pressure_psia",
    separate_by="halve the supply of the bridge: what its own heat does is then a quarter",
    usual_size="1e-4 of the range",
    terms=lambda data: (*_each_of(THIN, _cooled)(data), *_each_of(THIN, partial(_cooled, power=0.5))(data)),
    searched=True,
    manual_changes=(),
)
SATURATION = PressureEffect(
    name="saturation",
    cause="the sensitivity is smaller near the end of the range: a stop is near, or the amplifier saturates",
    source="sensor",
    scope="sensor",
    stratum="subplot",
    unit="mV/psi",
    size=each("mV/psi"),
    against="pressure_psia",
    separate_by=_MORE_PRESSURES,
    usual_size="1e-3 of the sensitivity",
    terms=lambda data: (*_each_of(ENDS, _end)(data), *_each_of(ENDS, _soft_end)(data)),
    searched=True,
)


def _knee(name: str, share: float, temperature: FloatArray, *, of_slope: bool = False) -> PressureTerm:
    """A change of slope beside a straight line: where none is declared, it is no part of a knee.

    Args:
        name: of the temperature.
        share: of its range, where the knee is.
        temperature: (n,) degrees Celsius.
        of_slope: whether the sensitivity turns there, and not the offset.
    """
    low, high = float(np.min(temperature)), float(np.max(temperature))
    at, middle = low + share * (high - low), float(np.mean(temperature))
    off = temperature - middle
    slope = float(off @ np.maximum(temperature - at, 0.0) / max(float(off @ off), np.finfo(float).tiny))

    def column(scene: PressureScene) -> FloatArray:
        data = scene.data
        now = data.sensor_temperature_degC if name == "T_sensor" else data.sse_temperature_degC
        turned = np.asarray(np.maximum(now - at, 0.0) - slope * (now - middle))
        return scene.p * turned if of_slope else turned

    text = f"{name} above {at:.3g} degC"
    return PressureTerm(f"P*({text})" if of_slope else text, column)


def _knees(*, of_slope: bool = False) -> Callable[[WholePlotData], tuple[PressureTerm, ...]]:
    return lambda data: tuple(
        _knee(name, share, of, of_slope=of_slope)
        for name, of in (("T_sensor", data.sensor_temperature_degC), ("T_SSE", data.sse_temperature_degC))
        for share in KNEES
        if np.ptp(of) > 0
    )


OFFSET_KNEE = PressureEffect(
    name="offset-knee",
    cause="the offset follows a temperature by one slope below a knee and by another above: a glass transition, a "
    "joint that opens",
    source="temperature",
    scope="sensor",
    stratum="whole-plot",
    unit="mV/degC",
    size=micro("nV/degC of change of the slope"),
    against="sensor_temperature_degC",
    separate_by="add whole plots at temperatures about the knee",
    usual_size="3e-4 mV/degC",
    known_aliases={
        "sensor-temperature-third-order": Alias(
            "with five temperatures or fewer", "add whole plots at temperatures about the knee"
        )
    },
    terms=_knees(),
    searched=True,
)
SENSITIVITY_KNEE = PressureEffect(
    name="sensitivity-knee",
    cause="the sensitivity follows a temperature by one slope below a knee and by another above: an excitation "
    "regulator that falls out of regulation, an adhesive that softens",
    source="temperature",
    scope="sensor",
    stratum="subplot",
    unit="mV/psi/degC",
    size=each("mV/psi/degC of change of the slope"),
    against="sse_temperature_degC",
    separate_by="add whole plots at temperatures about the knee",
    usual_size="1e-4 of the sensitivity per degC",
    known_aliases={
        "pressure-temperature-squared": Alias(
            "with five temperatures or fewer", "add whole plots at temperatures about the knee"
        )
    },
    terms=_knees(of_slope=True),
    searched=True,
)
