"""Formulas of a laboratory's own effects: arithmetic on named quantities and nothing else; never executed as Python."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fitter.arrays import FloatArray
from fitter.errors import FitError

LONGEST = 500
"""Characters of a formula; longer ones are no one's physics."""
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


@dataclass(frozen=True)
class OwnFormula:
    """One column of an effect.

    Attributes:
        text: as written.
        tree: what it means.

    """

    text: str
    tree: ast.expr

    @classmethod
    def of(cls, effect: str, text: str, names: Collection[str]) -> OwnFormula:
        """Check a text: numbers, + - * / **, `FUNCTIONS` of one value, and `names`.

        Raises:
            FitError: naming the effect and what is not understood.

        """
        if not isinstance(text, str) or not 0 < len(text) <= LONGEST:
            raise FitError(f"effect {effect}: a column is a text of up to {LONGEST} characters, not {text!r:.40}")
        try:
            tree = ast.parse(text, mode="eval").body
        except SyntaxError as error:
            raise FitError(f"effect {effect}: {text!r} is no formula: {error.msg}") from error
        except (RecursionError, MemoryError, ValueError) as error:
            raise FitError(f"effect {effect}: {text!r:.40} is nested too deeply to be a formula") from error
        functions = {id(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}
        for node in ast.walk(tree):
            called = isinstance(node, ast.Name) and (node.id in (FUNCTIONS if id(node) in functions else names))
            number = isinstance(node, ast.Constant) and isinstance(node.value, int | float)
            call = isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in FUNCTIONS
            call = call and len(getattr(node, "args", ())) == 1 and not getattr(node, "keywords", ())
            if not (called or number or call or isinstance(node, (ast.BinOp, ast.UnaryOp, ast.Load, *_OPERATORS))):
                raise FitError(
                    f"effect {effect}: {ast.unparse(node) or type(node).__name__} in {text!r} is not understood; a "
                    f"column has numbers, + - * / **, {', '.join(FUNCTIONS)} of one value, and {', '.join(names)}"
                )
        return cls(text, tree)

    @property
    def used(self) -> frozenset[str]:
        """Names in it."""
        return frozenset(node.id for node in ast.walk(self.tree) if isinstance(node, ast.Name))

    def column(self, value_of: Callable[[str], FloatArray], n: int) -> FloatArray:
        """(n,) its values, given those of the names."""
        try:
            with np.errstate(all="ignore"):
                values = np.broadcast_to(_value(self.tree, value_of), (n,))
        except (ArithmeticError, RecursionError) as error:
            raise FitError(f"an effect's column {self.text!r} cannot be computed: {error}") from error
        if np.iscomplexobj(values) or not np.all(np.isfinite(values)):
            raise FitError(f"an effect's column {self.text!r} is not a finite number at every observation")
        return values.astype(np.float64)


def _value(node: ast.expr, value_of: Callable[[str], FloatArray]) -> Any:
    if isinstance(node, ast.Constant):
        assert isinstance(node.value, int | float)
        return float(node.value)
    if isinstance(node, ast.Name):
        return value_of(node.id)
    if isinstance(node, ast.Call):
        assert isinstance(node.func, ast.Name)
        return FUNCTIONS[node.func.id](_value(node.args[0], value_of))
    if isinstance(node, ast.UnaryOp):
        return _OPERATORS[type(node.op)](_value(node.operand, value_of))
    assert isinstance(node, ast.BinOp)
    return _OPERATORS[type(node.op)](_value(node.left, value_of), _value(node.right, value_of))
