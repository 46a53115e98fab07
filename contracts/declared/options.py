"""What the bench file chooses: a file's parameters in numbers and in answers that have to be right."""

from __future__ import annotations

import ast
import operator
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, TypeVar

from rig.contracts.declared.exchanges import Check, Tell
from rig.contracts.declared.forms import Form

_OPERATORS: Mapping[type, Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}
_WHOLE = re.compile(r"\{([A-Za-z_][A-Za-z0-9_]*)\}")
COMPUTED = ("reading_s", "noise", "resolution", "settle_s", "overload")
"""Keys of a reader that may follow from parameters."""


def computed(text: str, known: Mapping[str, str | float]) -> float:
    """The value of a formula: numbers, parameters, + - * / and parentheses; a comparison is 1 or 0.

    Raises:
        ValueError: it is none, or has no value.

    Example:
        >>> computed("0.001 + 2 * nplc / line_Hz", {"nplc": 10, "line_Hz": 50})
        0.401
    """

    def value(node: ast.expr) -> float:
        match node:
            case ast.Constant(value=int() | float() as number):
                return float(number)
            case ast.Name(id=name) if not isinstance(known.get(name, ""), str):
                return float(known[name])
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
                return float(_OPERATORS[type(op)](value(left), value(right)))
            case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in _OPERATORS:
                return float(_OPERATORS[type(op)](value(left), value(right)))
        raise ValueError(f"{text!r} is no formula of numbers, + - * / < > and the parameters that are numbers")

    try:
        return value(ast.parse(text, mode="eval").body)
    except (SyntaxError, ZeroDivisionError, RecursionError) as error:
        raise ValueError(f"{text!r} has no value: {error}") from None


def filled(checks: Iterable[Check], known: Mapping[str, str | float]) -> tuple[Check, ...]:
    """Checks with the values of the parameters that their right answers name."""
    return tuple(
        one if (found := known.get(_named(one))) is None else one.model_copy(update={"is_": _number_or_text(found)})
        for one in checks
    )


Exchange = TypeVar("Exchange", Check, Tell)


def named(every: Iterable[Exchange], left: Iterable[str]) -> tuple[Exchange, ...]:
    """Settings, or commands, without those that name a number which the bench file does not give."""
    return tuple(
        one
        for one in every
        if not any(f"{{{name}" in f"{one.said} {getattr(one, 'is_', '')} {getattr(one, 'value', '')}" for name in left)
    )


def with_value(tell: Tell, known: Mapping[str, str | float]) -> Tell:
    """A command with the number of the parameter that it writes to a register."""
    if not isinstance(tell.value, str):
        return tell
    return tell.model_copy(update={"value": round(tell.shown(float(known[tell.value.strip("{}")])), 9)})


def _named(check: Check) -> str:
    """The parameter that a right answer is; "" if it is none."""
    found = _WHOLE.fullmatch(check.is_) if isinstance(check.is_, str) else None
    return found[1] if found else ""


def _number_or_text(value: str | float) -> str | float:
    return value if isinstance(value, str) else float(value)


def wrong_choices(choices: Mapping[str, Iterable[str | float]], known: Mapping[str, str | float]) -> Iterator[str]:
    """Choices that do not fit the parameters, and baud and frame of the wire."""
    for name, allowed in choices.items():
        if name not in known:
            yield f"choices.{name}: there is no parameter {name}; baud and frame of the wire may have choices, too"
        elif known[name] not in allowed:
            yield f"choices.{name} lacks its default, {known[name]}"


def wrong_values(tells: Iterable[Tell], known: Mapping[str, str | float]) -> Iterator[str]:
    """Values for registers that are parameters which there are not, or texts."""
    for one in (one for one in tells if isinstance(one.value, str)):
        name = _WHOLE.fullmatch(str(one.value))
        if not name or isinstance(known.get(name[1], ""), str):
            yield f"prepare of {one.said}: value = {one.value!r} is neither a number nor a parameter that is one"


def wrong_answers(checks: Iterable[Check], known: Mapping[str, str | float]) -> Iterator[str]:
    """Right answers that name no parameter, or are in no field."""
    for one in checks:
        if (name := _named(one)) and name not in known:
            yield f"check of {one.said}: {one.is_} is no parameter"
        if one.answer and not any(Form(form).fields for form in one.answer):
            yield f"check of {one.said}: no field of {one.answer[0]!r} could be {one.is_}; write {{value}} or {{text}}"


def wrong_formulas(formulas: Mapping[str, str], known: Mapping[str, str | float], *, reads: bool) -> Iterator[str]:
    """Formulas that give nothing, or something that none can give; `reads` whether there is a reader."""
    for key, text in formulas.items():
        if key not in COMPUTED or not reads:
            yield f"formulas.{key}: a formula gives one of these of a reader: {', '.join(COMPUTED)}"
            continue
        try:
            computed(text, known)
        except ValueError as error:
            yield f"formulas.{key}: {error}"
