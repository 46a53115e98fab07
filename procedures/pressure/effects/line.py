"""Effects of the line and of the pressure reference: errors of pressure common to all transducers."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from rig.fitter.arrays import FloatArray
from rig.fitter.effects.entry import Alias, Signed
from rig.fitter.effects.manual_changes import resized_by
from rig.fitter.effects.sizes import by_term, each, micro
from rig.procedures.pressure.effects.keeps import in_a_tube
from rig.procedures.pressure.effects.manual_changes import OTHER_GAUGE
from rig.procedures.pressure.effects.scene import (
    AT_EASE,
    SECOND_GAUGE,
    PressureEffect,
    PressureScene,
    PressureTerm,
    fixed,
    settling,
)
from rig.procedures.pressure.effects.slowly import size, slowly

BORES_MM = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5)
"""Searched bores of the line: in wider ones a cold end has no visible effect."""
SETTLES_H = (0.01, 0.03)
"""Searched time constants of a line, visible if readings wait for unequal times."""
IN_TUBES_H = (0.01, 0.03, 0.1)
"""The same at the lowest pressure, of thin tubes, in which a time constant is as the inverse of the pressure."""
HIGHEST_M = 30.0
"""Maximum height difference of a line."""

_CHECKED = "have the pressure controller checked before and after"


def _transpiration(bore_mm: float) -> tuple[str, Callable[[PressureScene], FloatArray]]:
    return f"transpiration(P, T_sensor, {bore_mm:g} mm)", lambda scene: scene.transpiration(bore_mm)


def _in_a_tube(tau_h: float) -> PressureTerm:
    def column(tau_h: float) -> Callable[[PressureScene], FloatArray]:
        return lambda scene: in_a_tube(scene, tau_h)

    return PressureTerm(f"P({tau_h:g}h at the lowest)-P", column(tau_h), constant=(tau_h, column))


_BEND = by_term(lambda name: each(f"psi/{name.replace('P', 'psi')}"))
"""Every coefficient in psi for its power of the pressure."""

_OF_LINE = partial(PressureEffect, source="line", scope="line", stratum="subplot")
"""All transducers on the line err within whole plots."""

CARRY_OVER = _OF_LINE(
    name="carry-over",
    cause="part of the previous pressure is still in the line when a reading is taken",
    unit="psi/psi",
    size=each("of the step"),
    against="previous_pressure_psia",
    separate_by=AT_EASE,
    usual_size="1e-3 of the step, where settling is short",
    known_aliases={"creep": Alias("with a single transducer", SECOND_GAUGE)},
    terms=fixed(("P_before-P", lambda s: -s.change_psia), *map(settling, SETTLES_H), *map(_in_a_tube, IN_TUBES_H)),
    signed=Signed("share of the pressure before", +1, "a line that goes beyond the pressure it was set to"),
    searched=True,
    dynamic=True,
)
TRANSPIRATION = _OF_LINE(
    name="thermal-transpiration",
    cause="at low pressure the gas in a line with a warm and a cold end is not at one pressure",
    unit="psi/psi",
    size=each("of what a line of that bore would do"),
    against="pressure_psia",
    separate_by="read a gauge at the cold end of the line, or use a line of twice the bore",
    usual_size="one, if the bore is right",
    terms=fixed(*map(_transpiration, BORES_MM)),
    signed=Signed("thermal transpiration", +1, ""),
    searched=True,
    at_most=10.0,
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
    terms=fixed(("time", lambda s: s.hours)),
    manual_changes=(resized_by(OTHER_GAUGE),),
)
REFERENCE_DRIFT = _OF_LINE(
    name="reference-drift",
    cause="the pressure controller's own gain drifts through the run",
    unit="psi/psi/h",
    size=size("ppm/h", "ppm"),
    against="elapsed_s",
    separate_by=_CHECKED,
    usual_size="1 ppm/h",
    terms=lambda data: slowly("P", lambda s: s.p, data, "psi/psi"),
    manual_changes=(resized_by(OTHER_GAUGE),),
)
LINE_LEAK = _OF_LINE(
    name="line-leak",
    cause="air leaks into the line, while a pressure settles or all through a whole plot",
    unit="psi/psi/h",
    size=each("psi/h for every psi below ambient"),
    against="elapsed_s",
    separate_by="close the controller off at the lowest pressure and watch the line",
    usual_size="1e-4 psi/h for every psi",
    terms=fixed(
        ("(14.7-P)*wait", lambda s: s.pull * s.waited_h),
        ("(14.7-P)*time in the whole plot", lambda s: s.pull * s.since_h),
    ),
    signed=Signed("leak", +1, "a pump between the controller and the transducers"),
)
HEAD_CORRECTION = _OF_LINE(
    name="head-correction",
    cause="the gas between the reference level and the transducers weighs, and more where it is cold; no correction "
    "was made for it, or one for another temperature",
    unit="m",
    size=each("m of air between reference and transducers"),
    against="sensor_temperature_degC",
    separate_by="raise the pressure controller by a metre, or correct for the height at the line's own temperature",
    usual_size="1.2e-4 of the pressure per metre in the room; of that only what the cold changes shows",
    known_aliases={
        "sensitivity-temperature": Alias(
            "always, but for the curve of 1/T, and all of it where P:T_sensor is declared",
            "raise the pressure controller by a metre",
        )
    },
    terms=fixed(("P/T_sensor", lambda s: s.weight_per_m)),
    at_most=HIGHEST_M,
    manual_changes=(),
)
REFERENCE_NONLINEARITY = _OF_LINE(
    name="reference-nonlinearity",
    cause="the pressure reference itself is not straight: all transducers show the same bend, in psi",
    unit="psi/psi^2, psi/psi^3",
    size=_BEND,
    against="pressure_psia",
    separate_by=SECOND_GAUGE,
    usual_size="1e-4 of the range",
    known_aliases={
        name: Alias("where the transducers happen to be alike, and always with a single one", SECOND_GAUGE)
        for name in ("pressure-second-order", "pressure-third-order")
    },
    terms=lambda _data: (
        PressureTerm("P^2", lambda s: s.p**2, unit="psi/psi^2"),
        PressureTerm("P^3", lambda s: s.p**3, unit="psi/psi^3"),
    ),
    on_suspicion=True,
    manual_changes=(resized_by(OTHER_GAUGE),),
)
