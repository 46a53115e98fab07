"""A laboratory's own effects, written as formulas in a TOML text; they join the catalogue without touching it.

    [[effect]]
    name = "draught"
    cause = "a draught from the door cools one side of the package while it looks there"
    scope = "sensor"                    # or "package": one coefficient in degrees or volts for all sensors
    stratum = "between-point"           # or "point-by-replication", for what varies with time, temperature or side
    unit = "V"
    columns = ["exp(cos(pitch))*sin(3*roll)"]
    separate_by = "close the door"
    usual_size = "1e-5 V"

A column is volts for a coefficient of one. It may use the names in `NAMES`, numbers, + - * / **, and `FUNCTIONS`.
"""

from __future__ import annotations

import ast
import operator
import tomllib
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from fitter.arrays import FloatArray
from fitter.effects.effect import Effect, Scene, Term, fixed
from fitter.effects.sizes import each

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
"""What a column may be reckoned from: angles in rad, degC and hours from the middle of the run, g, V."""
FUNCTIONS: Mapping[str, Callable[[Any], Any]] = {
    "sin": np.sin,
    "cos": np.cos,
    "exp": np.exp,
    "sqrt": np.sqrt,
    "abs": np.abs,
    "sign": np.sign,
}
_OPERATORS: Mapping[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
}
_NEEDS = {"temperature": "temperature", "roll": "roll", "pitch_side": "pitch sides", "roll_side": "roll sides"}
_WORDS = ("name", "cause", "scope", "stratum", "unit", "columns", "separate_by", "usual_size")


def own_effects(text: str) -> tuple[Effect, ...]:
    """Effects written in TOML.

    Raises:
        ValueError: it is no TOML, a field is missing or unknown, or a column is no formula; the message says which.

    """
    tables = tomllib.loads(text)
    if set(tables) != {"effect"} or not isinstance(tables["effect"], list):
        raise ValueError("a file of effects has [[effect]] tables and nothing else")
    return tuple(_effect(table) for table in tables["effect"])


def _effect(table: Mapping[str, Any]) -> Effect:
    name = table.get("name", "without a name")
    if set(table) != set(_WORDS):
        wrong = sorted(set(table) ^ set(_WORDS))
        raise ValueError(f"effect {name}: missing or unknown: {', '.join(wrong)}; it has {', '.join(_WORDS)}")
    for field, allowed in (("scope", ("sensor", "package")), ("stratum", ("between-point", "point-by-replication"))):
        if table[field] not in allowed:
            raise ValueError(f"effect {name}: {field} is {' or '.join(allowed)}, not {table[field]!r}")
    formulas = [_formula(name, column) for column in table["columns"]]
    used = {node.id for formula in formulas for node in ast.walk(formula) if isinstance(node, ast.Name)}
    return Effect(
        name=name,
        cause=table["cause"],
        source="package" if table["scope"] == "package" else "sensor",
        scope=table["scope"],
        stratum=table["stratum"],
        unit=table["unit"],
        size=each(table["unit"]),
        against="pitch_deg" if table["stratum"] == "between-point" else "elapsed_s",
        separate_by=table["separate_by"],
        usual_size=table["usual_size"],
        known_aliases={},
        terms=fixed(*(_term(text, formula) for text, formula in zip(table["columns"], formulas, strict=True))),
        needs=tuple(need for word, need in _NEEDS.items() if word in used),
    )


def _formula(effect: str, text: str) -> ast.expr:
    try:
        formula = ast.parse(text, mode="eval").body
    except SyntaxError as error:
        raise ValueError(f"effect {effect}: {text!r} is no formula: {error.msg}") from error
    for node in ast.walk(formula):
        called = isinstance(node, ast.Name) and (node.id in NAMES or node.id in FUNCTIONS)
        number = isinstance(node, ast.Constant) and isinstance(node.value, int | float)
        call = isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in FUNCTIONS
        call = call and len(getattr(node, "args", ())) == 1 and not getattr(node, "keywords", ())
        if not (called or number or call or isinstance(node, (ast.BinOp, ast.UnaryOp, ast.Load, *_OPERATORS))):
            raise ValueError(
                f"effect {effect}: {ast.unparse(node) or type(node).__name__} in {text!r} is not understood; a column "
                f"has numbers, + - * / **, {', '.join(FUNCTIONS)} of one value, and {', '.join(NAMES)}"
            )
    return formula


def _term(text: str, formula: ast.expr) -> Term:
    def column(scene: Scene, sensor: str) -> FloatArray:
        return np.broadcast_to(_value(formula, scene, sensor), (len(scene.data),)).astype(np.float64)

    return Term(text, column)


def _value(node: ast.expr, scene: Scene, sensor: str) -> Any:
    if isinstance(node, ast.Constant):
        return node.value
    if isinstance(node, ast.Name):
        return NAMES[node.id](scene, sensor)
    if isinstance(node, ast.Call):
        assert isinstance(node.func, ast.Name)
        return FUNCTIONS[node.func.id](_value(node.args[0], scene, sensor))
    if isinstance(node, ast.UnaryOp):
        return _OPERATORS[type(node.op)](_value(node.operand, scene, sensor))
    assert isinstance(node, ast.BinOp)
    return _OPERATORS[type(node.op)](_value(node.left, scene, sensor), _value(node.right, scene, sensor))
