"""Arithmetic of named values, for formulas and a laboratory's own effects. Its grammar is in `rig.fitter.formula`.

The operations take arrays of floats, `DoubleDouble` numbers, and complex arrays with a tiny imaginary step: their
imaginary part is the step times the derivative (Squire and Trapp, SIAM Review 40, 1998).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

NAME = r"[^\W\d][\w.]*"
"""Regular expression of a name that needs no back-ticks."""
BINDS = {"<": 1, "<=": 1, ">": 1, ">=": 1, "==": 1, "!=": 1, "+": 2, "-": 2, "*": 3, "/": 3, "neg": 4, "^": 5}
"""Precedence of operators; functions, names and numbers are not listed."""
COMPARISONS = tuple(mark for mark, binds in BINDS.items() if binds == BINDS["<"])
FUNCTIONS: Mapping[str, int] = {
    "log": 1,
    "exp": 1,
    "sqrt": 1,
    "abs": 1,
    "sign": 1,
    "sin": 1,
    "cos": 1,
    "min": 2,
    "max": 2,
}
"""Functions and their number of arguments; angles are in rad, `log` is the natural logarithm."""

_PLAIN = re.compile(NAME)
_OPERATIONS: Mapping[str, Callable[..., Any]] = {
    "+": np.add,
    "-": np.subtract,
    "*": np.multiply,
    "/": np.divide,
    "^": np.power,
    "neg": np.negative,
    "log": np.log,
    "exp": np.exp,
    "sqrt": np.sqrt,
    "abs": np.absolute,
    "sign": np.sign,
    "sin": np.sin,
    "cos": np.cos,
    "min": np.minimum,
    "max": np.maximum,
}
_BY_SIGN: Mapping[str, Callable[[Any], Any]] = {
    "<": lambda s: (s * s - s) * 0.5,
    ">": lambda s: (s * s + s) * 0.5,
    "<=": lambda s: (s * s + s) * -0.5 + 1.0,
    ">=": lambda s: (s * s - s) * -0.5 + 1.0,
    "==": lambda s: s * s * -1.0 + 1.0,
    "!=": lambda s: s * s,
}
"""Comparisons from the sign of the difference. It is NaN if an operand is, so undefined values stay undefined."""


@dataclass(frozen=True)
class Expression:
    """Arithmetic: an operation on expressions, a variable ("name", one argument) or a number ("number")."""

    operation: str
    of: tuple[Any, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Its variables, in order of their first use."""
        if self.operation in ("name", "number"):
            return self.of if self.operation == "name" else ()
        return tuple(dict.fromkeys(name for part in self.of for name in part.names))

    def value(self, table: Mapping[str, Any]) -> Any:
        """(n,) values, in the arithmetic of those in `table`; 0-d without variables.

        NaN where a function is undefined. For complex values the real part decides about the side of a comparison, of
        `abs` or of `max`, and whether a function is defined. At a kink the derivative is the right-hand one.
        """
        if self.operation == "name":
            return table[self.of[0]]
        if self.operation == "number":
            return np.asarray(self.of[0])
        given = [part.value(table) for part in self.of]
        with np.errstate(all="ignore"):
            if self.operation in _BY_SIGN:
                return _BY_SIGN[self.operation](_sign(np.subtract(*given)))
            if any(np.iscomplexobj(value) for value in given):
                return _stepped(self.operation, *given)
            return _OPERATIONS[self.operation](*given)

    def __str__(self) -> str:
        if self.operation == "name":
            return quoted(self.of[0])
        if self.operation == "number":
            return _shortest(self.of[0])
        if self.operation in FUNCTIONS:
            return f"{self.operation}({', '.join(map(str, self.of))})"
        if self.operation == "neg":
            return f"-{self._inner(0, BINDS['neg'])}"
        binds = BINDS[self.operation]
        one_side = self.operation == "^" or self.operation in COMPARISONS
        left, right = self._inner(0, binds + one_side), self._inner(1, binds + 1)
        return f"{left}^{right}" if self.operation == "^" else f"{left} {self.operation} {right}"

    def _inner(self, which: int, binds: int) -> str:
        part = self.of[which]
        return f"({part})" if BINDS.get(part.operation, 9) < binds else str(part)


def quoted(name: str) -> str:
    """A name in the notation of formulas: in back-ticks if it has characters other than letters, digits, _ and dots."""
    return name if _PLAIN.fullmatch(name) else "`" + name.replace("`", "``") + "`"


def _shortest(number: float) -> str:
    return f"{number:g}" if float(f"{number:g}") == number else repr(number)


def _sign(value: Any) -> Any:
    return np.sign(np.real(value) if np.iscomplexobj(value) else value)


def _stepped(operation: str, *given: Any) -> Any:
    """An operation on values of which at least one is complex."""
    if operation in ("+", "-", "*", "/", "neg", "exp", "sin", "cos", "min", "max"):
        return _OPERATIONS[operation](*given)  # min and max of complex values compare the real part, then the step
    if operation == "sign":
        return _sign(given[0])
    if operation == "abs":
        return np.maximum(given[0], -given[0])
    real = _OPERATIONS[operation](*map(np.real, given))
    if operation == "^":
        return np.where(np.isnan(real), np.nan, _stepped_power(real, *given))
    return np.where(np.isnan(real), np.nan, _OPERATIONS[operation](*given))


def _stepped_power(real: Any, base: Any, exponent: Any) -> Any:
    """A power; of a negative base by the chain rule, because its logarithm has an imaginary part."""
    a, c = np.real(base), np.real(exponent)
    change = np.where(c == 0.0, 0.0, c * np.power(a, c - 1.0)) * np.imag(base)
    change = np.where(np.imag(exponent) == 0.0, change, np.nan)
    return np.where(a < 0.0, real + 1j * change, np.power(base, exponent))
