"""A first model and its sensors for an unknown table: powers that a test finds, and outputs that are alike."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence

import numpy as np

from rig.fitter.errors import FitError
from rig.fitter.quantiles import f_tail, t_tail
from rig.procedures.errors import DataError
from rig.procedures.evaluate.results import Source
from rig.procedures.general.fit import fit_general
from rig.procedures.tables.table import Table

_CLEAR, _HIGHEST, _SPARE, _LEAVES = 1e-4, 3, 3, 0.02
_REPEATS, _LEVELS, _ALONG = 10, 10, 2.5
"""Degrees of freedom of repeats, or levels, from which a polynomial is judged; limit of a correlation, in its sd."""
_NUMBER = re.compile(r"\d+|(?<![A-Za-z])[A-Za-z](?![A-Za-z])|(?<=[a-z])[A-Z](?![A-Za-z])")
_NAMELESS = re.compile(r"column_\d+")


def nameless(table: Table) -> bool:
    """Whether the columns of a table have no names of their own."""
    return all(_NAMELESS.fullmatch(name) for name in table.names)


def curved(
    source: Source, table: Table, response: str, columns: Sequence[str], terms: Sequence[str]
) -> tuple[tuple[str, ...], str]:
    """Terms with powers of the settings, one after the other, while a t-test finds each clearly.

    The power has to stand out with the probability 1e-4, and a degree needs two levels more than itself.

    Args:
        source: the file.
        table: the same with NaN for missing values.
        response: column.
        columns: the settings.
        terms: the same as they are written in a formula.

    Returns:
        The terms; and which powers were added, as a sentence, or "".
    """
    found, added = list(terms), []
    highest = _HIGHEST if len(columns) == 1 else 2
    for column, term in zip(columns, terms, strict=True):
        v = table.columns[column][np.isfinite(table.columns[response])]
        levels = np.unique(v[np.isfinite(v)]).size
        for degree in range(2, highest + 1):
            power = f"{term}^{degree}"
            if (
                levels < degree + 2
                or len(v) < len(found) + 1 + _SPARE
                or _p(source, response, [*found, power]) > _CLEAR
            ):
                break
            found.append(power)
            added.append(power)
    if added and len(columns) == 1 and not _enough(table, response, columns[0], len(added) + 1):
        why = (
            f"A straight line in {columns[0]} is not enough for {response}, and powers up to {len(added) + 1} are not "
            "either: what they leave is no scatter. The formula is left a straight line; please choose a better one"
        )
        return tuple(terms), why
    why = f"{' and '.join(added)}: in the formula because a straight line is not enough (p < 0.0001)" if added else ""
    return tuple(found), why


def _enough(table: Table, response: str, column: str, degree: int) -> bool:
    """Whether a polynomial takes nearly all that a straight line leaves, or leaves scatter alone.

    Scatter is as large as that of repeats, and without order along the setting.
    """
    x, y = table.columns[column], table.columns[response]
    both = np.isfinite(x) & np.isfinite(y)
    x, y = x[both], y[both]
    x = (x - x.min()) / np.ptp(x)
    left = y - np.polynomial.Polynomial.fit(x, y, degree)(x)
    line = y - np.polynomial.Polynomial.fit(x, y, 1)(x)
    if float(left @ left) <= _LEAVES * float(line @ line):
        return True
    _, index, count = np.unique(x, return_inverse=True, return_counts=True)
    means = np.bincount(index, left) / count
    within, between = float(((left - means[index]) ** 2).sum()), float((count * means**2).sum())
    free, spare = len(y) - len(count), len(count) - degree - 1
    if free >= _REPEATS and spare > 0:
        return not within or f_tail(between / spare / (within / free), spare, free) > _CLEAR
    if len(means) < _LEVELS or not np.ptp(means):
        return True
    along = float(np.corrcoef(means[1:], means[:-1])[0, 1])
    return bool(along * np.sqrt(len(means)) < _ALONG)


def _p(source: Source, response: str, terms: Sequence[str]) -> float:
    """Probability by chance of the last term's estimate, or of a larger one."""
    try:
        fit = fit_general(source.read, response, " + ".join(["1", *terms]), first_look=True)["coefficients"]
    except (DataError, FitError):
        return 1.0
    last = list(fit.values())[-1]
    if not last["stderr"] or not last["df"]:
        return 1.0
    return t_tail(last["estimate"] / last["stderr"], last["df"])


def alike(response: str, names: Collection[str], table: Table) -> tuple[str, ...]:
    """Outputs of the same sort, in the order of the file: names and units that differ by a number or a letter only.

    Args:
        response: column; it is one of those returned.
        names: of columns that may be outputs.
        table: with their units.
    """

    def sort(name: str) -> tuple[str, str]:
        return _NUMBER.sub("#", name), table.units.get(name, "")

    if not _NUMBER.search(response) or nameless(table):
        return (response,)
    return tuple(name for name in table.names if name in {response, *names} and sort(name) == sort(response))
