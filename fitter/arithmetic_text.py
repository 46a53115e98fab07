"""Parsing the text of arithmetic into an `Expression`. The grammar is described in `rig.fitter.formula`."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from rig.fitter.arithmetic import COMPARISONS, FUNCTIONS, NAME, Expression
from rig.fitter.errors import FitError

_TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)"
    rf"|(?P<name>{NAME})|`(?P<quoted>(?:[^`]|``)+)`|(?P<mark>\*\*|[<>=!]=|\S))"
)
_DEEPEST, _MOST_OPERATIONS, _LONGEST = 40, 250, 20_000
_HINTS = {
    "~": "the response is given by itself, not in the formula",
    "=": "equality is written ==",
    "`": "the back-tick that ends the name is missing",
}
_INSTEAD = {
    "ln": "the natural logarithm is log()",
    "log10": "write I(log(x) / log(10))",
    "pow": "powers are written x^2",
    "tan": "write I(sin(x) / cos(x))",
}


class FormulaError(FitError):
    """A formula that violates the grammar; the message marks the place."""

    def __init__(self, problem: str, text: str, at: int) -> None:
        line = re.sub(r"\s", " ", text)
        super().__init__(f"{problem}\n  {line}\n  {' ' * at}^")


@dataclass(frozen=True)
class Token:
    """A token of a text.

    Attributes:
        kind: "number", "name", "quoted", "mark" or "end".
        text: its text; a name without back-ticks; `**` is `^`.
        at: index of its first character.
    """

    kind: str
    text: str
    at: int

    @property
    def is_name(self) -> bool:
        """Whether it can be a variable."""
        return self.kind in ("name", "quoted")


def parse_expression(text: str) -> Expression:
    """Parse arithmetic.

    Raises:
        FormulaError: it violates the grammar.
    """
    return Arithmetic(text).expression()


def column_name(text: str) -> str:
    """The column named by a text: the text in back-ticks, or all of it."""
    tokens = [_token(m) for m in _TOKEN.finditer(text)]
    return tokens[0].text if [token.kind for token in tokens] == ["quoted"] else text


class Arithmetic:
    """Recursive descent, one method per level of the grammar."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._tokens = [_token(m) for m in _TOKEN.finditer(text)]
        self._tokens.append(Token("end", "the end", len(text.rstrip())))
        self._next = 0
        self._depth = 0
        self._operations = 0

    def expression(self) -> Expression:
        """The whole text as one expression."""
        self._check_length()
        found = self._arithmetic()
        if self._peek.kind != "end":
            raise self._unexpected()
        return found

    def _check_length(self) -> None:
        if self._peek.kind == "end":
            raise self._error("the formula is empty")
        if len(self._text) > _LONGEST:
            raise FormulaError(f"the formula has more than {_LONGEST:,} characters", self._text[:60], 60)

    def _arithmetic(self) -> Expression:
        left = self._added()
        if not (mark := self._take(*COMPARISONS)):
            return left
        found = Expression(mark, (left, self._added()))
        if self._peek.kind == "mark" and self._peek.text in COMPARISONS:
            raise self._error("comparisons cannot be chained; multiply them: (a < b) * (b < c)")
        return found

    def _added(self) -> Expression:
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
        base = self._value()
        if not self._take("^"):
            return base
        self._deeper()
        exponent = self._signed()
        self._depth -= 1
        return Expression("^", (base, exponent))

    def _value(self) -> Expression:
        token = self._peek
        if token.kind == "number":
            if not math.isfinite(float(token.text)):
                raise self._error("the number is too large")
            self._next += 1
            return Expression("number", (float(token.text),))
        if self._is_call:
            return self._call(f"there is no function {token.text} here, only {', '.join(FUNCTIONS)}")
        if token.is_name:
            self._next += 1
            return Expression("name", (token.text,))
        self._open()
        inside = self._arithmetic()
        self._close()
        return inside

    def _call(self, unknown: str) -> Expression:
        name = self._peek
        if name.text not in FUNCTIONS:
            instead = _INSTEAD.get(name.text)
            raise self._error(f"{unknown}; {instead}" if instead else unknown)
        self._next += 1
        self._open()
        given = [self._arithmetic()]
        while self._take(","):
            given.append(self._arithmetic())
        self._close()
        if len(given) != (wanted := FUNCTIONS[name.text]):
            values = "one value" if wanted == 1 else "two values"
            raise FormulaError(f"{name.text}() takes {values}, not {len(given)}", self._text, name.at)
        return Expression(name.text, tuple(given))

    @property
    def _peek(self) -> Token:
        return self._tokens[self._next]

    @property
    def _is_call(self) -> bool:
        following = self._tokens[min(self._next + 1, len(self._tokens) - 1)]
        return self._peek.kind == "name" and (following.kind, following.text) == ("mark", "(")

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
        """Count an operation inside one factor: each is a level of recursion in its evaluation."""
        self._operations += 1
        if self._operations > _MOST_OPERATIONS:
            raise self._error(f"there are more than {_MOST_OPERATIONS} operations in one term; sum what can be summed")

    def _surprise(self) -> str:
        token = self._peek
        if token.kind == "end":
            return "something is missing at the end"
        words = token.kind == "name" and self._next > 0 and self._tokens[self._next - 1].kind == "name"
        more = "; a name of several words needs back-ticks" if words else ""
        return _HINTS.get(token.text, f"{token.text!r} is not expected here") + more

    def _unexpected(self) -> FormulaError:
        return self._error(self._surprise())

    def _error(self, problem: str) -> FormulaError:
        return FormulaError(problem, self._text, self._peek.at)


def _token(match: re.Match[str]) -> Token:
    kind = match.lastgroup or ""
    text = match[kind]
    if kind == "quoted":
        return Token(kind, text.replace("``", "`"), match.start(kind) - 1)
    return Token(kind, "^" if text == "**" else text, match.start(kind))
