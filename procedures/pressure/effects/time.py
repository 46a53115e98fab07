"""Effects of time: drifts, steps at recorded and unrecorded times, and the supply of the bridges."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.effects.entry import Alias
from rig.fitter.effects.sizes import by_term, each, micro
from rig.procedures.pressure.data import WholePlotData
from rig.procedures.pressure.effects.keeps import aged
from rig.procedures.pressure.effects.scene import SOAK, PressureEffect, PressureScene, PressureTerm, fixed
from rig.procedures.pressure.effects.slowly import DAY_H, daily, size, slowly

MOMENTS = 24
"""Maximum number of times tried for an unrecorded step."""
EACH_SIDE = 3
"""Minimum number of whole plots before and after such a time: a step of one or two is their own error."""

MANY = 30
"""Number of whole plots above which they are not tested separately."""

_REPEAT_FIRST = "repeat the first whole plots at the end of the run"
_EARLIER = "repeat a few whole plots of the earlier block"


_SUPPLY = by_term(lambda name: micro("ppm/degC") if name == "V*T_SSE" else size("ppm/h", "ppm"))
"""Every coefficient in ppm per unit of its variable."""


def _recorded(
    text: str, of: Callable[[PressureScene], FloatArray]
) -> Callable[[WholePlotData], tuple[PressureTerm, ...]]:
    """An effect from an interruption on."""

    def term(block: int) -> PressureTerm:
        return PressureTerm(f"{text}from block {block}", lambda scene: of(scene) * (scene.data.block >= block))

    return lambda data: tuple(term(int(block)) for block in np.unique(data.block)[1:])


def _each(data: WholePlotData) -> tuple[PressureTerm, ...]:
    """Every whole plot separately, unless there are so many that one bad one is harmless."""

    def term(identity: int) -> PressureTerm:
        return PressureTerm(
            f"whole plot {identity}", lambda scene: np.asarray(scene.data.whole_plot == identity, np.float64)
        )

    return tuple(map(term, data.whole_plots.tolist())) if data.whole_plots.size <= MANY else ()


def _unrecorded(text: str, of: Callable[[PressureScene], FloatArray], data: WholePlotData) -> tuple[PressureTerm, ...]:
    """An effect from some whole plot on, where no interruption is recorded."""

    def term(order: int, elapsed_h: float) -> PressureTerm:
        return PressureTerm(f"{text}from {elapsed_h:.3g} h", lambda scene: of(scene) * (scene.data.order >= order))

    begun = np.full(data.whole_plots.size, np.iinfo(np.int64).max)
    np.minimum.at(begun, data.whole_plot_index, data.order)
    at = np.sort(begun)[EACH_SIDE : -EACH_SIDE + 1 or None] if begun.size >= 2 * EACH_SIDE else begun[:0]
    recorded = {int(data.order[data.block == block].min()) for block in np.unique(data.block)[1:]}
    hours = dict(zip(data.order.tolist(), (data.elapsed_s / 3600.0).tolist(), strict=True))
    free = [int(order) for order in at if order not in recorded]
    picked = np.unique(np.linspace(0, len(free) - 1, min(MOMENTS, len(free))).round().astype(np.int64))
    return tuple(term(free[k], hours[free[k]]) for k in picked)


_IN_TIME = partial(PressureEffect, scope="sensor", against="elapsed_s")
"""A transducer changes with time."""

OFFSET_STEP = _IN_TIME(
    name="offset-step",
    cause="the offset changed at an interruption of the run or when an instrument was replaced",
    source="interruption",
    stratum="whole-plot",
    unit="mV",
    size=each("mV"),
    separate_by=_EARLIER,
    usual_size="whatever the interruption did",
    terms=_recorded("", lambda s: np.ones_like(s.p)),
)
ACTIVATIONS_EV = (0.2, 0.5)
"""Of seals, glue and glass, through which gas and water go; and of what reacts."""


def _aging(activation_eV: float) -> tuple[str, Callable[[PressureScene], FloatArray]]:
    return f"time, faster when warm by {activation_eV:g} eV", lambda s: aged(s, activation_eV)


ORDER_DRIFT = _IN_TIME(
    name="whole-plot-drift",
    cause="the offset drifts through the run, from whole plot to whole plot",
    source="time",
    stratum="whole-plot",
    unit="mV/h",
    size=micro("nV/h"),
    separate_by=_REPEAT_FIRST,
    usual_size="1e-3 mV/h",
    terms=fixed(("time", lambda s: s.hours), *map(_aging, ACTIVATIONS_EV)),
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
    separate_by=SOAK,
    usual_size="5e-3 mV/h",
    terms=fixed(("time in the whole plot", lambda s: s.since_h)),
)
SENSITIVITY_DRIFT = _IN_TIME(
    name="sensitivity-drift",
    cause="the sensitivity drifts through the run: the transducer's own, or its excitation",
    source="time",
    stratum="subplot",
    unit="mV/psi/h",
    size=size("nV/psi/h", "nV/psi"),
    separate_by=_REPEAT_FIRST,
    usual_size="1e-5 of the sensitivity per h",
    known_aliases={
        "reference-drift": Alias("with a single transducer", "have the pressure controller checked before and after")
    },
    terms=lambda data: slowly("P", lambda s: s.p, data, "mV/psi"),
)
SENSITIVITY_STEP = _IN_TIME(
    name="sensitivity-step",
    cause="the sensitivity changed at an interruption of the run or when an instrument was replaced",
    source="interruption",
    stratum="subplot",
    unit="mV/psi",
    size=micro("nV/psi"),
    separate_by=_EARLIER,
    usual_size="whatever the interruption did",
    terms=_recorded("P ", lambda s: s.p),
)
UNRECORDED_STEP = _IN_TIME(
    name="offset-step-unrecorded",
    cause="the offset changed between two whole plots, at an unrecorded moment",
    source="interruption",
    stratum="whole-plot",
    unit="mV",
    size=each("mV"),
    separate_by="find out what happened in the laboratory at that time, and repeat a few earlier whole plots",
    usual_size="whatever happened",
    known_aliases={
        "whole-plot-drift": Alias("near the middle of the run, if it is not many errors large", _REPEAT_FIRST)
    },
    terms=lambda data: _unrecorded("", lambda s: np.ones_like(s.p), data),
    searched=True,
)
SENSITIVITY_STEP_UNRECORDED = _IN_TIME(
    name="sensitivity-step-unrecorded",
    cause="the sensitivity changed between two whole plots, at an unrecorded moment",
    source="interruption",
    stratum="subplot",
    unit="mV/psi",
    size=micro("nV/psi"),
    separate_by="find out what happened in the laboratory at that time, and repeat a few earlier whole plots",
    usual_size="whatever happened",
    known_aliases={"sensitivity-drift": Alias("if it is not many errors large", _REPEAT_FIRST)},
    terms=lambda data: _unrecorded("P ", lambda s: s.p, data),
    searched=True,
)
WARMS_UP_H = (1.5, 5.0)
"""Searched: of the electronics and of a room."""


def _daily(data: WholePlotData) -> tuple[PressureTerm, ...]:
    """Waves of one day, if the run is as long as that: over a part of one they are a drift."""
    if not daily(data):
        return ()
    return (
        PressureTerm("cos(time of day)", lambda s: np.cos(2.0 * np.pi * s.hours / DAY_H)),
        PressureTerm("sin(time of day)", lambda s: np.sin(2.0 * np.pi * s.hours / DAY_H)),
    )


def _warming(tau_h: float) -> tuple[str, Callable[[PressureScene], FloatArray]]:
    return f"exp(-time of the run/{tau_h:g}h)", lambda s: np.exp(-(s.hours - s.begun_h) / tau_h)


DAILY_COURSE = _IN_TIME(
    name="daily-course",
    cause="the offset follows the time of day: the room, or the supply, goes up and down with it",
    source="time",
    stratum="whole-plot",
    unit="mV",
    size=each("mV up and down"),
    separate_by="record the temperature of the room and of the instruments through the run",
    usual_size="2e-4 of the range",
    terms=_daily,
)
WARM_UP = _IN_TIME(
    name="warm-up",
    cause="the offset settles after the instruments were switched on at the beginning of the run",
    source="time",
    stratum="whole-plot",
    unit="mV",
    size=each("mV at the beginning of the run"),
    separate_by=_REPEAT_FIRST,
    usual_size="1e-3 of the range",
    terms=fixed(*map(_warming, WARMS_UP_H)),
    searched=True,
)
EXCITATION = PressureEffect(
    name="excitation",
    cause="the supply of all bridges, or the gain of the voltmeter, changes with time or with the electronics' "
    "temperature: outputs scale, zeros and all",
    source="voltmeter",
    scope="voltmeter",
    stratum="subplot",
    unit="1/h",
    size=_SUPPLY,
    against="elapsed_s",
    separate_by="record the supply's voltage, and read a fixed bridge with the transducers",
    usual_size="1e-5 of itself per h, 1e-5 per degC",
    known_aliases={
        "reference-drift": Alias(
            "where the zeros are small beside the output", "record the supply's voltage through the run"
        ),
        "sensitivity-drift": Alias("with a single transducer", "record the supply's voltage through the run"),
    },
    terms=lambda data: (
        *slowly("V", lambda s: np.ones_like(s.p), data, "1"),
        PressureTerm("V*T_SSE", lambda s: s.sse, unit="1/degC"),
    ),
    at_most=5e-3,
)
OUTLYING_WHOLE_PLOT = _IN_TIME(
    name="outlying-whole-plot",
    cause="one whole plot stands apart from all others, and nothing that is recorded explains it; it is left out "
    "of what whole plots' means say",
    source="interruption",
    stratum="whole-plot",
    unit="mV",
    size=each("mV"),
    separate_by="look in the log at this whole plot, and repeat it",
    usual_size="whatever happened",
    terms=_each,
    searched=True,
    of_noise=True,
)
