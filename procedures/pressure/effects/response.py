"""The transducer's own response to pressure and temperature: possible missing terms of a declared model.

Sizes that are usual are those of piezoresistive transducers of about 2 mV/psi, read below 5 psia.
"""

from __future__ import annotations

from collections.abc import Callable

from fitter.arrays import FloatArray
from fitter.effects.sizes import Size, each, micro
from procedures.pressure.effects.scene import PressureEffect, PressureScene, PressureTerm

_MORE_PRESSURES = "read more pressures between those of the design, up and down, at one temperature"
_MORE_TEMPERATURES = (
    "add temperature pairs off the circle of the design, such as full corners: third-order terms part there"
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
        known_aliases={},
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
PRESSURE_CUBED = _smooth(
    "pressure-third-order",
    "the output has a term in the cube of the pressure",
    ("P^3", lambda s: s.p**3),
    unit="mV/psi^3",
    usual_size="5e-4 of the range",
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
