"""Effects of earlier settings: of the last pressures, and of the last change of a temperature."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.effects.entry import Alias
from rig.fitter.effects.sizes import by_term, each, micro
from rig.procedures.pressure.effects.keeps import compressed, dragged, dragged_by
from rig.procedures.pressure.effects.scene import (
    AT_EASE,
    SOAK,
    PressureEffect,
    PressureScene,
    PressureTerm,
    fixed,
    settling,
)

LAGS_H = (0.25, 0.5, 1.0, 2.0, 4.0)
"""Searched: shorter ones have decayed before the first reading, longer ones hardly decay within a whole plot."""
CREEPS_H = (0.05, 0.15, 0.5, 1.5)
"""Searched: faster ones remember only the last step, slower ones last longer than the whole plot."""

RECOVERS_H = (6.0, 20.0)
"""Searched: faster ones are over in the next whole plot, slower ones outlast a run."""

COOLS_H = (0.02, 0.06)
"""Searched: how long gas stays warm."""
TURNS = (0.05, 0.15, 0.4)
"""Shares of a range after which friction has turned: less is a side, more is a slope."""

_TWICE = "visit a pressure twice in a whole plot, once from below and once from above, by steps of different height"


def _lag(name: str, step: Callable[[PressureScene], FloatArray]) -> Callable[..., tuple[PressureTerm, ...]]:
    """Remainder of a step of temperature, for every time constant; the whole step for a time constant longer than whole
    plots.

    It changes the offset, and also the sensitivity as far as this depends on temperature.
    """

    def left(tau_h: float) -> Callable[[PressureScene], FloatArray]:
        return lambda scene: step(scene) * np.exp(-scene.since_h / tau_h)

    def gain(tau_h: float) -> Callable[[PressureScene], FloatArray]:
        return lambda scene: scene.p * left(tau_h)(scene)

    of_offset = (
        PressureTerm(f"d{name}*exp(-t/{tau_h:g}h)", left(tau_h), "", "mV/degC", (tau_h, left)) for tau_h in LAGS_H
    )
    of_gain = (
        PressureTerm(f"P*d{name}*exp(-t/{tau_h:g}h)", gain(tau_h), "", "mV/psi/degC", (tau_h, gain)) for tau_h in LAGS_H
    )
    whole = PressureTerm(f"P*d{name}", lambda scene: scene.p * step(scene), unit="mV/psi/degC")
    terms = (*of_offset, *of_gain, PressureTerm(f"d{name}", step, unit="mV/degC"), whole)
    return lambda _data: terms


_LAGGING = by_term(lambda name: micro(f"nV{'/psi' if name.startswith('P*') else ''} per degC of the step"))
"""Every coefficient in nanovolts per degree of the step, and per psi if the sensitivity lags."""


def _dragged(share: float) -> tuple[str, Callable[[PressureScene], FloatArray]]:
    return f"side, turned after {share:g} of the range", lambda scene: dragged(scene, share)


_WITHIN = partial(PressureEffect, scope="sensor", stratum="subplot")
"""A transducer errs within whole plots."""

HYSTERESIS = _WITHIN(
    name="hysteresis",
    cause="the output depends on whether the pressure was reached from below or from above",
    source="sensor",
    unit="mV",
    size=each("mV to each side"),
    against="pressure_side",
    separate_by=_TWICE,
    usual_size="5e-4 of the range",
    known_aliases={
        "carry-over": Alias("where steps from below are mostly as high as those from above", AT_EASE),
        "creep": Alias("where steps from below are mostly as high as those from above", AT_EASE),
    },
    terms=fixed(
        ("side*loop(P)", lambda s: s.data.pressure_side * s.loop),
        ("side", lambda s: np.asarray(s.data.pressure_side, np.float64)),
        *map(_dragged, TURNS),
    ),
)
HYSTERESIS_TEMPERATURE = _WITHIN(
    name="hysteresis-temperature",
    cause="the difference between pressures reached from below and from above follows the transducer's temperature: "
    "friction that grows in the cold",
    source="sensor",
    unit="mV/degC",
    size=micro("nV/degC to each side"),
    against="pressure_side",
    separate_by="run pressures up and down at the coldest and at the warmest temperature",
    usual_size="5e-6 of the range per degC",
    terms=fixed(
        ("side*loop(P)*T_sensor", lambda s: s.data.pressure_side * s.loop * s.sensor),
        ("side*T_sensor", lambda s: s.data.pressure_side * s.sensor),
    ),
)
CREEP = _WITHIN(
    name="creep",
    cause="the transducer still creeps after the last step of pressure when it is read",
    source="sensor",
    unit="mV/psi",
    size=each("mV per psi of the step"),
    against="previous_pressure_psia",
    separate_by=AT_EASE,
    usual_size="3e-4 of the step",
    terms=fixed(("P_before-P", lambda s: -s.change_psia), *map(settling, CREEPS_H)),
    searched=True,
    dynamic=True,
)
SENSOR_LAG = _WITHIN(
    name="thermal-lag",
    cause="the transducer, or a correction for its temperature, still follows the last change of it when a whole plot "
    "begins",
    source="chamber",
    unit="mV/degC; with P mV/psi/degC",
    size=_LAGGING,
    against="since_s",
    separate_by=SOAK,
    usual_size="1e-4 mV/degC",
    terms=_lag("T_sensor", lambda s: s.step(s.data.sensor_temperature_degC)),
    searched=True,
    dynamic=True,
)
SSE_LAG = _WITHIN(
    name="sse-thermal-lag",
    cause="the electronics, or a correction for their temperature, still follow the last change of it when a whole "
    "plot begins",
    source="chamber",
    unit="mV/degC; with P mV/psi/degC",
    size=_LAGGING,
    against="since_s",
    separate_by=SOAK,
    usual_size="1e-4 mV/degC",
    terms=_lag("T_SSE", lambda s: s.step(s.data.sse_temperature_degC)),
    searched=True,
    dynamic=True,
)
THERMAL_GRADIENT = _WITHIN(
    name="thermal-gradient",
    cause="while its temperature changes one side of the transducer, or of its electronics, is warmer than the other",
    source="chamber",
    unit="mV/(degC/h)",
    size=micro("nV per degC/h"),
    against="since_s",
    separate_by="let a temperature drift slowly at one pressure, up and then down",
    usual_size="1e-3 mV/(degC/h)",
    known_aliases={
        "thermal-lag": Alias("where temperatures settle as they lag", "let a temperature drift slowly at one pressure")
    },
    terms=fixed(
        ("dT_sensor/dt", lambda s: s.rate(s.data.sensor_temperature_degC)),
        ("dT_SSE/dt", lambda s: s.rate(s.data.sse_temperature_degC)),
    ),
)


def _displaced(side: float, tau_h: float) -> tuple[str, Callable[[PressureScene], FloatArray]]:
    end = "cold" if side < 0 else "warmth"
    text = f"after the {end}, recovering in {tau_h:g} h"
    return text, lambda scene: scene.displaced(scene.data.sensor_temperature_degC, side, tau_h)


def _warmed(tau_h: float) -> PressureTerm:
    def column(tau_h: float) -> Callable[[PressureScene], FloatArray]:
        return lambda scene: compressed(scene, tau_h)

    return PressureTerm(f"ln(P/P_before)*exp(-t/{tau_h:g}h)", column(tau_h), constant=(tau_h, column))


def _held_warm(share: float) -> tuple[str, Callable[[PressureScene], FloatArray]]:
    text = f"side of T_sensor, turned after {share:g} of its range"
    return text, lambda scene: dragged_by(scene, scene.data.sensor_temperature_degC, share)


THERMAL_HYSTERESIS = PressureEffect(
    name="thermal-hysteresis",
    cause="the offset remembers which temperatures came before: a visit to the cold (or to the warm) end displaces it, "
    "and it recovers over hours",
    source="chamber",
    scope="sensor",
    stratum="whole-plot",
    unit="mV",
    size=each("mV after a visit to the end of the range"),
    against="elapsed_s",
    separate_by="repeat one pair of temperatures right after the coldest one, after the warmest one, and hours later",
    usual_size="5e-4 of the range",
    terms=fixed(
        *(_displaced(side, tau_h) for side in (-1.0, 1.0) for tau_h in RECOVERS_H),
        *map(_held_warm, TURNS[1:]),
    ),
    searched=True,
)
COMPRESSION_HEAT = _WITHIN(
    name="compression-heat",
    cause="gas that is compressed by a step of pressure is warm, gas let out is cold, and it warms the transducer "
    "until the walls have taken the heat",
    source="line",
    unit="mV",
    size=each("mV for a step to 2.7 times the pressure"),
    against="previous_pressure_psia",
    separate_by=AT_EASE,
    usual_size="1e-4 of the range",
    terms=fixed(*map(_warmed, COOLS_H)),
    searched=True,
    dynamic=True,
)
THERMAL_RATCHET = PressureEffect(
    name="thermal-ratchet",
    cause="the offset moves when the transducer is colder (or warmer) than ever before in the run, and does not come "
    "back: glue or solder yields",
    source="chamber",
    scope="sensor",
    stratum="whole-plot",
    unit="mV/degC",
    size=micro("nV/degC of the coldest or warmest so far"),
    against="elapsed_s",
    separate_by="visit both ends of the temperature range before the run: what yields has then yielded",
    usual_size="5e-6 of the range per degC",
    terms=fixed(
        ("coldest so far", lambda s: s.extreme(s.data.sensor_temperature_degC, -1.0)),
        ("warmest so far", lambda s: s.extreme(s.data.sensor_temperature_degC, 1.0)),
    ),
)
