"""Results of a fit of any table beside its coefficients: doubts, intervals of the curve, derived values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy import special

from rig.fitter import LinearFit
from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.constant_scatter import uneven_scatter
from rig.fitter.errors import FitError
from rig.fitter.formula import Formula
from rig.fitter.json_values import if_finite
from rig.fitter.nonlinear import Curve, Distance
from rig.fitter.quantiles import f_tail
from rig.fitter.split_plot import SplitPlotFit
from rig.fitter.strata import TOO_GOOD, chance_of_less
from rig.fitter.sums_of_squares import FTest
from rig.procedures.errors import DataError
from rig.procedures.general.declared import Model
from rig.procedures.general.infer import CurveCalibration, infer_curve
from rig.procedures.general.infer.calibration import student
from rig.procedures.general.rows import CurveRows
from rig.procedures.tables.table import Table

DOUBT = 0.01
"""Probability below which chance is not taken for the cause of a lack of fit."""
_SHOWN, _PLACES = 5, 101
_STEP = 1e-30


@dataclass(frozen=True)
class Judged:
    """Doubts about a fit.

    Attributes:
        notes: sentences.
        figures: tests as JSON values.
    """

    notes: tuple[str, ...] = ()
    figures: Mapping[str, Any] = field(default_factory=dict)


def judged_fit(fit: LinearFit | SplitPlotFit, model: Model, table: Table, rows: IntArray) -> Judged:
    """Doubts about a fit of these rows of a table."""
    notes = [*model.notes]
    figures: dict[str, Any] = {}
    if isinstance(fit, LinearFit):
        if model.stated is not None:
            figures["chi_squared"], told = _against_stated(fit, several=_has_several_minima(model))
            notes += told
        columns, y = model.rows.take(rows).tangent(fit)
        left = y - columns @ fit.coefficients
        figures["lack_of_fit"], told = _lack_of_fit(fit, left, model, table, rows)
        notes += told
    return Judged((*notes, *_uneven(fit, model, table, rows)), figures)


def _has_several_minima(model: Model) -> bool:
    return isinstance(model.rows, CurveRows) and isinstance(model.rows.problem, Distance)


def _against_stated(fit: LinearFit, *, several: bool) -> tuple[dict[str, Any], list[str]]:
    """Test of stated uncertainties by the scatter (ISO/TS 28037:2010, 6.2.2, step 9)."""
    df, p = fit.df, float(special.chdtrc(fit.df, fit.rss)) if fit.df > 0 else float("nan")
    limit = float(special.chdtri(df, 0.05)) if df > 0 else float("nan")
    figures = {"value": fit.rss, "df": df, "limit95": if_finite(limit), "p": if_finite(p)}
    if df > 0 and (less := float(special.chdtr(df, fit.rss))) < TOO_GOOD:
        return figures, [
            f"chi-squared is {fit.rss:.4g} with {df} degrees of freedom, too good to be chance (probability "
            f"{less:.1g}): the stated uncertainties are too large, or have parts that are common to all rows"
        ]
    if not fit.rss > limit:
        return figures, []
    other = (
        ". With errors in the abscissa another, lower minimum is possible, too, though several starts were tried: plot "
        "the curve over the rows"
    )
    return figures, [
        f"chi-squared is {fit.rss:.4g} with {df} degrees of freedom, above {limit:.4g}: the rows scatter more than "
        f"their stated uncertainties allow, or the model lacks something; intervals are then too narrow"
        f"{other if several else ''}"
    ]


def _lack_of_fit(
    fit: LinearFit, left: FloatArray, model: Model, table: Table, rows: IntArray
) -> tuple[dict[str, Any] | None, list[str]]:
    """F test of the means of repeated settings against the scatter within them; None without repeats."""
    every: Mapping[str, Any] = {**table.columns, **table.text}
    names = [name for name in model.curve.names if name in every]
    keys = [np.unique(np.asarray(every[name])[rows], return_inverse=True)[1].reshape(-1) for name in names]
    if not keys:
        return None, []
    group = np.unique(np.column_stack(keys), axis=0, return_inverse=True)[1].reshape(-1)
    count = np.bincount(group)
    between, within = count.size - len(fit.names), len(rows) - count.size
    if between < 1 or within < 1:
        return None, []
    scale = model.rows.take(rows).scale_at(fit)
    # Means of unscaled residuals, each with weight scale^2.
    mean = np.bincount(group, scale * left) / np.bincount(group, scale**2)
    pure = float(np.sum((left - scale * mean[group]) ** 2))
    lack = max(fit.rss - pure, 0.0)
    if not pure > 0.0:
        return None, []
    F = (lack / between) / (pure / within)
    p = f_tail(F, between, within)
    figures = {"F": F, "df": [between, within], "p": p}
    if (less := chance_of_less(FTest(F, between, within))) < 1.0:
        return figures, [
            f"lack of fit: the means of repeated settings are nearer to the curve than scatter lets them be by chance "
            f"(F = {F:.3g} with {between} and {within} degrees of freedom, probability {less:.1g}): repeats do not "
            f"scatter at random, they differ by something else, such as direction or time; see rig trace"
        ]
    if p >= DOUBT:
        return figures, []
    return figures, [
        f"lack of fit: the means of repeated settings are off the curve by more than repeats scatter (F = {F:.3g} with "
        f"{between} and {within} degrees of freedom, p = {p:.1g}); intervals do not cover it; see rig trace"
    ]


def _uneven(fit: LinearFit | SplitPlotFit, model: Model, table: Table, rows: IntArray) -> tuple[str, ...]:
    """Sentence about unequal scatter of the rows; nothing if it is equal."""
    given = model.rows.take(rows)
    columns, y = given.tangent(fit)
    if isinstance(fit, LinearFit):
        left, own = y - columns @ fit.coefficients, 1.0 - fit.variance_function(columns)
    else:
        spectrum, k = fit.structure.spectrum, len(fit.names)
        taken = 1.0 - 1.0 / (1.0 + fit.structure.ratio * spectrum.xi)
        own = 1.0 - np.sum(spectrum.basis[:, :k] ** 2, axis=1) - spectrum.left**2 @ taken
        left = fit.conditional_residuals
    seen = own > 1e-6  # a row that the fit reproduces exactly has no information
    along = {name: table.columns[name][rows][seen] for name in model.curve.names if name in table.columns}
    along["the fitted value"] = given.values(fit)[seen]
    said = uneven_scatter(left[seen] / np.sqrt(own[seen]), along)
    return (said,) if said else ()


def prediction_table(calibration: CurveCalibration) -> dict[str, Any]:
    """The curve at some places of its range, with 95 % intervals of the curve and of one new reading, as JSON values.

    Nothing for curves of several columns, or without an error.
    """
    try:
        name = calibration.variable
        low, high = calibration.ranges[name]
        x = np.linspace(low, high, _SHOWN) if high > low else np.array([low])
        rows, curve = calibration.rows(x), calibration.curve(x)
    except FitError:
        return {}
    half = calibration.half_width(rows)
    variance, df = calibration.curve_variance(rows)
    own = student(df) * np.sqrt(variance)
    keys = (name, "value", "confidence95", "prediction95")
    return {
        "predictions": [
            dict(zip(keys, map(if_finite, each), strict=True)) for each in zip(x, curve, own, half, strict=True)
        ]
    }


def predicted_at(calibration: CurveCalibration, points: Sequence[Mapping[str, float]], source: str) -> dict[str, Any]:
    """The response at points that were asked for, with the uncertainty of the curve and of one new reading.

    The standard uncertainty of the curve counts the correlation of its coefficients (JCGM 100, H.3.4).

    Args:
        calibration: of any number of variables.
        points: values of all of them, at each point.
        source: of the table, for messages.

    Raises:
        DataError: a point lacks a variable, or has others, or the curve has no value there.
    """
    names = list(calibration.formula.names)
    for point in points:
        if set(point) != set(names):
            given, needed = ", ".join(point), ", ".join(names)
            raise DataError(
                f"{source}: --at has {given}, and the model is of {needed}: give a value of each, no others"
            )
    columns = {name: np.array([point[name] for point in points]) for name in names}
    try:
        values = calibration.formula.value(calibration.coefficients, columns)
        rows = calibration.formula.rows(calibration.coefficients, columns)
    except FitError as error:
        raise DataError(f"{source}: --at: {error}") from error
    variance, df = calibration.curve_variance(rows)
    known = len(calibration.variances) > 0
    u = np.sqrt(variance) if known else np.full(len(points), np.nan)
    half = calibration.half_width(rows) if known else u
    own = student(df) * u
    return {
        "predictions": [
            {
                **point,
                "value": if_finite(float(values[k])),
                "standard_uncertainty": if_finite(float(u[k])),
                "df": if_finite(float(df[k])),
                "confidence95": if_finite(float(own[k])),
                "prediction95": if_finite(float(half[k])),
                "outside": [n for n in names if not calibration.ranges[n][0] <= point[n] <= calibration.ranges[n][1]],
            }
            for k, point in enumerate(points)
        ]
    }


def within_tolerance(
    calibration: CurveCalibration, tolerance: float | None, source: str, between: tuple[float, float] | None = None
) -> dict[str, Any]:
    """The widest 95 % interval of a value inferred from one reading, over the range, against a tolerance.

    Args:
        calibration: of one variable.
        tolerance: largest accepted half-width, in units of the variable; None for no such test.
        source: of the table, for messages.
        between: the range in which values are inferred; None for all that was calibrated.

    Raises:
        DataError: there is a range without a tolerance, the tolerance is no positive number, or the curve cannot be
            inverted.
    """
    if tolerance is None:
        if between is not None:
            raise DataError("--between of a fit belongs to --tolerance; for readings, rig infer has it too")
        return {}
    calibration = calibration.within(between)
    if not 0.0 < tolerance < np.inf:
        raise DataError(f"--tolerance {tolerance:g}: it has to be a number above zero")
    try:
        low, high = calibration.limits
        x = np.linspace(low, high, _PLACES)
        found = infer_curve(calibration, calibration.curve(x))
    except FitError as error:
        raise DataError(f"{source}: --tolerance: the calibration cannot be inverted: {error}") from error
    half = np.maximum(found.hi95 - found.value, found.value - found.lo95)
    open_ended = not np.isfinite(half).all()
    worst = int(np.argmax(np.where(np.isfinite(half), half, np.inf)))
    told = {
        "tolerance": tolerance,
        "half_width95": None if open_ended else float(half[worst]),
        "at": float(x[worst]),
        **({} if between is None else {"between": [low, high]}),
        "inside": bool(not open_ended and half[worst] <= tolerance),
    }
    return {"acceptance": told}


def derived_table(curve: Curve, calibration: CurveCalibration) -> dict[str, Any]:
    """Numbers that follow from the parameters of a standard model, with standard errors by the delta method."""
    from rig.procedures.general.models import NamedCurve  # noqa: PLC0415 - plain formulas need no models

    if isinstance(curve, Formula) or not isinstance(curve, NamedCurve) or not curve.model.derived:
        return {}
    b: Sequence[float] = calibration.coefficients.tolist()
    told = {}
    for one in curve.model.derived:
        gradient = [
            np.imag(one.of([complex(value, _STEP * (i == j)) for i, value in enumerate(b)])) / _STEP
            for j in range(len(b))
        ]
        variance = calibration.factored.variance(np.array([gradient]))[0]
        error = float(np.sqrt(variance)) if len(calibration.variances) else float("nan")
        told[one.name] = {
            "estimate": float(one.of(b)),
            "stderr": if_finite(error),
            "unit": one.unit,
            "meaning": one.meaning,
        }
    return {"derived": told}
