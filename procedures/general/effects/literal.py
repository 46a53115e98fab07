"""Columns of effects in other rows: the formula of a term, computed as it is printed.

Centres, constants and periods of a term are those of the rows in which it was found. So its formula, and not its kind,
says what it is in the rows of a later run. What remembers earlier rows (`previous`, `lag`, `rate`, `side`) begins anew
with every run, as it did in the first one.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rig.fitter.arithmetic_text import parse_expression
from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.procedures.column_names import moves_of
from rig.procedures.general.effects.scene import Stood
from rig.procedures.general.effects.time_columns import before_each, lagging

_REMEMBERS = re.compile(r"(?<![\w.])(previous|lag|rate|side)\(")
_TURNED = re.compile(r"(?<![\w.])(sin|cos)\((\d+) ([^\W\d][\w.]*)\)")
_LEVEL = re.compile(r"C\(([\w.]+)\)\[([^\]]+)\]")


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows in which formulas are computed.

    Attributes:
        values: (n,) by name.
        times: (n,) time of each row, for lags and rates, in the unit of the column of time.
        runs: first row of each run, ascending from 0.
    """

    values: Mapping[str, FloatArray]
    times: FloatArray
    runs: Sequence[int] = (0,)

    def each(self, of_run: Callable[[FloatArray, FloatArray], FloatArray], v: FloatArray) -> FloatArray:
        """(n,) a function of values and times, run by run."""
        ends = [*self.runs[1:], len(self.times)]
        spans = [slice(begin, end) for begin, end in zip(self.runs, ends, strict=True)]
        return np.concatenate([of_run(v[span], self.times[span]) for span in spans])


def column(label: str, rows: Rows) -> FloatArray:
    """(n,) what a term's formula is in these rows.

    Raises:
        FitError: it has a name that the rows do not have, or is no formula of numbers.
    """
    text, values, count = label, dict(rows.values), 0
    while (found := _REMEMBERS.search(text)) is not None:
        arguments, end = _arguments(text, found.end())
        name = f"remembered__{count}"
        while name in values:
            count, name = count + 1, f"remembered__{count + 1}"
        values[name] = _remembered(found[1], arguments, rows)
        text = f"{text[: found.start()]}{name}{text[end:]}"
    expression = parse_expression(arithmetic(text))
    unknown = next((name for name in expression.names if name not in values), None)
    if unknown is not None:
        raise FitError(f"{label} needs {unknown}, which these rows do not have")
    value = np.asarray(expression.value(values), np.float64)
    return np.array(np.broadcast_to(value, rows.times.shape))


def arithmetic(label: str) -> str:
    """A term's formula in the grammar of formulas. Raises `FitError` for levels of text."""
    text = _LEVEL.sub(_at_level, label).replace(":", "*").replace("2 pi ", f"{2.0 * np.pi!r} * ")
    return _TURNED.sub(lambda m: f"{m[1]}({np.pi / 180.0 * int(m[2])!r} * {m[3]})", text)


def _arguments(text: str, start: int) -> tuple[list[str], int]:
    """Arguments of a call from behind its parenthesis on, and the position behind its end."""
    depth, begin, found = 1, start, []
    for at in range(start, len(text)):
        depth += {"(": 1, ")": -1}.get(text[at], 0)
        if depth == 0 or (depth == 1 and text[at] == ","):
            found.append(text[begin:at].strip())
            begin = at + 1
        if depth == 0:
            return found, at + 1
    raise FitError(f"{text}: a closing parenthesis is missing")


def _remembered(function: str, arguments: Sequence[str], rows: Rows) -> FloatArray:
    v = column(arguments[0], rows)
    names = parse_expression(arguments[0]).names
    since, start = moves_of(names[0]) if len(names) == 1 else ("", "")
    moves = [v]
    if start in rows.values:
        moves.append(column(arguments[0], replace(rows, values={**rows.values, names[0]: rows.values[start]})))
    if function == "previous":
        return rows.each(_previous, np.column_stack(moves))
    if function != "lag":
        return rows.each({"rate": _rate, "side": _side}[function], v)
    tau = float(arguments[1])
    if since not in rows.values:
        return rows.each(lambda own, t: lagging(own, np.diff(t), tau), v)

    def late(own: FloatArray, t: FloatArray) -> FloatArray:
        return lagging(own[:, 0], np.diff(t), tau, Stood(own[:, 1], own[:, 2] if own.shape[1] > 2 else None))

    return rows.each(late, np.column_stack([v, rows.values[since], *moves[1:]]))


def _previous(own: FloatArray, _times: FloatArray) -> FloatArray:
    """(n,) values before those of (n, 1 or 2) rows, with what each came from where it is recorded."""
    return before_each(own[:, 0], own[:, 1] if own.shape[1] > 1 else None)


def _rate(v: FloatArray, times: FloatArray) -> FloatArray:
    return np.concatenate([[0.0], np.diff(v) / np.diff(times)])


def _side(v: FloatArray, _times: FloatArray) -> FloatArray:
    change = np.sign(np.diff(v, prepend=v[:1]))
    for i in range(1, len(change)):
        if change[i] == 0:
            change[i] = change[i - 1]
    return change


def _at_level(found: re.Match[str]) -> str:
    try:
        level = float(found[2])
    except ValueError:
        raise FitError(f"{found[0]}: levels of text are not computed for other rows") from None
    return f"(abs({found[1]} - {level!r}) <= {1e-6 * max(abs(level), 1e-300)!r})"
