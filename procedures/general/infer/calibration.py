"""A fitted curve with what its inversion needs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.polynomial import Chebyshev
from scipy import special

from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.fitter.nonlinear import Curve
from rig.procedures.general.curves import curve_from_dict, curve_to_dict
from rig.procedures.general.infer.factored import Factored
from rig.procedures.tables.within import Within


@dataclass(frozen=True, eq=False)
class CurveCalibration:
    """A fitted formula with the data for its inversion.

    Attributes:
        response: name of the explained column.
        formula: the curve, of k coefficients.
        coefficients: (k,).
        covariance: (k, k).
        variances: (c,) of one reading: its own, and those common to its whole plot and replication; () without degrees
            of freedom.
        derivatives: (c, k, k) of the covariance by the variances.
        spread: (c, c) covariance of the variances.
        ranges: lowest and highest value calibrated of every variable of the formula.
        factor: the covariance and its derivatives in factored form, with smaller rounding errors; None in older files.
        notes: the fit's notes about its intervals.
        reading: known standard uncertainty of one new reading; None if `variances` has it.
        fixed: known values of the other variables of the formula, by name: one, or (n,), one for each place of the
            curve that is asked for.
        between: the range in which the variable is known to be; None for all that was calibrated.
        value_only: whether values are inferred from it without standard deviations and intervals.
        change: of the variance of a reading in use that is the mean of another number of readings than those of the
            run, and its degrees of freedom.
    """

    response: str
    formula: Curve
    coefficients: FloatArray
    covariance: FloatArray
    variances: FloatArray
    derivatives: FloatArray
    spread: FloatArray
    ranges: Mapping[str, tuple[float, float]]
    factor: Factored | None = None
    notes: tuple[str, ...] = ()
    reading: float | None = None
    fixed: Mapping[str, float | FloatArray] = field(default_factory=dict)
    between: tuple[float, float] | None = None
    value_only: bool = False
    change: tuple[float, float] = (0.0, np.inf)

    @property
    def variables(self) -> tuple[str, ...]:
        """Variables of the formula that have no known value."""
        return tuple(name for name in self.formula.names if name not in self.fixed)

    @property
    def variable(self) -> str:
        """The only variable, which the response determines. Raises FitError with the reason if there is none."""
        if self.formula.has_categories or len(self.variables) != 1:
            names = ", ".join(self.variables) or "no column"
            raise FitError(
                f"its formula has {names}; a curve is inverted where it has one column of numbers, as in "
                f"'1 + x + x^2', or where the values of all others are known"
            )
        if not len(self.variances):
            raise FitError(
                "it was fitted to as many rows as it has coefficients, so its error is unknown; fit more rows"
            )
        return self.variables[0]

    def at(self, fixed: Mapping[str, float | FloatArray]) -> CurveCalibration:
        """This calibration with known values of other variables."""
        return replace(self, fixed={**self.fixed, **fixed})

    def within(self, between: tuple[float, float] | None) -> CurveCalibration:
        """This calibration for values of the variable in a range; unchanged for None. `limits` checks the range."""
        return replace(self, between=between)

    @property
    def limits(self) -> tuple[float, float]:
        """The range in which the variable is inferred. Raises `FitError` if the stated one was not calibrated."""
        name = self.variable
        low, high = self.ranges[name]
        if self.between is None:
            return low, high
        first, last = self.between
        if not first < last:
            raise FitError(f"--between {first:g} {last:g}: it has to be two numbers, the smaller one first")
        if not (low <= first and last <= high):
            raise FitError(
                f"--between {first:g} {last:g}: {name} was calibrated from {low:g} to {high:g}; state a range in it"
            )
        return first, last

    def _columns(self, x: FloatArray) -> dict[str, FloatArray]:
        """(n,) values of all variables."""
        return {self.variable: x, **{name: np.full_like(x, value) for name, value in self.fixed.items()}}

    @property
    def factored(self) -> Factored:
        """The covariance and its derivatives, factored if the file has them so."""
        return self.factor or Factored.plain(self.covariance, self.derivatives)

    def to_dict(self) -> dict[str, Any]:
        """JSON values; `from_dict` restores the same object."""
        return {
            "kind": "general",
            "response": self.response,
            **curve_to_dict(self.formula),
            "coefficients": self.coefficients.tolist(),
            "covariance": self.covariance.tolist(),
            "variances": self.variances.tolist(),
            "derivatives": self.derivatives.tolist(),
            "spread": self.spread.tolist(),
            "ranges": {name: list(pair) for name, pair in self.ranges.items()},
            "notes": list(self.notes),
            **({} if self.reading is None else {"reading": self.reading}),
            **({} if self.factor is None else {"covariance_factor": self.factor.to_dict()}),
        }

    @staticmethod
    def from_dict(given: Mapping[str, Any]) -> CurveCalibration:
        """Restore from `to_dict`. Raises FitError for anything else."""
        if given.get("kind") != "general":
            raise FitError(f"this is not a calibration of a general table, its kind is {given.get('kind')!r}")
        try:
            numbers = {name: np.array(given[name], np.float64) for name in _NUMBERS}
            formula = curve_from_dict(given)
            ranges = {str(name): (float(low), float(high)) for name, (low, high) in given["ranges"].items()}
            response = str(given["response"])
            notes = tuple(str(note) for note in given.get("notes", ()))
            reading = None if given.get("reading") is None else float(given["reading"])
            factor = Factored.from_dict(given["covariance_factor"]) if "covariance_factor" in given else None
        except (KeyError, TypeError) as problem:
            raise FitError(f"a calibration of a general table lacks or garbles {problem}") from problem
        k, c = len(numbers["coefficients"]), len(numbers["variances"])
        wanted = dict(zip(_NUMBERS, ((k,), (k, k), (c,), (c, k, k), (c, c)), strict=True))
        for name, values in numbers.items():
            if (c and values.shape != wanted[name]) or not np.isfinite(values).all():
                raise FitError(f"a calibration of a general table garbles {name}")
        if len(numbers["derivatives"]) != c or len(numbers["spread"]) != c:
            raise FitError("a calibration of a general table garbles variances")
        if factor is not None and c and not factor.fits(k, c):
            raise FitError("a calibration of a general table garbles covariance_factor")
        if not {*formula.names} <= {*ranges}:
            raise FitError("a calibration of a general table lacks ranges of its variables")
        if not formula.has_categories and k != len(formula.parameters):
            raise FitError("a calibration of a general table garbles coefficients")
        if reading is not None and not 0.0 <= reading < np.inf:
            raise FitError("a calibration of a general table garbles reading")
        return CurveCalibration(
            response,
            formula,
            numbers["coefficients"],
            numbers["covariance"],
            numbers["variances"],
            numbers["derivatives"],
            numbers["spread"],
            ranges,
            factor,
            notes,
            reading,
        )

    def moved(self, coefficients: FloatArray) -> CurveCalibration:
        """This calibration with (k,) other coefficients, for values alone: what an influence does to them."""
        return replace(self, coefficients=coefficients, value_only=True)

    def for_readings(self, within: Within, count: float) -> CurveCalibration:
        """This calibration for readings in use that are means of `count` readings."""
        own = float(self.variances[0]) if len(self.variances) else 0.0
        return replace(self, change=(within.change(own, count), max(within.df, 1.0)))

    def with_reading(self, u: float) -> CurveCalibration:
        """This calibration for readings of a known standard uncertainty, in units of the response."""
        return replace(self, reading=u)

    def curve(self, x: FloatArray) -> FloatArray:
        """(n,) response at (n,) values of the variable. Raises `FitError` outside the curve's domain."""
        return self.formula.value(self.coefficients, self._columns(x))

    def rows(self, x: FloatArray) -> FloatArray:
        """(n, k) its derivative by the coefficients. Raises `FitError` outside the curve's domain."""
        found = self.formula.rows(self.coefficients, self._columns(x))
        if not np.isfinite(found).all():
            raise FitError(f"the curve {self.formula} has no derivative everywhere")
        return found

    def slope(self, x: FloatArray) -> FloatArray:
        """(n,) its derivative by the variable; not finite where there is none."""
        with np.errstate(all="ignore"):  # a logarithm at zero: the caller checks the result
            return self.formula.slope(self.coefficients, self._columns(x), self.variable)

    def reading_variance(self, rows: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n,) variance of a new reading minus the curve at (n, k) `rows`, and its degrees of freedom.

        Satterthwaite's of the estimated variances; infinite if all are known. The mean of more readings than in the run
        is at least as certain as that of those: where a difference of two estimates gives a wider interval, both are of
        the latter.
        """
        variance, df = self._reading_variance(rows, self.change)
        if self.change[0] < 0.0:
            least, of_least = self._reading_variance(rows, (0.0, np.inf))
            wider = student(df) * np.sqrt(variance) > student(of_least) * np.sqrt(least)
            variance, df = np.where(wider, least, variance), np.where(wider, of_least, df)
        return variance, df

    def _reading_variance(self, rows: FloatArray, by: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
        """As `reading_variance`, with another change."""
        change, df = by
        own = self.variances.sum() + change if self.reading is None else self.reading**2
        of_curve, gradient = self.factored.moments(rows)
        variance, gradient = of_curve + own, gradient + (1.0 if self.reading is None else 0.0)
        plain = gradient @ self.variances + (change if self.reading is None else own)
        uncertain = np.einsum("nc,nc->n", gradient @ self.spread, gradient) + 2.0 * change**2 / df
        if not plain.all():  # the curve fits every row exactly: zero width, for any degrees of freedom
            return variance, np.ones(len(rows))
        with np.errstate(divide="ignore"):
            return variance, np.asarray(2.0 * plain**2 / uncertain)

    def curve_variance(self, rows: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n,) variance of the curve itself at (n, k) `rows`, and its degrees of freedom."""
        variance, gradient = self.factored.moments(rows)
        plain, uncertain = gradient @ self.variances, np.einsum("nc,nc->n", gradient @ self.spread, gradient)
        with np.errstate(divide="ignore", invalid="ignore"):
            df = np.where(plain > 0.0, 2.0 * plain**2 / uncertain, 1.0)
        return variance, df

    def half_width(self, rows: FloatArray) -> FloatArray:
        """(n,) half-width of the 95 % prediction interval of a new reading at (n, k) `rows`."""
        variance, df = self.reading_variance(rows)
        return np.asarray(student(df) * np.sqrt(variance))


def student(df: FloatArray) -> FloatArray:
    """(n,) two-tailed 95 % limits of Student's t, for infinite degrees of freedom too.

    From one degree of freedom by a polynomial in 1 / df, in a twentieth of the time, within 1e-12 of themselves.
    """
    with np.errstate(divide="ignore"):
        limit = _limits()(np.minimum(1.0 / df, 1.0))
    few = df < 1.0
    if few.any():
        limit[few] = special.stdtrit(df[few], 0.975)
    return np.asarray(limit)


@cache
def _limits() -> Chebyshev:
    """The limit of Student's t as a function of 1 / df, from 0 to 1."""

    def limit(u: FloatArray) -> FloatArray:
        return np.where(u > 1.0 / _NORMAL, special.stdtrit(1.0 / np.maximum(u, 1.0 / _NORMAL), 0.975), _NORMAL_LIMIT)

    return Chebyshev.interpolate(limit, 24, [0.0, 1.0])


_NORMAL = 1e10
"""Degrees of freedom from which the distribution is taken as normal."""
_NORMAL_LIMIT = special.ndtri(0.975)
_NUMBERS = ("coefficients", "covariance", "variances", "derivatives", "spread")
