"""Gross errors in the output of `rig fit`: rows, deviations, and the fit with and without them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from rig.fitter import ties
from rig.fitter.errors import FitError
from rig.fitter.gross import LEVEL, GrossErrors
from rig.fitter.json_values import if_finite
from rig.procedures.errors import DataError

if TYPE_CHECKING:
    from rig.fitter.arrays import FloatArray, IntArray
    from rig.procedures.tables.table import Table

GROSS = "gross"
"""Value of `--leave-out` for the rows named by the search."""
MANY = 0.05
"""Share of the rows above which the model is doubted instead of the rows."""
SHOWN = 8
FARTHEST = 3
"""Number of rows shown where many are off: the list is not the point then."""
_DIGITS = 18
"""Maximum length of a row number."""

Fits = TypeVar("Fits")
Where = Callable[[int], str]
"""Place of a row in words, by its index: "order 31 at 2.5 psia"."""


@dataclass(frozen=True)
class LeaveOut:
    """Rows to be left out of a fit.

    Attributes:
        gross: whether to leave out the rows named by the search.
        rows: (m,) indices of rows given by their number in the file.
    """

    gross: bool
    rows: IntArray

    @staticmethod
    def of(asked: Sequence[str], table: Table) -> LeaveOut:
        """From `--leave-out` options: "gross", or row numbers of the table's file, separated by commas.

        Raises:
            DataError: invalid text, or the table has no such row.
        """
        words = [word.strip() for text in asked for word in text.split(",") if word.strip()]
        numbers = sorted({word for word in words if word != GROSS})
        wrong = [word for word in numbers if not word.isdecimal() or len(word) > _DIGITS]
        if wrong:
            raise DataError(f"--leave-out {wrong[0][:40]}: say gross, or row numbers of the file such as 12,31")
        wanted, known = sorted(int(word) for word in numbers), table.numbers
        outside = sorted(set(wanted) - set(known.tolist()))
        if outside:
            between = "" if len(known) == known[-1] - known[0] + 1 else ", but for blank lines"
            raise DataError(
                f"--leave-out {outside[0]}: {table.source} has observations in rows {known[0]} to {known[-1]}{between}"
            )
        return LeaveOut(GROSS in words, np.searchsorted(known, wanted))


@dataclass(frozen=True)
class FitSummary:
    """One fit, for comparison.

    Attributes:
        sigmas: its standard deviations by name.
        unit: of them.
        coefficients: estimate and standard error by name.

    """

    sigmas: Mapping[str, float | None]
    unit: str
    coefficients: Mapping[str, tuple[float, float]]

    @staticmethod
    def of(
        sigmas: Mapping[str, float | None], unit: str, names: Sequence[str], estimates: FloatArray, stderr: FloatArray
    ) -> FitSummary:
        """Of (k,) estimates and their standard errors."""
        values = zip(estimates.tolist(), stderr.tolist(), strict=True)
        return FitSummary(sigmas, unit, dict(zip(names, values, strict=True)))

    def to_dict(self) -> dict[str, Any]:
        """JSON values."""
        table = {n: {"estimate": if_finite(b), "stderr": if_finite(s)} for n, (b, s) in self.coefficients.items()}
        return {**self.sigmas, "coefficients": table}


@dataclass(frozen=True, eq=False)
class Searched:
    """The search of one table, before and after a decision.

    Attributes:
        found: by sensor; indices refer to the searched rows.
        searched: (k,) indices of the searched rows in the table.
        numbers: (n,) number in the file of every row of the table.
        left_out: the request.
    """

    found: Mapping[str, GrossErrors]
    searched: IntArray
    numbers: IntArray
    left_out: LeaveOut

    @property
    def named(self) -> IntArray:
        """Indices in the table of the rows named in any sensor, ascending."""
        rows = [self.searched[found.rows] for found in self.found.values()]
        return np.unique(np.concatenate([np.zeros(0, np.int64), *rows]))

    @property
    def without(self) -> IntArray:
        """Indices in the table of the searched rows that are not named."""
        return np.setdiff1d(self.searched, self.named)

    @property
    def used(self) -> IntArray:
        """Indices in the table of the rows of the calibration."""
        return self.without if self.left_out.gross else self.searched

    @property
    def rows_left_out(self) -> list[int]:
        """Row numbers of the left-out observations."""
        return np.delete(self.numbers, self.used).tolist()

    def with_the_others(self, fitted: Callable[[IntArray], Fits]) -> Fits | str | None:
        """The fit that is not stored: without the named rows, or with them; a reason if it is impossible; None if none
        is named.

        Args:
            fitted: fits rows (k,) of the table.
        """
        if not self.named.size:
            return None
        try:
            return fitted(self.searched if self.left_out.gross else self.without)
        except FitError as error:
            return str(error)

    def of_sensor(
        self, name: str, unit: str, where: Where, kept_fit: FitSummary, other: FitSummary | str | None
    ) -> dict[str, Any]:
        """The `gross_errors` of one sensor for JSON.

        Args:
            name: of the sensor.
            unit: of its output.
            where: a row's place in words.
            kept_fit: the fit that is kept.
            other: that of `with_the_others`.

        """
        fits: tuple[FitSummary, FitSummary | str] | None = None if other is None else (kept_fit, other)
        if self.left_out.gross and isinstance(other, FitSummary):
            fits = other, kept_fit
        found, kept = self.found[name], not self.left_out.gross
        rows = self.searched[found.rows]
        result: dict[str, Any] = {
            "rows": self.numbers[rows].tolist(),
            "where": [where(row) for row in rows.tolist()],
            "distance_sd": found.distance_sd.tolist(),
            "off": found.off.tolist(),
            "unit": unit,
            "p": found.p if rows.size else None,
            "level": LEVEL,
            "kept": kept if self.named.size else None,
            "with": None,
            "without": None,
            "moved_stderr": None,
            "doubtful": found.doubtful,
            "together": self.numbers[self.searched[found.together]].tolist(),
            "not_checked": self.numbers[self.searched[found.alone]].tolist(),
            "not_looked": found.not_looked or None,
        }
        if fits is not None:
            result["with"] = fits[0].to_dict()
            result["without"] = fits[1] if isinstance(fits[1], str) else fits[1].to_dict()
            result["moved_stderr"] = None if isinstance(fits[1], str) else _moved(fits[0], fits[1])
        result["sentence"] = _sentence(name, result, fits, len(self.searched))
        return result


def search(table: Table, left_out: LeaveOut, look: Callable[[IntArray], Mapping[str, GrossErrors]]) -> Searched:
    """Search for gross errors in the rows of a table that are not left out by number; `look` searches rows (k,)."""
    searched = np.setdiff1d(np.arange(len(table)), left_out.rows)
    if not searched.size:
        raise DataError("--leave-out leaves no row to fit")
    return Searched(look(searched), searched, table.numbers, left_out)


def not_searched(rows: IntArray) -> GrossErrors:
    """No search of rows (k,), and it is said."""
    none, unknown = np.zeros(0, np.int64), np.full(len(rows), np.nan)
    return GrossErrors(none, np.zeros(0), np.zeros(0), 1.0, unknown, none, "not asked for")


def kept_with(searched: Searched) -> dict[str, Any]:
    """Information in the stored calibration about its rows."""
    named = searched.numbers[searched.named].tolist()
    return {
        "gross_errors": {"rows": named, "kept": (not searched.left_out.gross) if named else None},
        "rows_left_out": searched.rows_left_out,
    }


def _moved(first: FitSummary, other: FitSummary) -> dict[str, float | None]:
    """Differences of coefficients from those of another fit, in its standard errors."""
    pairs = ((name, first.coefficients[name][0] - b, s) for name, (b, s) in other.coefficients.items())
    return {name: if_finite(off / s) if s > 0 else None for name, off, s in pairs}


def _sentence(
    name: str, result: Mapping[str, Any], fits: tuple[FitSummary, FitSummary | str] | None, count: int
) -> str:
    rows, unit = result["rows"], result["unit"]
    if result["not_looked"]:
        return f"{name}: not looked for gross errors: {result['not_looked']}"
    alone = result["not_checked"]
    unchecked = (
        f"; row{'s' * (len(alone) > 1)} {_listed(alone)} cannot be checked: the model needs each to be fitted at all"
        if alone
        else ""
    )
    doubt = _doubt(result["doubtful"], result["together"], bool(rows))
    if not rows:
        return f"{name}: no gross errors found{doubt}{unchecked}"
    told = [
        f"row {row}{f' ({where})' if where else ''} is {abs(d):.3g} sd off ({f'{off:+.3g} {unit}'.strip()})"
        for row, where, d, off in zip(rows, result["where"], result["distance_sd"], result["off"], strict=True)
    ]
    many = len(rows) > MANY * count
    shown = FARTHEST if many else SHOWN
    more = f", and {len(rows) - shown} more" if len(rows) > shown else ""
    p = f"p {result['p']:.1g}" if result["p"] > 0 else "p < 1e-300"
    state = "IN this calibration" if result["kept"] else "left out of this calibration"
    first = f"{len(rows)} rows; so many may mean that the model lacks something: see rig trace. " if many else ""
    text = f"{name}: gross errors {state}: {first}{'; '.join(told[:shown])}{more} ({p} that chance names any row)"
    if fits is not None:
        text += f". {_compared(fits, result['moved_stderr'])}"
    if not many and result["kept"]:
        text += ". Look in the log, measure again, or fit without them: --leave-out gross"
    return text + doubt + unchecked


def _doubt(count: int, together: Sequence[int], named: bool) -> str:
    """Words for rows that are no gross errors, or cannot be told from them."""
    text = ""
    if together:
        text = (
            f"; rows {_listed(together)} deviate together, as all readings of a setting or along a smooth curve: the "
            f"model lacks something there, or the setting was another. They stay: see rig trace"
        )
    if count:
        text += (
            f"; the scatter is not that of normal errors: up to {count} {'more ' * named}rows may be wrong, but none "
            f"is far enough off by itself"
        )
    return text


def _compared(fits: tuple[FitSummary, FitSummary | str], moved: Mapping[str, float | None] | None) -> str:
    first, other = fits
    if isinstance(other, str):
        return f"Without them the model cannot be fitted: {other}"
    sigmas = [
        f"{key} is {value:.3g} instead of {before:.3g}{first.unit and ' '}{first.unit}"
        for key, value in other.sigmas.items()
        if value is not None and (before := first.sigmas.get(key)) is not None
    ]
    text = f"Without them {', '.join(sigmas)}"
    known = {name: value for name, value in (moved or {}).items() if value is not None}
    if known:
        worst = ties.least(known, key=lambda name: -abs(known[name]))
        text += f"; with them {worst} is {abs(known[worst]):.2g} of its standard errors off"
    return text


def _listed(numbers: Sequence[int]) -> str:
    return ", ".join(str(n) for n in numbers[:SHOWN]) + (" ..." if len(numbers) > SHOWN else "")
