"""Model terms written as a formula, in a small grammar of our own: nothing in it can run code.

    1 + P + T_sensor + P:T_sensor + P^2        the intercept is implied; 0 or -1 takes it away
    (P + T_sensor + T_SSE)^2                   all of them and their products up to two at a time
    a * b                                      a + b + a:b
    C(block)                                   categories, each against the first (treatment coding)
    `Load cell (kN)`                           a name that is more than letters, digits, _ and dots
    log(P), max(P, 0.1), I(P / (P + 0.1))      functions of arithmetic, and arithmetic

From loosest to tightest: `+ -`, `*`, `:`, `^`. As in R and its relatives a product of a variable with itself is that
variable, and a sum to a power gives products, not squares. Unlike there, *one* variable to a power is its square, cube
and so on: `P^2` means `I(P^2)`, which is what everybody who writes it intends. Terms are ordered by how many factors
they have, then as written. A category loses its first level wherever the model already holds what that column says.

Arithmetic, inside I() and functions and in the columns of a laboratory's own effects, has numbers, names, parentheses,
the functions of one value `log exp sqrt abs sign sin cos` (rad) and of two `min max`, and from loosest to tightest
`< <= > >= == !=` (1 where it holds, else 0; they do not follow each other), `+ -`, `* /`, a sign, `^` (from the right).
Everywhere `**` is `^`. docs/reference/formulas.md has all of it with examples.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, permutations, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rig.fitter.arithmetic_text import FormulaError
from rig.fitter.arrays import FloatArray
from rig.fitter.double_double import DoubleDouble
from rig.fitter.errors import FitError
from rig.fitter.formula_text import Category, Numeric, Term, parse_terms

__all__ = ["Formula", "FormulaError", "RowError", "Term"]

Table = Mapping[str, NDArray[Any]]
Levels = Mapping[str, Sequence[Any]]

_STEP = 1e-30
"""Imaginary step of a derivative, in the unit of the variable; the derivative's relative error is its square."""
_LARGEST = 1e120
"""Largest size of a value of a fitted column: sums of squares of such values are doubles."""


_NUMBER = re.compile(r"[-+]?\d[\d.,']*(?:[eE][-+]?\d+)?")


class RowError(FitError):
    """An invalid value of one row for the formula.

    Attributes:
        index: index of the row, from 0. The message has its number in a file whose header is row 1.
    """

    def __init__(self, before: str, index: int, after: str, row: int | None = None) -> None:
        super().__init__(f"{before} row {index + 2 if row is None else row}{after}")
        self.index, self._words = index, (before, after)

    def at(self, row: int) -> RowError:
        """This error with another number for its row."""
        return RowError(self._words[0], self.index, self._words[1], row)


@dataclass(frozen=True)
class Formula:
    """Terms of a linear model.

    Attributes:
        terms: in the order of their columns; the term without factors is the intercept.
    """

    terms: tuple[Term, ...]

    @staticmethod
    def parse(text: str) -> Formula:
        """Read a formula.

        Raises:
            FormulaError: it violates the grammar; the message marks the place.

        Example:
            >>> str(Formula.parse("1 + force_kN*temperature_degC"))
            '1 + force_kN + temperature_degC + force_kN:temperature_degC'
        """
        return Formula(tuple(sorted(parse_terms(text), key=len)))

    def __str__(self) -> str:
        written = [str(term) for term in self.terms]
        return " + ".join(written if self.has_intercept else ["0", *written])

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the required variables, in order of their first use."""
        return tuple(dict.fromkeys(name for term in self.terms for name in term.names))

    @property
    def has_intercept(self) -> bool:
        """Whether the constant is one of the terms."""
        return Term() in self.terms

    @property
    def has_categories(self) -> bool:
        """Whether a term contains a category."""
        return any(term.categories for term in self.terms)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the coefficients of a model without categories. A formula is a `rig.fitter.nonlinear.Curve`."""
        return tuple(map(str, self.terms))

    def at(self, b: Sequence[Any], table: Mapping[str, Any]) -> Any:
        """(n,) values of a model without categories; see `rig.fitter.nonlinear.Curve`."""
        total: Any = np.zeros(_count(self.names, table))
        with np.errstate(all="ignore"):
            for coefficient, term in zip(b, self.terms, strict=True):
                part = coefficient
                for f in term.numeric:
                    part = part * f.expression.value(table)
                total = total + part
        return total

    def value(self, b: FloatArray, table: Table) -> FloatArray:
        """(n,) response for (k,) coefficients. Errors as for `columns`."""
        return np.asarray(self.columns(table)[1] @ b)

    def rows(self, b: FloatArray, table: Table) -> FloatArray:
        """(n, k) derivative of the response by the coefficients. Errors as for `columns`."""
        return self.columns(table)[1]

    def slope(self, b: FloatArray, table: Table, name: str) -> FloatArray:
        """(n,) derivative of the response by a column of a model without categories."""
        return np.asarray(self.derivative(table, name) @ b)

    def plus(self, *terms: Term) -> Formula:
        """These terms too."""
        return Formula(tuple(sorted(dict.fromkeys(self.terms + terms), key=len)))

    def without(self, *terms: Term) -> Formula:
        """All terms but these."""
        return Formula(tuple(term for term in self.terms if term not in terms))

    def levels(self, table: Table) -> dict[str, tuple[Any, ...]]:
        """Levels of every category in `table`, ascending; `columns` of another table needs them to match this one."""
        names = dict.fromkeys(category.name for term in self.terms for category in term.categories)
        return {name: tuple(np.unique(_given(name, table)).tolist()) for name in names}

    def columns(self, table: Table, levels: Levels | None = None) -> tuple[tuple[str, ...], FloatArray]:
        """Names and (n, k) values of the columns.

        Args:
            table: (n,) arrays by name.
            levels: of the categories, if `table` may not contain all; by default those of `table`.

        Raises:
            KeyError: the table lacks a variable.
            FitError: a value is not finite (the logarithm of a negative number, say), is text instead of a number, or
                is not one of the `levels`.
        """
        values = {f: _numbers(f, table) for f in self._numeric}
        names, columns = self._products(values, table, levels)
        return names, np.column_stack(columns) if columns else np.empty((_count(self.names, table), 0))

    def exact_columns(self, table: Table, levels: Levels | None = None) -> tuple[tuple[str, ...], DoubleDouble]:
        """`columns` with twice the digits; the values in `table` count as exact.

        Rounding of x^10 to a double can change the coefficients of a polynomial in their eighth digit. Arguments and
        errors as for `columns`.
        """
        names, rounded = self.columns(table, levels)
        given = {name: DoubleDouble.of(table[name]) for f in self._numeric for name in f.names}
        with np.errstate(all="ignore"):  # beyond 1e300 there are no further digits: the rounded column is used
            values = {f: f.expression.value(given) for f in self._numeric}
            exact = [DoubleDouble.of(0.0) + column for column in self._products(values, table, levels)[1]]
        if not exact:
            return names, DoubleDouble.of(rounded)
        hi, lo = np.column_stack([c.hi for c in exact]), np.column_stack([c.lo for c in exact])
        known = np.isfinite(hi) & np.isfinite(lo)
        return names, DoubleDouble(np.where(known, hi, rounded), np.where(known, lo, 0.0))

    def derivative(self, table: Table, name: str) -> FloatArray:
        """(n, k) derivatives of the columns with respect to the variable `name`; for a model without categories.

        Exact to rounding: by a complex step, without differences.
        """
        count = _count(self.names, table)
        stepped = {**table, name: np.asarray(table[name], np.float64) + 1j * _STEP}
        columns = []
        for term in self.terms:
            value = np.ones(count, np.complex128)
            for f in term.numeric:
                value = value * f.expression.value(stepped)
            columns.append(value.imag / _STEP)
        return np.column_stack(columns) if columns else np.empty((count, 0))

    @cached_property
    def _numeric(self) -> tuple[Numeric, ...]:
        return tuple(dict.fromkeys(f for term in self.terms for f in term.numeric))

    def _products(
        self, values: Mapping[Numeric, Any], table: Table, levels: Levels | None
    ) -> tuple[tuple[str, ...], list[Any]]:
        """Names of the columns and their products, in the arithmetic of `values`."""
        levels = self.levels(table) if levels is None else levels
        categories = dict.fromkeys(f for term in self.terms for f in term.categories)
        members = {f: _members(f, table, levels[f.name]) for f in categories}
        names, columns = [], []
        for term, coded in self._coded():
            number: Any = np.ones(_count(self.names, table))
            for f in term.numeric:
                number = number * values[f]
            shown = [range(0 if full else 1, len(levels[f.name])) for f, full in coded]
            for chosen in product(*shown):
                at = {f: i for (f, _), i in zip(coded, chosen, strict=True)}
                names.append(_name(term, {f: levels[f.name][i] for f, i in at.items()}))
                column = number
                for category, i in at.items():
                    column = column * members[category][:, i]
                columns.append(column)
        return tuple(names), columns

    def _coded(self) -> Iterator[tuple[Term, tuple[tuple[Category, bool], ...]]]:
        """Terms in parts, each with its categories and whether all their levels have a column, or all but the first.

        A term's span is that of the products of its categories' contrasts, subset by subset. Those of an earlier term
        with the same numeric factors are left out. Of the others, two that differ by one category are one part with all
        levels of that category.
        """
        held: dict[frozenset[Numeric], set[frozenset[Category]]] = {}
        for term in self.terms:
            known = held.setdefault(frozenset(term.numeric), set())
            sizes = range(len(term.categories) + 1)
            subsets = [frozenset(c) for size in sizes for c in combinations(term.categories, size)]
            parts: list[tuple[frozenset[Category], frozenset[Category]]] = []
            for contrasts in [s for s in subsets if s not in known]:
                parts.append((contrasts, frozenset()))
                parts = _joined(parts)
            known.update(subsets)
            for contrasts, full in parts:
                yield term, tuple((f, f in full) for f in term.categories if f in contrasts | full)


def _joined(
    parts: list[tuple[frozenset[Category], frozenset[Category]]],
) -> list[tuple[frozenset[Category], frozenset[Category]]]:
    """`parts` with pairs joined while one is another times the contrasts of one more category."""
    for (contrasts, full), (more, same) in permutations(parts, 2):
        extra = more - contrasts
        if full == same and contrasts < more and len(extra) == 1:
            rest = [part for part in parts if part not in ((contrasts, full), (more, same))]
            return _joined([*rest, (contrasts, full | extra)])
    return parts


def _name(term: Term, levels: Mapping[Category, Any]) -> str:
    shown = []
    for f in term.factors:
        if isinstance(f, Numeric):
            shown.append(f.text)
        elif f in levels:
            shown.append(f"{f.text}[{levels[f]}]")
    return ":".join(shown) or "1"


def _given(name: str, table: Table) -> NDArray[Any]:
    if name not in table:
        raise FitError(f"there is no variable {name}, only {', '.join(table)}")
    return np.asarray(table[name])


def _count(names: Sequence[str], table: Table) -> int:
    return len(_given(names[0] if names else next(iter(table)), table))


def check_sizes(names: Sequence[str], columns: FloatArray) -> None:
    """Refuse columns (n, k) with numbers whose squares overflow. Raises `RowError`: the row and what to do."""
    if not columns.size:
        return
    i, j = (int(at) for at in np.unravel_index(np.argmax(np.abs(columns)), columns.shape))
    if np.abs(columns[i, j]) > _LARGEST:
        said = f"{names[j]} is {columns[i, j]:g}, too large to compute with (more than {_LARGEST:g}), in"
        raise RowError(said, i, "; correct the cell or give the column in a larger unit")


def check_numbers(name: str, column: NDArray[Any]) -> None:
    """Refuse a column (n,) of text of which most are numbers: the error names the first row that is not."""
    words = [i for i, cell in enumerate(column.tolist()) if not _NUMBER.fullmatch(str(cell))]
    if column.dtype.kind == "U" and words and 2 * len(words) < len(column):
        cell = str(column[words[0]])[:40]
        raise RowError(f"{name} is {cell!r} in", words[0], ", which is not a number; correct or remove the row")


def _numbers(factor: Numeric, table: Table) -> FloatArray:
    given = {}
    for name in factor.names:
        column = _given(name, table)
        if column.dtype.kind not in "fiub":
            check_numbers(name, column)
            raise FitError(f"{name} is text; as a category it is C({name})")
        given[name] = column.astype(np.float64)
    value = np.asarray(factor.expression.value(given), np.float64)
    bad = np.flatnonzero(~np.isfinite(value))
    if bad.size:
        where = ", ".join(f"{name} = {column[bad[0]]:g}" for name, column in given.items())
        raise RowError(f"{factor.text} is not a finite number in", int(bad[0]), f", where {where}")
    return value


def _members(category: Category, table: Table, levels: Sequence[Any]) -> FloatArray:
    """(n, levels) one where a row is at that level."""
    column = _given(category.name, table)
    member = column[:, None] == np.asarray(levels)[None, :]
    strange = np.flatnonzero(~member.any(axis=1))
    if strange.size:
        first = int(strange[0])
        raise RowError(f"{category.text} is {column[first]} in", first, ", a level that the model does not have")
    return np.asarray(member, np.float64)
