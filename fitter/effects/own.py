"""A laboratory's own effects, written as formulas in a TOML text; they join the catalogues without touching them.

    [[effect]]
    name = "draught"
    cause = "a draught from the door cools one side of the package while it looks there"
    scope = "sensor"                    # or "package": one coefficient in degrees or volts for all sensors
    stratum = "between-point"           # or "point-by-replication", for what varies with time, temperature or side
    unit = "V"
    columns = ["exp(cos(pitch))*sin(3*roll)"]
    separate_by = "close the door"
    usual_size = "1e-5 V"

An effect of pressure transducers has the stratum "whole-plot" or "subplot", and the scope "sensor" (columns are mV for
a coefficient of one) or "line" (psi, in all transducers):

    stratum = "subplot"
    unit = "mV"
    columns = ["sin(6.2832*P)"]

A column may use the names in `NAMES`, for transducers `PRESSURE_NAMES`, and the arithmetic of `fitter.formula`.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from typing import Any, Literal

import numpy as np

from fitter.arrays import FloatArray
from fitter.effects.effect import Effect, Scene, Term, fixed
from fitter.effects.own_formula import OwnFormula
from fitter.effects.pressure_scene import PressureEffect, PressureScene, PressureTerm
from fitter.effects.sizes import each
from fitter.errors import FitError

NAMES: Mapping[str, Callable[[Scene, str], FloatArray]] = {
    "pitch": lambda scene, _sensor: scene.pitch,
    "roll": lambda scene, _sensor: scene.rolled,
    "temperature": lambda scene, _sensor: scene.warmth(),
    "hours": lambda scene, _sensor: scene.hours(),
    "gravity": lambda scene, sensor: scene.along(sensor),
    "g_x": lambda scene, _sensor: scene.g[:, 0],
    "g_y": lambda scene, _sensor: scene.g[:, 1],
    "g_z": lambda scene, _sensor: scene.g[:, 2],
    "volts": lambda scene, sensor: scene.volts(sensor),
    "volts_per_deg_pitch": lambda scene, sensor: scene.per_pitch(sensor),
    "volts_per_deg_roll": lambda scene, sensor: scene.per_roll(sensor),
    "pitch_side": lambda scene, _sensor: scene.data.pitch_side.astype(np.float64),
    "roll_side": lambda scene, _sensor: scene.data.roll_side.astype(np.float64),
    "previous_pitch": lambda scene, _sensor: np.radians(scene.data.previous_pitch_deg),
    "previous_roll": lambda scene, _sensor: np.radians(scene.data.previous_roll_deg),
}
"""What a column may be computed from: angles in rad, degC and hours from the middle of the run, g, V."""
PRESSURE_NAMES: Mapping[str, Callable[[PressureScene], FloatArray]] = {
    "P": lambda scene: scene.p,
    "T_sensor": lambda scene: scene.sensor,
    "T_SSE": lambda scene: scene.sse,
    "hours": lambda scene: scene.hours,
    "since": lambda scene: scene.since_h,
    "step": lambda scene: scene.change_psia,
    "side": lambda scene: scene.data.pressure_side.astype(np.float64),
}
"""The same of pressure transducers: psia, degC from the run's mean, hours from its middle and from the first reading of
a whole plot, the last step of pressure and its sign."""
_NEEDS = {"temperature": "temperature", "roll": "roll", "pitch_side": "pitch sides", "roll_side": "roll sides"}
_WORDS = ("name", "cause", "scope", "stratum", "unit", "columns", "separate_by", "usual_size")
_ATTITUDE, _PRESSURE = ("between-point", "point-by-replication"), ("whole-plot", "subplot")


def own_effects(text: str) -> tuple[Effect | PressureEffect, ...]:
    """Effects written in TOML.

    Raises:
        FitError: it is no TOML, a field is missing or unknown, or a column is no formula; the message says which.

    """
    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise FitError(f"it is no TOML: {error}") from error
    except RecursionError:
        raise FitError("it is nested too deeply to be a file of effects") from None
    if set(tables) != {"effect"} or not isinstance(tables["effect"], list):
        raise FitError("a file of effects has [[effect]] tables and nothing else")
    return tuple(_effect(table) for table in tables["effect"])


def _effect(table: Any) -> Effect | PressureEffect:
    if not isinstance(table, Mapping):
        raise FitError(f"an effect is a table, [[effect]], not {table!r:.40}")
    name = table.get("name", "without a name")
    if set(table) != set(_WORDS):
        wrong = sorted(set(table) ^ set(_WORDS))
        raise FitError(f"effect {name}: missing or unknown: {', '.join(wrong)}; it has {', '.join(_WORDS)}")
    for field in _WORDS:
        if field != "columns" and (not isinstance(table[field], str) or not table[field]):
            raise FitError(f"effect {name}: {field} is a text, not {table[field]!r:.40}")
    if not isinstance(table["columns"], list) or not table["columns"]:
        raise FitError(f"effect {name}: columns is a list of formulas, not {table['columns']!r:.40}")
    of_pressure = table["stratum"] in _PRESSURE
    scopes = ("sensor", "line") if of_pressure else ("sensor", "package")
    for field, allowed in (("stratum", (*_ATTITUDE, *_PRESSURE)), ("scope", scopes)):
        if table[field] not in allowed:
            raise FitError(f"effect {name}: {field} is {' or '.join(allowed)}, not {table[field]!r}")
    names = PRESSURE_NAMES if of_pressure else NAMES
    formulas = [OwnFormula.of(name, column, names) for column in table["columns"]]
    given: dict[str, Any] = {key: table[key] for key in _WORDS if key != "columns"}
    given |= {"size": each(table["unit"]), "known_aliases": {}, "own": True}
    if of_pressure:
        columns = tuple(PressureTerm(formula.text, _of_pressure(formula)) for formula in formulas)
        where: Literal["line", "sensor"] = "line" if table["scope"] == "line" else "sensor"
        against = "pressure_psia" if table["stratum"] == "subplot" else "elapsed_s"
        return PressureEffect(**given, source=where, against=against, terms=lambda _data: columns)
    return Effect(
        **given,
        source="package" if table["scope"] == "package" else "sensor",
        against="pitch_deg" if table["stratum"] == "between-point" else "elapsed_s",
        terms=fixed(*(Term(formula.text, _of_attitude(formula)) for formula in formulas)),
        needs=tuple(need for word, need in _NEEDS.items() if any(word in formula.used for formula in formulas)),
    )


def _of_attitude(formula: OwnFormula) -> Callable[[Scene, str], FloatArray]:
    return lambda scene, sensor: formula.column(lambda name: NAMES[name](scene, sensor), len(scene.data))


def _of_pressure(formula: OwnFormula) -> Callable[[PressureScene], FloatArray]:
    return lambda scene: formula.column(lambda name: PRESSURE_NAMES[name](scene), len(scene.data))
