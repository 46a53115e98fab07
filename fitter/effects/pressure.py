"""Effects that a pressure calibration over temperature may lack, and their catalogue.

Here are those of the line, of memory and of time; `pressure_response` has the terms of the transducer's own response.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fitter.arrays import FloatArray
from fitter.effects.effect import Alias, Entry
from fitter.effects.pressure_response import (
    OFFSET_TEMPERATURE,
    OFFSET_TEMPERATURE_SQUARED,
    PRESSURE_CUBED,
    PRESSURE_SQUARED,
    PRESSURE_SQUARED_TEMPERATURE,
    PRESSURE_TEMPERATURE_SQUARED,
    SENSITIVITY_TEMPERATURE,
    SENSOR_BY_SSE_SQUARED,
    SENSOR_TEMPERATURE_CUBED,
    SSE_BY_SENSOR_SQUARED,
    SSE_TEMPERATURE_CUBED,
)
from fitter.effects.pressure_scene import PressureEffect, PressureScene, PressureTerm
from fitter.effects.sizes import each, micro
from fitter.whole_plot_data import WholePlotData

TIME_CONSTANTS_H = (0.25, 0.5, 1.0, 2.0, 4.0)
"""Searched: shorter ones are over before the first reading, longer ones hardly fade within a whole plot."""
BORES_MM = (0.05, 0.1, 0.2, 0.5)
"""Of the line, searched: in wider ones a cold end makes no difference that could be seen."""

_TWICE = "visit a pressure twice in a whole plot, once from below and once from above, by steps of different height"
_AT_EASE = "wait at one pressure of a whole plot and go on reading: what follows the last step fades, a loop stays"
_SOAK = "soak twice as long at a few temperatures: a lag is gone by then"
_SECOND_GAUGE = (
    "read a second gauge at the transducers' end of the line: an error of the line shows in both, one of a transducer "
    "does not"
)
_REPEAT_FIRST = "repeat the first whole plots at the end of the run"


def _fixed(*terms: tuple[str, Callable[[PressureScene], FloatArray]]) -> Callable[..., tuple[PressureTerm, ...]]:
    """The same terms whatever the observations."""
    entries = tuple(PressureTerm(*term) for term in terms)
    return lambda _data: entries


def _lag(name: str, step: Callable[[PressureScene], FloatArray]) -> Callable[..., tuple[PressureTerm, ...]]:
    """What is left of a step of temperature, for every time constant; all of it where that outlasts whole plots."""

    def term(tau_h: float) -> PressureTerm:
        return PressureTerm(f"d{name}*exp(-t/{tau_h:g}h)", lambda scene: step(scene) * np.exp(-scene.since_h / tau_h))

    decaying = tuple(map(term, TIME_CONSTANTS_H))
    return lambda _data: (*decaying, PressureTerm(f"d{name}", step))


def _transpiration(bore_mm: float) -> tuple[str, Callable[[PressureScene], FloatArray]]:
    return f"transpiration(P, T_sensor, {bore_mm:g} mm)", lambda scene: scene.transpiration(bore_mm)


def _steps(data: WholePlotData) -> tuple[PressureTerm, ...]:
    def term(block: int) -> PressureTerm:
        return PressureTerm(f"from block {block}", lambda scene: np.asarray(scene.data.block >= block, np.float64))

    return tuple(term(int(block)) for block in np.unique(data.block)[1:])


HYSTERESIS = PressureEffect(
    name="hysteresis",
    cause="the output depends on whether the pressure was reached from below or from above",
    source="sensor",
    scope="sensor",
    stratum="subplot",
    unit="mV",
    size=each("mV to each side"),
    against="pressure_side",
    separate_by=_TWICE,
    usual_size="5e-4 of the range",
    known_aliases={
        "carry-over": Alias("where steps from below are mostly as high as those from above", _AT_EASE),
        "creep": Alias("where steps from below are mostly as high as those from above", _AT_EASE),
    },
    terms=_fixed(
        ("side*loop(P)", lambda s: s.data.pressure_side * s.loop),
        ("side", lambda s: np.asarray(s.data.pressure_side, np.float64)),
    ),
)
CARRY_OVER = PressureEffect(
    name="carry-over",
    cause="part of the previous pressure is still in the line when a reading is taken",
    source="line",
    scope="line",
    stratum="subplot",
    unit="psi/psi",
    size=each("of the step"),
    against="previous_pressure_psia",
    separate_by=_AT_EASE,
    usual_size="1e-3 of the step, where settling is short",
    known_aliases={"creep": Alias("with a single transducer", _SECOND_GAUGE)},
    terms=_fixed(("P_before-P", lambda s: -s.change_psia)),
)
CREEP = PressureEffect(
    name="creep",
    cause="the transducer still gives way to the last step of pressure when it is read",
    source="sensor",
    scope="sensor",
    stratum="subplot",
    unit="mV/psi",
    size=each("mV per psi of the step"),
    against="previous_pressure_psia",
    separate_by=_AT_EASE,
    usual_size="3e-4 of the step",
    known_aliases={},
    terms=_fixed(("P_before-P", lambda s: -s.change_psia)),
)
SENSOR_LAG = PressureEffect(
    name="thermal-lag",
    cause="the transducer still follows the last change of its temperature when a whole plot begins",
    source="chamber",
    scope="sensor",
    stratum="subplot",
    unit="mV/degC",
    size=micro("nV per degC of the step"),
    against="since_s",
    separate_by=_SOAK,
    usual_size="1e-4 mV/degC",
    known_aliases={},
    terms=_lag("T_sensor", lambda s: s.step(s.data.sensor_temperature_degC)),
)
SSE_LAG = PressureEffect(
    name="sse-thermal-lag",
    cause="the electronics still follow the last change of their temperature when a whole plot begins",
    source="chamber",
    scope="sensor",
    stratum="subplot",
    unit="mV/degC",
    size=micro("nV per degC of the step"),
    against="since_s",
    separate_by=_SOAK,
    usual_size="1e-4 mV/degC",
    known_aliases={},
    terms=_lag("T_SSE", lambda s: s.step(s.data.sse_temperature_degC)),
)
TRANSPIRATION = PressureEffect(
    name="thermal-transpiration",
    cause="at low pressure the gas in a line with a warm and a cold end is not at one pressure",
    source="line",
    scope="line",
    stratum="subplot",
    unit="psi/psi",
    size=each("of what a line of that bore would do"),
    against="pressure_psia",
    separate_by="read a gauge at the cold end of the line, or use a line of twice the bore",
    usual_size="one, if the bore is right",
    known_aliases={},
    terms=_fixed(*map(_transpiration, BORES_MM)),
)
OFFSET_STEP = PressureEffect(
    name="offset-step",
    cause="the offset changed at an interruption of the run or when an instrument was replaced",
    source="interruption",
    scope="sensor",
    stratum="whole-plot",
    unit="mV",
    size=each("mV"),
    against="elapsed_s",
    separate_by="repeat a few whole plots of the earlier block",
    usual_size="whatever the interruption did",
    known_aliases={},
    terms=_steps,
)
ORDER_DRIFT = PressureEffect(
    name="whole-plot-drift",
    cause="the offset drifts through the run, from whole plot to whole plot",
    source="time",
    scope="sensor",
    stratum="whole-plot",
    unit="mV/h",
    size=micro("nV/h"),
    against="elapsed_s",
    separate_by=_REPEAT_FIRST,
    usual_size="1e-3 mV/h",
    known_aliases={},
    terms=_fixed(("time", lambda s: s.hours)),
)
SUBPLOT_DRIFT = PressureEffect(
    name="subplot-drift",
    cause="the offset drifts within every whole plot, from its first reading on",
    source="time",
    scope="sensor",
    stratum="subplot",
    unit="mV/h",
    size=micro("nV/h"),
    against="since_s",
    separate_by=_SOAK,
    usual_size="5e-3 mV/h",
    known_aliases={},
    terms=_fixed(("time in the whole plot", lambda s: s.since_h)),
)
SENSITIVITY_DRIFT = PressureEffect(
    name="sensitivity-drift",
    cause="the sensitivity drifts through the run: the transducer's own, or its excitation",
    source="time",
    scope="sensor",
    stratum="subplot",
    unit="mV/psi/h",
    size=micro("nV/psi/h"),
    against="elapsed_s",
    separate_by=_REPEAT_FIRST,
    usual_size="1e-5 of the sensitivity per h",
    known_aliases={
        "reference-drift": Alias("with a single transducer", "have the pressure controller checked before and after")
    },
    terms=_fixed(("P*time", lambda s: s.p * s.hours)),
)
REFERENCE_ZERO_DRIFT = PressureEffect(
    name="reference-zero-drift",
    cause="the pressure controller's own zero drifts through the run",
    source="line",
    scope="line",
    stratum="whole-plot",
    unit="psi/h",
    size=micro("upsi/h"),
    against="elapsed_s",
    separate_by="have the pressure controller's zero checked before and after",
    usual_size="1e-5 psi/h",
    known_aliases={
        "whole-plot-drift": Alias(
            "with a single transducer", "have the pressure controller's zero checked before and after"
        )
    },
    terms=_fixed(("time", lambda s: s.hours)),
)
REFERENCE_DRIFT = PressureEffect(
    name="reference-drift",
    cause="the pressure controller's own gain drifts through the run",
    source="line",
    scope="line",
    stratum="subplot",
    unit="psi/psi/h",
    size=micro("ppm/h"),
    against="elapsed_s",
    separate_by="have the pressure controller checked before and after",
    usual_size="1 ppm/h",
    known_aliases={},
    terms=_fixed(("P*time", lambda s: s.p * s.hours)),
)
LINE_LEAK = PressureEffect(
    name="line-leak",
    cause="air leaks into the line while a pressure settles",
    source="line",
    scope="line",
    stratum="subplot",
    unit="psi/psi/h",
    size=each("psi/h for every psi below ambient"),
    against="elapsed_s",
    separate_by="close the controller off at the lowest pressure and watch the line",
    usual_size="1e-4 psi/h for every psi",
    known_aliases={},
    terms=_fixed(("(14.7-P)*wait", lambda s: s.pull * s.waited_h)),
)
GROWING_NOISE = Entry(
    name="noise-grows-with-pressure",
    cause="readings scatter more the higher the pressure: sd = a + b P",
    source="sensor",
    scope="sensor",
    stratum="noise",
    unit="mV, mV/psi",
    size=each("mV"),
    against="pressure_psia",
    separate_by="repeat the highest and the lowest pressure several times in one whole plot",
    usual_size="3e-4 of the pressure",
    known_aliases={},
)
"""Not of the mean and so no candidate column: `fitter.trace.whole_plots.noise` estimates it beside the effects."""

PRESSURE_CATALOGUE: tuple[PressureEffect, ...] = (
    OFFSET_TEMPERATURE,
    OFFSET_TEMPERATURE_SQUARED,
    PRESSURE_SQUARED,
    SENSITIVITY_TEMPERATURE,
    PRESSURE_CUBED,
    PRESSURE_SQUARED_TEMPERATURE,
    PRESSURE_TEMPERATURE_SQUARED,
    SENSOR_TEMPERATURE_CUBED,
    SSE_TEMPERATURE_CUBED,
    SENSOR_BY_SSE_SQUARED,
    SSE_BY_SENSOR_SQUARED,
    CARRY_OVER,
    CREEP,
    HYSTERESIS,
    SENSOR_LAG,
    SSE_LAG,
    TRANSPIRATION,
    OFFSET_STEP,
    ORDER_DRIFT,
    REFERENCE_ZERO_DRIFT,
    SUBPLOT_DRIFT,
    SENSITIVITY_DRIFT,
    REFERENCE_DRIFT,
    LINE_LEAK,
)
"""Simplest and most usual cause first, as for the attitude sensors."""
