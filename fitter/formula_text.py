"""Parsing the text of a formula into its terms. The grammar is described in `rig.fitter.formula`."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import cached_property

from rig.fitter.arithmetic import COMPARISONS, FUNCTIONS, Expression, quoted
from rig.fitter.arithmetic_text import Arithmetic, FormulaError

_WHOLE = re.compile(r"[0-9]{1,2}")
_MOST_TERMS, _HIGHEST = 400, 20
_HINTS = {"/": "division goes inside I()"} | dict.fromkeys(COMPARISONS, "comparisons go inside I()")


@dataclass(frozen=True)
class Numeric:
    """A factor with one column. Factors with the same text are one factor."""

    text: str
    expression: Expression = field(compare=False, repr=False)

    @property
    def names(self) -> tuple[str, ...]:
        """Its variables."""
        return self.expression.names


@dataclass(frozen=True)
class Category:
    """A factor with a column for each level of a variable."""

    name: str

    @property
    def text(self) -> str:
        """Its text."""
        return f"C({quoted(self.name)})"

    @property
    def names(self) -> tuple[str, ...]:
        """Its variables."""
        return (self.name,)


Factor = Numeric | Category


@dataclass(frozen=True)
class Term:
    """A product of factors, each once; without factors it is the constant."""

    factors: tuple[Factor, ...] = ()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Term) and set(self.factors) == set(other.factors)

    def __hash__(self) -> int:
        return hash(frozenset(self.factors))

    def __len__(self) -> int:
        return len(self.factors)

    def __str__(self) -> str:
        return ":".join(f.text for f in self.factors) if self.factors else "1"

    def times(self, other: Term) -> Term:
        """Their product; a factor in both occurs once."""
        return Term(tuple(dict.fromkeys(self.factors + other.factors)))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Its variables."""
        return tuple(dict.fromkeys(name for f in self.factors for name in f.names))

    @property
    def numeric(self) -> tuple[Numeric, ...]:
        """Its numeric factors."""
        return tuple(f for f in self.factors if isinstance(f, Numeric))

    @property
    def categories(self) -> tuple[Category, ...]:
        """Its categories."""
        return tuple(f for f in self.factors if isinstance(f, Category))


def parse_terms(text: str) -> tuple[Term, ...]:
    """Terms of a formula, the intercept first if it has one, the others as written.

    Raises:
        FormulaError: it violates the grammar.
    """
    return _Terms(text).formula()


def numeric(expression: Expression) -> Numeric:
    """A factor; names, functions and whole powers of them do not need I()."""
    base = expression
    if expression.operation == "^" and expression.of[1].operation == "number" and _is_power(expression.of[1].of[0]):
        base = expression.of[0]
    bare = base.operation == "name" or base.operation in FUNCTIONS
    return Numeric(str(expression) if bare else f"I({expression})", expression)


def _is_power(number: float) -> bool:
    return number.is_integer() and 2 <= number <= _HIGHEST


class _Terms(Arithmetic):
    """The levels of the grammar above arithmetic."""

    _inside = False  # whether a term's own parentheses are open: messages about terms do not apply to arithmetic

    def formula(self) -> tuple[Term, ...]:
        self._check_length()
        terms = self._sum({Term(): None}, top=True)
        if self._peek.kind != "end":
            raise self._unexpected()
        return tuple(terms)

    def _sum(self, terms: dict[Term, None], *, top: bool) -> dict[Term, None]:
        sign = self._take("+", "-") or "+"
        while True:
            zero = self._peek if (self._peek.kind, self._peek.text) == ("number", "0") else None
            if zero is not None:
                if not top:
                    raise self._error("0 removes the intercept and must be outside parentheses")
                self._next += 1
                item, sign = {Term(): None}, "-" if sign == "+" else "+"
            else:
                item = self._star()
            for term in item:
                if sign == "+":
                    terms.setdefault(term)
                else:
                    terms.pop(term, None)
            if len(terms) > _MOST_TERMS:
                raise self._error(f"the formula has more than {_MOST_TERMS} terms")
            taken = self._take("+", "-")
            if taken is None:
                return dict.fromkeys(sorted(terms, key=lambda term: len(term) > 0))
            sign = taken

    def _star(self) -> dict[Term, None]:
        left = self._product()
        while self._take("*"):
            right = self._product()
            left = left | right | self._interactions(left, right)
        return left

    def _product(self) -> dict[Term, None]:
        left = self._power()
        while self._take(":"):
            left = self._interactions(left, self._power())
        return left

    def _interactions(self, left: dict[Term, None], right: dict[Term, None]) -> dict[Term, None]:
        if len(left) * len(right) > _MOST_TERMS**2:
            raise self._error(f"the formula has more than {_MOST_TERMS} terms")
        return dict.fromkeys(a.times(b) for a in left for b in right)

    def _power(self) -> dict[Term, None]:
        base = self._atom()
        while self._take("^"):
            token = self._peek
            if token.kind != "number" or not _WHOLE.fullmatch(token.text) or not 1 <= int(token.text) <= _HIGHEST:
                raise self._error(f"a power is a whole number from 1 to {_HIGHEST}; others go inside I()")
            self._next += 1
            base = self._raised(base, int(token.text), token.at)
        return base

    def _raised(self, base: dict[Term, None], power: int, at: int) -> dict[Term, None]:
        if power == 1:
            return base
        if len(base) == 1:
            (term,) = base
            if term.categories:
                raise FormulaError(f"{term} is a category and has no powers", self._text, at)
            exponent = Expression("number", (float(power),))
            raised = [numeric(Expression("^", (f.expression, exponent))) for f in term.numeric]
            return {Term(tuple(raised)): None}
        out = base
        for _ in range(power - 1):
            out = out | self._interactions(out, base)
        return out

    def _atom(self) -> dict[Term, None]:
        token = self._peek
        if (token.kind, token.text) == ("number", "1"):
            self._next += 1
            return {Term(): None}
        if (token.kind, token.text) == ("mark", "("):
            self._open()
            inside = self._sum({}, top=False)
            self._close()
            return inside
        if token.is_name:
            return {Term((self._factor(),)): None}
        if token.kind == "number":
            raise self._error("numbers other than 0 and 1 go inside I()")
        raise self._unexpected()

    def _factor(self) -> Factor:
        token, self._operations = self._peek, 0
        if not self._is_call:
            return numeric(self._value())
        if token.text == "C":
            return self._category()
        self._inside = True
        if token.text == "I":
            self._next += 1
            inside = self._value()
        else:
            functions = ", ".join(f"{name}()" for name in FUNCTIONS)
            inside = self._call(f"there is no function {token.text}, only C(), I(), {functions}")
        self._inside = False
        if not inside.names:
            raise FormulaError("there is no variable in it", self._text, token.at)
        return numeric(inside)

    def _category(self) -> Category:
        self._next += 1
        self._open()
        name = self._peek
        if not name.is_name:
            raise self._error("C() takes the name of one variable")
        self._next += 1
        self._close()
        return Category(name.text)

    def _surprise(self) -> str:
        hint = None if self._inside or self._peek.kind != "mark" else _HINTS.get(self._peek.text)
        return hint or super()._surprise()
