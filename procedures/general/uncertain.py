"""Columns that state the uncertainty of another one, or the weight made of it, in an unknown table."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.procedures.tables.table import Table

_WORD = r"err(?:or)?|unc(?:ertainty)?|sd|std|stdev|stddev|sigma|stderr|se|u"
_OF = re.compile(rf"(?:{_WORD}|d|delta)[_ .](?P<of>.+)|(?P<by>.+?)[_ .](?:{_WORD})", re.IGNORECASE)
_ALONE = re.compile(
    r"err(?:or)?s?|unc(?:ertainty)?|sd|std|stdev|stddev|st\.? ?dev\.?|sigma|stderr|"
    r"standard (?:deviation|uncertainty|error)",
    re.IGNORECASE,
)
_EXPANDED = re.compile(r"U(?:95|exp)?[_ .(].*|.*[_ .]U(?:95|exp)?|.*expanded.*")
_ERROR = re.compile(r"(?:.*[_ .])?err(?:or)?s?(?:[_ .].*)?", re.IGNORECASE)
_WEIGHT = re.compile(r"w|wt|wgt|weights?", re.IGNORECASE)
_UNIT = re.compile(r"(?<=[^_])_(?:deg)?[A-Za-z%]{1,4}$")
_SAME = 1e-3


def uncertainties(table: Table) -> dict[str, str]:
    """The column whose uncertainty a column states, by the latter: u_R of R_ohm, gain_sd of gain."""
    found: dict[str, str] = {}
    names = list(table.columns)
    stems: dict[str, str] = {}
    for short in (_bare, _stem):
        for name in names:
            stems.setdefault(short(name), name)
    for i, name in enumerate(names):
        v = table.columns[name]
        part = _OF.fullmatch(_bare(name)) or _OF.fullmatch(_stem(name))
        of = stems.get(part["of"] or part["by"], "") if part else ""
        before = names[i - 1] if i else ""
        if not of and before and before not in found and _ALONE.fullmatch(_bare(name)) and _is_size(v, table, before):
            of = before
        if of and of != name:
            found[name] = of
    return found


def weights(table: Table, found: Mapping[str, str]) -> dict[str, str]:
    """The column of uncertainties that a column of weights was made of, by that column: w = c / u^2."""
    return {
        name: other
        for name, v in table.columns.items()
        if _WEIGHT.fullmatch(_bare(name))
        for other in found
        if other != name and _is_constant(v * table.columns[other] ** 2)
    }


def option(table: Table, of: Mapping[str, str], name: str) -> tuple[str, str]:
    """The column of the standard uncertainty of a column, "" if there is none, and what is to be known about it."""
    column = next((one for one, other in of.items() if other == name), "")
    if not column:
        return "", ""
    v = table.columns[column]
    if not np.isfinite(v).all() or not (v > 0).all():
        return (
            "",
            f"{column} may be the uncertainty of {name}; it has gaps, zeros or negative values, so it is not used",
        )
    if _EXPANDED.fullmatch(column):
        return "", (
            f"{column} may be the expanded uncertainty of {name}: divide it by its coverage factor k, and name that "
            "column with --u-y"
        )
    what = " (an error may also be a deviation or a limit)" if _ERROR.fullmatch(_bare(column)) else ""
    return column, f"{column} is taken for the standard uncertainty of {name}{what}; please check that"


def _bare(name: str) -> str:
    """A name without a unit in brackets."""
    return re.sub(r"\s*[\[(].*[\])]$", "", name)


def _stem(name: str) -> str:
    """A name without a unit, in brackets or after an underscore."""
    return _UNIT.sub("", _bare(name))


def _is_size(v: FloatArray, table: Table, before: str) -> bool:
    """Whether values may be uncertainties of those before: none is negative, and nearly all are smaller."""
    of = np.abs(table.columns[before])
    both = np.isfinite(v) & np.isfinite(of)
    return bool(both.any()) and bool((v[both] >= 0).all()) and float(np.mean(v[both] < of[both])) > 0.5


def _is_constant(v: FloatArray) -> bool:
    known = v[np.isfinite(v)]
    return known.size > 1 and bool(np.ptp(known) <= _SAME * np.abs(known).max()) and bool(known.any())
