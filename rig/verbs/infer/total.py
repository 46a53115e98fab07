"""Total uncertainty in use: a calibration's influences, each carried through inference once more.

As in a budget (JCGM 100, 5.1 and annex G): what a quantity changes by for one standard uncertainty of an influence is
its contribution, and the degrees of freedom are those of Welch and Satterthwaite.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
from scipy import special

from rig.fitter.arrays import FloatArray
from rig.fitter.budget import combine
from rig.procedures.evaluate.inference import Inference, within_half_turn
from rig.procedures.kind import Kind
from rig.procedures.tables.table import Reader, Table

REPEATABILITY_ONLY = (
    "standard deviations and intervals are repeatability only: no influence of the calibration's instruments is in them"
)
TOTAL, REPEATABILITY, COLUMN = "total", "repeatability only", "uncertainty"
FIRST_ORDER = 1.0 / 12.0
"""Largest move of an angle by an influence, in full turns, of a row without a flag: 30 deg."""


@dataclass(frozen=True, eq=False)
class KeptInfluence:
    """An influence of a calibration file.

    Attributes:
        name: of it.
        df: degrees of freedom.
        modes: coefficients by sensor, up and down by one standard uncertainty, of independent errors.
        in_use: error of readings by the meter of the run: by column, its value at zero and its slope.
    """

    name: str
    df: float
    modes: tuple[tuple[Mapping[str, FloatArray], Mapping[str, FloatArray]], ...]
    in_use: Mapping[str, tuple[float, float]]


@dataclass(frozen=True, eq=False)
class KeptLine:
    """A line of the budget of inferred values that is no change of coefficients, such as an effect beside the model.

    Attributes:
        name: of it.
        df: degrees of freedom.
        at: (p,) inferred values, increasing.
        u: (p,) standard uncertainty of each.
        deviation: (p,) part of known size and of either sign in it.
    """

    name: str
    df: float
    at: FloatArray
    u: FloatArray
    deviation: FloatArray


@dataclass(frozen=True, eq=False)
class KeptScatter:
    """Scatter of a budget that is not that of independent rows about the calibration.

    Attributes:
        at: (p,) inferred values, increasing.
        more: (p,) variance of the budget's scatter less that of the calibration alone.
        inverse_df: (p,) one over the degrees of freedom of the former.
    """

    at: FloatArray
    more: FloatArray
    inverse_df: FloatArray


@dataclass(frozen=True, eq=False)
class KeptBudget:
    """The section "budget" of a calibration file.

    Attributes:
        register: name of the register.
        example: whether its values are examples.
        influences: on the coefficients.
        notes: sentences for every use.
        lines: of the budget that are no change of coefficients, by output.
        scatter: of the budget beside that of the calibration, by output.
        uncertainty: what standard deviations and intervals have with these.
    """

    register: str
    example: bool
    influences: tuple[KeptInfluence, ...]
    notes: tuple[str, ...]
    lines: Mapping[str, tuple[KeptLine, ...]] = field(default_factory=dict)
    scatter: Mapping[str, KeptScatter] = field(default_factory=dict)
    uncertainty: str = TOTAL

    @classmethod
    def of(cls, given: Mapping[str, Any]) -> KeptBudget:
        """From JSON values. Raises the errors of indexing and converting unknown values."""
        influences = tuple(
            KeptInfluence(
                str(one["name"]),
                inf if one["df"] is None else float(one["df"]),
                tuple((_arrays(mode["up"]), _arrays(mode["down"])) for mode in one["modes"]),
                {str(name): (float(start), float(slope)) for name, (start, slope) in one["in_use"].items()},
            )
            for one in given["influences"]
        )
        notes = tuple(str(note) for note in given["notes"])
        lines = {
            str(output): tuple(
                KeptLine(
                    str(one["name"]),
                    inf if one["df"] is None else float(one["df"]),
                    np.array(one["at"], np.float64),
                    np.array(one["u"], np.float64),
                    np.array(one.get("deviation", np.zeros(len(one["at"]))), np.float64),
                )
                for one in every
            )
            for output, every in given.get("lines", {}).items()
        }
        scatter = {
            str(output): KeptScatter(*(np.array(one[key], np.float64) for key in ("at", "more", "inverse_df")))
            for output, one in given.get("scatter", {}).items()
        }
        words = str(given.get("uncertainty", TOTAL))
        return cls(str(given["register"]), bool(given["example"]), influences, notes, lines, scatter, words)


def _arrays(given: Mapping[str, Sequence[float]]) -> dict[str, FloatArray]:
    found = {str(sensor): np.array(values, np.float64) for sensor, values in given.items()}
    if not all(np.isfinite(values).all() for values in found.values()):
        raise ValueError("a coefficient of an influence is no number")
    return found


Infer = Callable[[Any, Reader, Callable[[Path], Reader]], Inference]
"""Inference by a calibration from a table, and from further tables."""


def with_total(
    found: Inference,
    budget: KeptBudget,
    kind: Kind,
    calibration: Any,
    infer: Infer,
    read: Reader,
    other: Callable[[Path], Reader],
    *,
    same_meter: bool,
) -> Inference:
    """Inferred quantities with their total uncertainty, in the columns that had the repeatability.

    Args:
        found: by the calibration as it is.
        budget: of it.
        kind: of it.
        calibration: the calibration.
        infer: inference by another calibration.
        read: the table.
        other: reads a further table.
        same_meter: whether the meter of the run reads the sensors.
    """
    moved = {quantity: [] for quantity in found.quantities}  # type: dict[str, list[FloatArray]]
    df: list[float] = []
    groups: dict[str, list[tuple[FloatArray, float]]] = {quantity: [] for quantity in found.quantities}
    every: dict[str, list[FloatArray]] = {quantity: [] for quantity in found.quantities}
    every_df: list[float] = []
    for one in budget.influences:
        error = one.in_use if same_meter else {}
        halves = [
            _half(found, kind, calibration, mode, error if i == 0 else {}, infer, read, other)
            for i, mode in enumerate(one.modes)
        ]
        if len(halves) == 1:
            df.append(one.df)
        every_df += [one.df] * len(halves)
        for quantity in found.quantities:
            every[quantity] += [half[quantity] for half in halves]
            if len(halves) == 1:
                moved[quantity].append(halves[0][quantity])
            else:
                groups[quantity].append((sum((np.square(h[quantity]) for h in halves), np.zeros(1)), one.df))
    scatter = {q: _scatter(found, q, budget.scatter) for q in found.quantities}
    own = {q: np.sqrt(variance) for q, (variance, _) in scatter.items()}
    sides = {q: np.zeros(len(variance)) for q, (variance, _) in scatter.items()}
    for quantity in found.quantities:
        for line in (one for output in found.outputs.get(quantity, ()) for one in budget.lines.get(output, ())):
            u = np.interp(np.asarray(found.columns[quantity], np.float64), line.at, line.u)
            groups[quantity].append((u**2, line.df))
            own[quantity] = np.hypot(own[quantity], u)
            deviation = np.interp(np.asarray(found.columns[quantity], np.float64), line.at, line.deviation)
            sides[quantity] = np.maximum(sides[quantity], np.abs(deviation))
    columns = dict(found.columns)
    for quantity in found.quantities:
        parts = (scatter[quantity], moved[quantity], np.array(df), groups[quantity], sides[quantity])
        columns |= _combined(found, quantity, *parts)
    rows = len(next(iter(columns.values())))
    told, flagged = _flags(found, columns, moved, groups)
    columns |= told
    words = (
        f"standard deviations and intervals are {budget.uncertainty}: scatter, and the influences of the register "
        f"{budget.register!r}"
    )
    meter = (
        "the meter of the run reads the sensors, too"
        if same_meter
        else "errors of the meter that reads the sensors in use are not in them"
    )
    return replace(
        saying(replace(found, columns=columns), budget.uncertainty),
        flagged=flagged,
        notes=(f"{words}; {meter}", *budget.notes, *found.notes),
        own_sd=own,
        shifts={q: np.reshape(moves, (len(every_df), rows)) for q, moves in every.items()},
        shifts_df=every_df,
    )


def saying(found: Inference, uncertainty: str) -> Inference:
    """An inference that says what its standard deviations and intervals have, in a column and in its JSON."""
    name = COLUMN if COLUMN not in found.columns else f"inferred_{COLUMN}"
    rows = len(next(iter(found.columns.values())))
    columns = {**found.columns, name: np.full(rows, uncertainty, dtype=object)}
    return replace(found, columns=columns, added=(*found.added, name), uncertainty=uncertainty)


def _half(
    found: Inference,
    kind: Kind,
    calibration: Any,
    mode: tuple[Mapping[str, FloatArray], Mapping[str, FloatArray]],
    error: Mapping[str, tuple[float, float]],
    infer: Infer,
    read: Reader,
    other: Callable[[Path], Reader],
) -> dict[str, FloatArray]:
    """Half of the difference of every quantity between both sides of an influence."""
    sides = []
    for sign, coefficients in zip((1.0, -1.0), mode, strict=True):
        moved = kind.with_coefficients(calibration, coefficients)
        sides.append(infer(moved, _shifted(read, error, sign), lambda path, s=sign: _shifted(other(path), error, s)))  # type: ignore[misc]
    up, down = sides
    halves = {}
    for q in found.quantities:
        apart = np.asarray(up.columns[q], float) - np.asarray(down.columns[q], float)
        # angles on both sides of +-180 deg are neighbours: without this the half-difference is half a turn
        halves[q] = (within_half_turn(apart, found.turns[q]) if q in found.turns else apart) / 2.0
    return halves


def _flags(
    found: Inference,
    columns: Mapping[str, Any],
    moved: Mapping[str, Sequence[FloatArray]],
    groups: Mapping[str, Sequence[tuple[FloatArray, float]]],
) -> tuple[dict[str, Any], int]:
    """The columns of flags with what total uncertainty adds to it, and the number of rows that have one.

    An influence is carried to first order: of an angle this holds while it moves the angle by far less than half a
    turn. A row without total uncertainty has no uncertainty at all.
    """
    flags: dict[str, Any] = {}
    for q in found.quantities:
        name = found.flag_of(q)
        if name is None:
            continue
        flag = flags.setdefault(name, np.array(found.columns[name], dtype=object))
        sd, own = (np.asarray(one[f"{q}_sd"], np.float64) for one in (columns, found.columns))
        reasons = [(np.isfinite(own) & np.isnan(sd), f"{q}: an influence leaves no value, so no uncertainty is known")]
        if q in found.turns:
            most = FIRST_ORDER * found.turns[q]
            far = np.max([np.abs(one) for one in moved[q]], axis=0) if moved[q] else np.zeros(len(sd))
            for variance, _ in groups[q]:
                far = np.fmax(far, np.sqrt(variance))
            words = f"{q}: an influence or the uncertainty exceeds {most:g} deg, where propagation to first order fails"
            reasons.append(((far > most) | (sd > most), words))
        for rows, words in reasons:
            flag[rows] = [f"{old}; {words}" if old else words for old in flag[rows]]
    return flags, int(np.sum(np.any([flag != "" for flag in flags.values()], axis=0))) if flags else found.flagged


def _shifted(read: Reader, error: Mapping[str, tuple[float, float]], sign: float) -> Reader:
    """Reads a table with an error of the meter added."""
    if not error:
        return read

    def shifted(needed: Collection[str]) -> Table:
        table = read(needed)
        columns = {
            name: values + sign * (error[name][0] + error[name][1] * values) if name in error else values
            for name, values in table.columns.items()
        }
        return replace(table, columns=columns)

    return shifted


def _scatter(found: Inference, quantity: str, kept: Mapping[str, KeptScatter]) -> tuple[FloatArray, FloatArray]:
    """(n,) variance by the scatter, and (n,) its degrees of freedom."""
    variance = np.asarray(found.columns[f"{quantity}_sd"], np.float64) ** 2
    df = np.array(found.df[quantity], np.float64)
    for one in (kept[output] for output in found.outputs.get(quantity, ()) if output in kept):
        value = np.asarray(found.columns[quantity], np.float64)
        # another number of readings than in the run may leave less than what the calibration has beyond the budget
        variance = np.maximum(variance + np.interp(value, one.at, one.more), 1e-6 * variance)
        with np.errstate(divide="ignore"):
            df = np.where(np.isnan(df), df, 1.0 / np.interp(value, one.at, one.inverse_df))
    return variance, df


def _combined(
    found: Inference,
    quantity: str,
    scatter: tuple[FloatArray, FloatArray],
    moved: Sequence[FloatArray],
    df: FloatArray,
    groups: Sequence[tuple[FloatArray, float]],
    side: FloatArray,
) -> dict[str, FloatArray]:
    """Columns of one quantity, with total uncertainty where repeatability has one."""
    value, sd, low, high = (
        np.array(found.columns[quantity + end], np.float64) for end in ("", "_sd", "_lo95", "_hi95")
    )
    own_df = np.array(found.df[quantity], np.float64)
    known = np.isfinite(sd) & np.isfinite(value) & np.isfinite(low) & np.isfinite(high) & ~np.isnan(own_df)
    for one in (*moved, *(variance for variance, _ in groups)):
        known &= np.isfinite(one)
    sensitivities = np.reshape([one[known] for one in moved], (len(moved), known.sum())).T
    type_a = [(scatter[0][known], scatter[1][known]), *((v[known], np.full(known.sum(), d)) for v, d in groups)]
    total = combine(sensitivities, df, type_a, deviation=side[known])
    own = np.where(own_df[known] < 1e10, special.stdtrit(np.minimum(own_df[known], 1e10), 0.975), special.ndtri(0.975))
    with np.errstate(divide="ignore", invalid="ignore"):
        wider = total.expanded_uncertainty / (own * sd[known])
    below, above = value[known] - low[known], high[known] - value[known]
    rounding = 1e-12 * np.abs(value[known])
    exact = ~np.isfinite(wider) | (np.abs(above - below) <= 1e-9 * (above + below) + rounding)
    low[known] = value[known] - np.where(exact, total.expanded_uncertainty, below * wider)
    high[known] = value[known] + np.where(exact, total.expanded_uncertainty, above * wider)
    sd[known] = total.standard_uncertainty
    lost = np.isfinite(sd) & ~known
    sd[lost] = low[lost] = high[lost] = np.nan
    return {f"{quantity}_sd": sd, f"{quantity}_lo95": low, f"{quantity}_hi95": high}
