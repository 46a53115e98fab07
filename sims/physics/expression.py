"""Arithmetic in world files: the truth of a sensor as a function of named values.

Written on its own: truth shares no code with the models that are fitted to it. The text is Python arithmetic of
numbers, names, parentheses, `+ - * / **`, a sign, and a few functions; `^` is `**`. Nothing else is accepted, so that
nothing can run.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any

from rig.sims.physics.fields import WorldError

_FUNCTIONS: Mapping[str, tuple[Callable[..., float], int]] = {
    "log": (math.log, 1),
    "exp": (math.exp, 1),
    "sqrt": (math.sqrt, 1),
    "abs": (abs, 1),
    "sin": (math.sin, 1),
    "cos": (math.cos, 1),
    "tanh": (math.tanh, 1),
    "min": (min, 2),
    "max": (max, 2),
}
_BINARY: Mapping[type, Callable[[float, float], float]] = {
    ast.Add: lambda a, b: a + b,
    ast.Sub: lambda a, b: a - b,
    ast.Mult: lambda a, b: a * b,
    ast.Div: lambda a, b: a / b,
    ast.Pow: lambda a, b: a**b,
}
_LONGEST = 4000


@dataclass(frozen=True)
class Formula:
    """Arithmetic of named values.

    Attributes:
        text: as in the world file.
        names: of its variables.
    """

    text: str
    names: frozenset[str]
    tree: ast.expr

    @classmethod
    def parse(cls, text: str, where: str, known: Collection[str] | None = None) -> Formula:
        """Read arithmetic.

        Args:
            text: the formula.
            where: its place in the world file, for messages.
            known: possible variables; None for any.

        Raises:
            WorldError: it is no such arithmetic, or has an unknown variable.
        """
        if len(text) > _LONGEST:
            raise WorldError(f"{where} has more than {_LONGEST} characters")
        try:
            tree = ast.parse(text.replace("^", "**"), mode="eval").body
            names = frozenset(_names(tree))
        except (SyntaxError, ValueError, RecursionError) as error:
            raise WorldError(f"{where} = {text!r:.80} is no arithmetic: {error}") from None
        unknown = sorted(names - set(names if known is None else known))
        if unknown:
            raise WorldError(f"{where}: {unknown[0]} is not known here; there are {', '.join(sorted(known or ()))}")
        return cls(text, names, tree)

    def value(self, given: Mapping[str, float]) -> float:
        """Its value. Raises `WorldError` where it is undefined."""
        try:
            found = _value(self.tree, given)
            if isinstance(found, complex) or not math.isfinite(found):
                raise ValueError("it is not a finite number")
        except (ArithmeticError, ValueError) as error:
            at = ", ".join(f"{name} = {given[name]:g}" for name in sorted(self.names))
            raise WorldError(f"{self.text!r:.80} has no value at {at}: {error}") from None
        return float(found)


def _names(node: ast.expr) -> list[str]:
    """Variables of an expression. Raises ValueError for anything but arithmetic."""
    match node:
        case ast.Constant(value=bool()):
            raise ValueError("it has true or false in it")
        case ast.Constant(value=int() | float()):
            return []
        case ast.Name(id=name):
            return [name]
        case ast.UnaryOp(op=ast.UAdd() | ast.USub(), operand=inner):
            return _names(inner)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
            return [*_names(left), *_names(right)]
        case ast.Call(func=ast.Name(id=name), args=inside, keywords=[]) if name in _FUNCTIONS:
            wanted = _FUNCTIONS[name][1]
            if len(inside) != wanted:
                raise ValueError(f"{name}() takes {wanted} value{'s' * (wanted > 1)}")
            return [found for one in inside for found in _names(one)]
    raise ValueError(f"`{ast.unparse(node):.40}` is not possible here")


def _value(node: ast.expr, given: Mapping[str, float]) -> Any:
    match node:
        case ast.Constant(value=value):
            return float(value)  # type: ignore[arg-type]  # a number, as was checked
        case ast.Name(id=name):
            return given[name]
        case ast.UnaryOp(op=op, operand=inner):
            return -_value(inner, given) if isinstance(op, ast.USub) else _value(inner, given)
        case ast.BinOp(left=left, op=op, right=right):
            return _BINARY[type(op)](_value(left, given), _value(right, given))
        case ast.Call(func=ast.Name(id=name), args=inside):
            return _FUNCTIONS[name][0](*(_value(one, given) for one in inside))
    raise AssertionError(node)
