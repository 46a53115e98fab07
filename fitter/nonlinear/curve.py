"""A response as a function of columns and of parameters, with its derivatives."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from rig.fitter.arithmetic import Expression
from rig.fitter.arithmetic_text import parse_expression
from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.fitter.formula import RowError

_STEP = 1e-30
"""Imaginary step of a derivative; its relative error is of the size of rounding."""


class Curve(Protocol):
    """A response as a function of columns and parameters. A `rig.fitter.formula.Formula` is linear in them."""

    @property
    def names(self) -> tuple[str, ...]:
        """Required columns."""

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the k parameters."""

    @property
    def has_categories(self) -> bool:
        """Whether a column is a category."""

    def at(self, b: Sequence[Any], table: Mapping[str, Any]) -> Any:
        """(n,) values, of complex numbers too; a parameter is a number or (n,). Not finite where it is undefined."""

    def value(self, b: FloatArray, table: Mapping[str, FloatArray]) -> FloatArray:
        """(n,) response for (k,) parameters. Raises `FitError` where it is not finite."""

    def rows(self, b: FloatArray, table: Mapping[str, FloatArray]) -> FloatArray:
        """(n, k) derivative of the response by the parameters."""

    def slope(self, b: FloatArray, table: Mapping[str, FloatArray], name: str) -> FloatArray:
        """(n,) derivative of the response by a column."""


class ByStep(ABC):
    """A curve whose derivatives follow from its values by a complex step (Squire and Trapp, SIAM Review 40, 1998)."""

    has_categories = False

    @property
    @abstractmethod
    def names(self) -> tuple[str, ...]:
        """Required columns."""

    @property
    @abstractmethod
    def parameters(self) -> tuple[str, ...]:
        """Names of the k parameters."""

    @abstractmethod
    def at(self, b: Sequence[Any], table: Mapping[str, Any]) -> Any:
        """(n,) values, of complex numbers too; a parameter is a number or (n,)."""

    def value(self, b: FloatArray, table: Mapping[str, FloatArray]) -> FloatArray:
        """(n,) response for (k,) parameters. Raises `FitError` where it is not finite."""
        with np.errstate(all="ignore"):
            found = np.asarray(self.at(b.tolist(), table), np.float64)
        y = np.broadcast_to(found, (_count(self.names, table),))
        bad = np.flatnonzero(~np.isfinite(y))
        if bad.size:
            where = ", ".join(f"{name} = {table[name][bad[0]]:g}" for name in self.names)
            raise RowError(f"the curve {self} is not a finite number in", int(bad[0]), f", where {where}")
        return y

    def rows(self, b: FloatArray, table: Mapping[str, FloatArray]) -> FloatArray:
        """(n, k) derivative of the response by the parameters."""
        columns = np.empty((_count(self.names, table), len(b)))
        for j in range(len(b)):
            stepped: list[Any] = b.tolist()
            stepped[j] = np.array(complex(stepped[j], _STEP))
            with np.errstate(all="ignore"):
                columns[:, j] = np.imag(self.at(stepped, table)) / _STEP
        return columns

    def slope(self, b: FloatArray, table: Mapping[str, FloatArray], name: str) -> FloatArray:
        """(n,) derivative of the response by a column."""
        stepped = {**table, name: np.asarray(table[name], np.float64) + 1j * _STEP}
        with np.errstate(all="ignore"):
            found = np.imag(self.at(b.tolist(), stepped)) / _STEP
        return np.broadcast_to(np.asarray(found, np.float64), (_count(self.names, table),))


@dataclass(frozen=True)
class WrittenCurve(ByStep):
    """Arithmetic of columns and named parameters: `a * exp(-b * x)`.

    Attributes:
        expression: of both.
        named: names of the parameters, in order.
    """

    expression: Expression
    named: tuple[str, ...]

    @staticmethod
    def parse(text: str, named: Sequence[str]) -> WrittenCurve:
        """Read the arithmetic of `rig.fitter.formula`.

        Raises:
            FormulaError: it violates the grammar.
            FitError: a parameter is not in it.
        """
        expression = parse_expression(text)
        absent = [name for name in named if name not in expression.names]
        if absent:
            raise FitError(f"{text} has no parameter {', '.join(absent)}; its names are {', '.join(expression.names)}")
        return WrittenCurve(expression, tuple(named))

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the k parameters."""
        return self.named

    @property
    def names(self) -> tuple[str, ...]:
        """Required columns."""
        return tuple(name for name in self.expression.names if name not in self.named)

    def at(self, b: Sequence[Any], table: Mapping[str, Any]) -> Any:
        """(n,) values, of complex numbers too; a parameter is a number or (n,)."""
        given = {name: table[name] for name in self.names}
        return self.expression.value({**given, **{n: np.asarray(v) for n, v in zip(self.named, b, strict=True)}})

    def __str__(self) -> str:
        return str(self.expression)


@dataclass(frozen=True, eq=False)
class Each:
    """A curve with parameters of their own at each of n rows; its results are not finite where it is undefined.

    Attributes:
        curve: of k parameters.
        b: (n, k) parameters, or (k,) of all rows.
        table: (n,) columns by name.
    """

    curve: Curve
    b: FloatArray
    table: Mapping[str, FloatArray]

    def value(self) -> FloatArray:
        """(n,) response."""
        return np.asarray(self._all(self.curve.at(self._given(), self.table)), np.float64)

    def slope(self, name: str) -> FloatArray:
        """(n,) derivative of the response by a column."""
        return self._derivative(self._given(), {**self.table, name: self.table[name] + 1j * _STEP})

    def rows(self) -> FloatArray:
        """(n, k) derivative of the response by the parameters."""
        given = self._given()
        stepped = [[*given[:j], given[j] + 1j * _STEP, *given[j + 1 :]] for j in range(len(given))]
        return np.column_stack([self._derivative(b, self.table) for b in stepped])

    def _given(self) -> list[Any]:
        return list(np.moveaxis(self.b, -1, 0))

    def _derivative(self, b: Sequence[Any], table: Mapping[str, Any]) -> FloatArray:
        with np.errstate(all="ignore"):
            return np.asarray(self._all(np.imag(self.curve.at(b, table)) / _STEP), np.float64)

    def _all(self, found: Any) -> Any:
        return np.broadcast_to(found, (len(next(iter(self.table.values()))),))


def _count(names: Sequence[str], table: Mapping[str, Any]) -> int:
    return len(table[names[0]]) if names else len(next(iter(table.values())))
