"""From the text of a formula to its terms. The grammar is described in `fitter.formula`."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fitter.errors import FitError

Values = NDArray[Any]

_TOKEN = re.compile(r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)|(?P<name>[^\W\d][\w.]*)|(?P<mark>\S))")
_WHOLE = re.compile(r"[0-9]{1,2}")
_DEEPEST, _MOST_TERMS, _HIGHEST, _MOST_OPERATIONS = 40, 400, 20, 200
_LONGEST = 20_000
_BINDS = {"+": 1, "-": 1, "*": 2, "/": 2, "neg": 3, "^": 4}
_HINTS = {"~": "the response is given by itself, not in the formula", "/": "division goes inside I()"}
_OPERATIONS: Mapping[str, Callable[..., Any]] = {
    "+": np.add,
    "-": np.subtract,
    "*": np.multiply,
    "/": np.divide,
    "^": np.power,
    "neg": np.negative,
    "log": np.log,
}


class FormulaError(FitError):
    """A formula that does not follow the grammar; the message points at the place."""

    def __init__(self, problem: str, text: str, at: int) -> None:
        super().__init__(f"{problem}\n  {text}\n  {' ' * at}^")


@dataclass(frozen=True)
class Expression:
    """Arithmetic: an operation on expressions, a variable ("name", one argument) or a number ("number")."""

    operation: str
    of: tuple[Any, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Variables in it, in the order they are used."""
        if self.operation in ("name", "number"):
            return self.of if self.operation == "name" else ()
        return tuple(dict.fromkeys(name for part in self.of for name in part.names))

    def value(self, table: Mapping[str, Any]) -> Any:
        """(n,) values, in the arithmetic of those in `table`: arrays, or what NumPy's functions take for one."""
        if self.operation == "name":
            return table[self.of[0]]
        if self.operation == "number":
            return np.asarray(self.of[0])
        with np.errstate(all="ignore"):
            return _OPERATIONS[self.operation](*(part.value(table) for part in self.of))

    def __str__(self) -> str:
        if self.operation == "name":
            return str(self.of[0])
        if self.operation == "number":
            return _shortest(self.of[0])
        if self.operation == "log":
            return f"log({self.of[0]})"
        if self.operation == "neg":
            return f"-{self._inner(0, _BINDS['neg'])}"
        binds = _BINDS[self.operation]
        left, right = self._inner(0, binds + (self.operation == "^")), self._inner(1, binds + 1)
        return f"{left}^{right}" if self.operation == "^" else f"{left} {self.operation} {right}"

    def _inner(self, which: int, binds: int) -> str:
        part = self.of[which]
        return f"({part})" if _BINDS.get(part.operation, 9) < binds else str(part)


@dataclass(frozen=True)
class Numeric:
    """A factor with one column. Factors that read alike are one factor."""

    text: str
    expression: Expression = field(compare=False, repr=False)

    @property
    def names(self) -> tuple[str, ...]:
        """Variables it needs."""
        return self.expression.names


@dataclass(frozen=True)
class Category:
    """A factor with a column for each level of a variable."""

    name: str

    @property
    def text(self) -> str:
        """As written."""
        return f"C({self.name})"

    @property
    def names(self) -> tuple[str, ...]:
        """Variables it needs."""
        return (self.name,)


Factor = Numeric | Category


@dataclass(frozen=True)
class Term:
    """A product of factors, each once; without any it is the constant."""

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
        """Their product; factors in both stand in it once."""
        return Term(tuple(dict.fromkeys(self.factors + other.factors)))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Variables it needs."""
        return tuple(dict.fromkeys(name for f in self.factors for name in f.names))

    @property
    def numeric(self) -> tuple[Numeric, ...]:
        """Its numeric factors."""
        return tuple(f for f in self.factors if isinstance(f, Numeric))

    @property
    def categories(self) -> tuple[Category, ...]:
        """Its categories."""
        return tuple(f for f in self.factors if isinstance(f, Category))


@dataclass(frozen=True)
class _Token:
    kind: str
    text: str
    at: int


def parse_terms(text: str) -> tuple[Term, ...]:
    """Terms of a formula, the intercept first if it has one, the others as written.

    Raises:
        FormulaError: it does not follow the grammar.

    """
    return _Parser(text).formula()


def numeric(expression: Expression) -> Numeric:
    """A factor; powers of one variable and logarithms are written without I()."""
    bare = expression.operation in ("name", "log") or (
        expression.operation == "^"
        and expression.of[0].operation in ("name", "log")
        and expression.of[1].operation == "number"
    )
    return Numeric(str(expression) if bare else f"I({expression})", expression)


def _shortest(number: float) -> str:
    return f"{number:g}" if float(f"{number:g}") == number else repr(number)


class _Parser:
    """Recursive descent, one method a level of the grammar."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._tokens = [
            _Token(m.lastgroup or "", m[m.lastgroup or 0], m.start(m.lastgroup or 0)) for m in _TOKEN.finditer(text)
        ]
        self._tokens.append(_Token("end", "the end", len(text.rstrip())))
        self._next = 0
        self._depth = 0
        self._operations = 0

    def formula(self) -> tuple[Term, ...]:
        if self._peek.kind == "end":
            raise self._error("the formula is empty")
        if len(self._text) > _LONGEST:
            raise FormulaError(f"the formula has more than {_LONGEST:,} characters", self._text[:60], 60)
        terms = self._sum({Term(): None}, top=True)
        if self._peek.kind != "end":
            raise self._unexpected()
        return tuple(terms)

    def _sum(self, terms: dict[Term, None], *, top: bool) -> dict[Term, None]:
        sign = self._take("+", "-") or "+"
        while True:
            zero = self._peek if self._peek.text == "0" else None
            if zero is not None:
                if not top:
                    raise self._error("0 takes the intercept away and stands outside parentheses")
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
        if token.text == "1":
            self._next += 1
            return {Term(): None}
        if token.text == "(":
            self._open()
            inside = self._sum({}, top=False)
            self._close()
            return inside
        if token.kind == "name":
            return {Term((self._factor(),)): None}
        if token.kind == "number":
            raise self._error("numbers other than 0 and 1 go inside I()")
        raise self._unexpected()

    def _factor(self) -> Factor:
        token, self._operations = self._peek, 0
        function = self._tokens[self._next + 1].text == "("
        if not function or token.text == "log":
            return numeric(self._arithmetic_atom())
        if token.text not in ("C", "I"):
            raise self._error(f"there is no function {token.text}, only C(), I() and log()")
        self._next += 1
        self._open()
        if token.text == "I":
            inside = self._arithmetic()
            self._close()
            if not inside.names:
                raise FormulaError("there is no variable in it", self._text, token.at)
            return numeric(inside)
        name = self._peek
        if name.kind != "name":
            raise self._error("C() takes the name of one variable")
        self._next += 1
        self._close()
        return Category(name.text)

    def _arithmetic(self) -> Expression:
        left = self._scaled()
        while sign := self._take("+", "-"):
            self._operation()
            left = Expression(sign, (left, self._scaled()))
        return left

    def _scaled(self) -> Expression:
        left = self._signed()
        while sign := self._take("*", "/"):
            self._operation()
            left = Expression(sign, (left, self._signed()))
        return left

    def _signed(self) -> Expression:
        if sign := self._take("+", "-"):
            self._deeper()
            inner = self._signed()
            self._depth -= 1
            return inner if sign == "+" else Expression("neg", (inner,))
        base = self._arithmetic_atom()
        if not self._take("^"):
            return base
        self._deeper()
        exponent = self._signed()
        self._depth -= 1
        return Expression("^", (base, exponent))

    def _arithmetic_atom(self) -> Expression:
        token, following = self._peek, self._tokens[min(self._next + 1, len(self._tokens) - 1)]
        if token.kind == "number":
            self._next += 1
            return Expression("number", (float(token.text),))
        if token.kind == "name" and following.text != "(":
            self._next += 1
            return Expression("name", (token.text,))
        if token.text == "log":
            self._next += 1
        elif token.kind == "name":
            raise self._error(f"there is no function {token.text} here, only log()")
        self._open()
        inside = self._arithmetic()
        self._close()
        return Expression("log", (inside,)) if token.text == "log" else inside

    @property
    def _peek(self) -> _Token:
        return self._tokens[self._next]

    def _take(self, *marks: str) -> str | None:
        if self._peek.kind != "mark" or self._peek.text not in marks:
            return None
        self._next += 1
        return self._tokens[self._next - 1].text

    def _open(self) -> None:
        if not self._take("("):
            raise self._unexpected()
        self._deeper()

    def _close(self) -> None:
        if not self._take(")"):
            raise self._error("a closing parenthesis is missing" if self._peek.kind == "end" else self._surprise())
        self._depth -= 1

    def _deeper(self) -> None:
        self._depth += 1
        if self._depth > _DEEPEST:
            raise self._error(f"parentheses and signs are nested more than {_DEEPEST} deep")

    def _operation(self) -> None:
        """Count an operation inside one factor: each is a level of the recursion that evaluates it."""
        self._operations += 1
        if self._operations > _MOST_OPERATIONS:
            raise self._error(f"there are more than {_MOST_OPERATIONS} operations in one term; sum what can be summed")

    def _surprise(self) -> str:
        token = self._peek
        if token.kind == "end":
            return "something is missing at the end"
        return _HINTS.get(token.text, f"{token.text!r} is not expected here")

    def _unexpected(self) -> FormulaError:
        return self._error(self._surprise())

    def _error(self, problem: str) -> FormulaError:
        return FormulaError(problem, self._text, self._peek.at)
