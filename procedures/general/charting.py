"""Control charts of a column of tables of any kind: the response at as many places as the curve has coefficients.

Those values say the same as the coefficients, but are hardly correlated and have one unit; the coefficients are shown.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import PurePath
from typing import Any

import numpy as np
from scipy.linalg import qr

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.errors import FitError
from rig.fitter.history import Charted, Series
from rig.fitter.quantiles import t_limit
from rig.procedures.errors import DataError
from rig.procedures.evaluate.charting import Calibrations, Charting, Shown, View
from rig.procedures.general.infer import CurveCalibration, too_few_digits
from rig.procedures.present.shell import shell_word
from rig.procedures.tables.table import Table
from rig.procedures.tables.unused import known_unit_of

_LEVELS, _FEW = 5, 4
"""Levels of each variable of a formula with several, and the largest number of variables with so many."""
_PLACES = 33
"""Number of places of the range for the bound of the response's error."""


@dataclass(frozen=True, eq=False)
class CurveCharted(Charted):
    """The response at k settings in the common ranges of all calibrations.

    Attributes:
        ranges: lowest and highest value of each variable, common to all calibrations.
        rows: (H, k) derivative of the response by each charted value, over the range.
        interval: half-width of the last calibration's 95 % interval of one new reading, at its widest.
    """

    ranges: Mapping[str, tuple[float, float]]
    rows: FloatArray
    interval: float


def curve_charted(fits: Sequence[CurveCalibration], years: FloatArray) -> CurveCharted:
    """Charted values of one response.

    Args:
        fits: m of them, of one formula, in order of time.
        years: (m,) since the first.

    Raises:
        FitError: a formula has categories, an error is unknown, rounding leaves too few digits of one, or the
            ranges have nothing in common.
    """
    formula, last = fits[0].formula, fits[-1]
    variables = formula.names if len(formula.names) > 1 and not formula.has_categories else (fits[0].variable,)
    common = {name: (max(f.ranges[name][0] for f in fits), min(f.ranges[name][1] for f in fits)) for name in variables}
    for name, (low, high) in common.items():
        if not low < high:
            raise FitError(f"the calibrations have no range of {name} in common")
    low, high = common[variables[0]]
    if len(variables) == 1:
        for fit in fits:
            if few := too_few_digits(fit, low, high):
                raise FitError(few)
        points = np.linspace(low, high, 2 * len(last.coefficients) + 1)[1::2][:, None]
        over = np.linspace(low, high, _PLACES)[:, None]
    else:
        over = _grid([*common.values()])
        points = over[_independent(_rows(last, variables, over))]
    directions, across = _rows(last, variables, points), _rows(last, variables, over)
    values = np.array([_curve(fit, variables, points) for fit in fits])

    def variance_of(weights: FloatArray) -> tuple[FloatArray, float]:
        return _within(fits, weights @ directions)

    root = (
        last.factored.root
    )  # powers of an abscissa far from zero are nearly dependent; their combinations here are not
    widest = float(last.factored.variance(across).max() + last.variances.sum())
    _, df = _within([last], across[-1])
    names = tuple(
        f"{last.response} at {', '.join(f'{n} = {v:.6g}' for n, v in zip(variables, point, strict=True))}"
        for point in points.tolist()
    )
    return CurveCharted(
        names=names,
        series=tuple(Series(years, values[:, i], *variance_of(unit)) for i, unit in enumerate(np.eye(len(names)))),
        shown=formula.parameters,
        parameters=np.array([fit.coefficients for fit in fits]),
        stderr=np.sqrt([np.diag(fit.covariance) for fit in fits]),
        sensitivity=1.0,
        replicated=True,
        variance_of=variance_of,
        ranges=common,
        rows=np.asarray(np.linalg.solve((directions @ root).T, (across @ root).T).T),
        interval=t_limit(0.95, df) * float(np.sqrt(widest)),
    )


def _grid(ranges: Sequence[tuple[float, float]]) -> FloatArray:
    """(n, v) settings over the ranges of several variables, the corners among them."""
    levels = _LEVELS if len(ranges) <= _FEW else 2
    axes = np.meshgrid(*(np.linspace(low, high, levels) for low, high in ranges), indexing="ij")
    return np.column_stack([axis.reshape(-1) for axis in axes])


def _independent(rows: FloatArray) -> IntArray:
    """(k,) rows, of (n, k), that determine all coefficients best, one after the other."""
    scaled = rows / np.maximum(np.linalg.norm(rows, axis=0), np.finfo(float).tiny)
    return np.sort(np.asarray(qr(scaled.T, pivoting=True, mode="r")[1][: rows.shape[1]], np.int64))


def _rows(fit: CurveCalibration, variables: Sequence[str], points: FloatArray) -> FloatArray:
    """(n, k) derivative of the response by the coefficients at (n, v) settings."""
    return fit.formula.rows(fit.coefficients, dict(zip(variables, points.T, strict=True)))


def _curve(fit: CurveCalibration, variables: Sequence[str], points: FloatArray) -> FloatArray:
    """(n,) response at (n, v) settings."""
    return fit.formula.value(fit.coefficients, dict(zip(variables, points.T, strict=True)))


def _within(fits: Sequence[CurveCalibration], direction: FloatArray) -> tuple[FloatArray, float]:
    """(m,) variance within of `direction` @ coefficients and its degrees of freedom, pooled over the calibrations.

    Independent rows: one variance of a row, with each calibration's own design. Whole plots: one common design of the
    calibrations is assumed, and the variance of the combination is pooled.
    """
    row = direction[None, :]
    gradients = [fit.factored.gradient(row)[0] for fit in fits]
    own = np.array([g @ fit.variances for g, fit in zip(gradients, fits, strict=True)])
    uncertain = np.array([g @ fit.spread @ g for g, fit in zip(gradients, fits, strict=True)])
    if not (uncertain > 0.0).all():
        raise FitError("a calibration goes through every row: its own error is unknown")
    df = 2.0 * own**2 / uncertain
    if all(len(fit.variances) == 1 for fit in fits):
        pooled = df @ np.array([fit.variances[0] for fit in fits]) / df.sum()
        return pooled * np.array([g[0] for g in gradients]), float(df.sum())
    adjusted = np.array([fit.factored.variance(row)[0] for fit in fits])
    return np.full(len(fits), float(df @ adjusted / df.sum())), float(df.sum())


class GeneralCharting(Charting):
    """Control charts of a table's sensors: by coefficients of one formula, or of one curve."""

    def of_table(self, table: Table, formula: str | None) -> Calibrations:
        """Every sensor of a run; any other table does not define response and formula, a calibration file does."""
        if table.outputs:
            from rig.procedures.general.of_runs import RunModels, fit_run  # noqa: PLC0415 - charts of files need no fit

            asked = RunModels.of(table, None, formula)
            assert asked is not None
            found = self.of_file(fit_run(asked).to_json(), table.source)
            return replace(found, simulated=table.simulated, provenance=table.provenance)
        raise DataError(
            f"Make a calibration of any other table first, rig fit {shell_word(table.source)} "
            f"--response Y --formula '1 + X' --out "
            f"C.json, and chart C.json@DATE"
        )

    def of_file(self, content: Mapping[str, Any], source: str) -> Calibrations:
        """Calibrations of one response, or of every sensor of a run; those of tables have no date of their own."""
        each = content["sensors"].values() if "sensors" in content else [content]
        curves = [CurveCalibration.from_dict(one["calibration"]) for one in each if "calibration" in one]
        sensors = {curve.response: curve for curve in curves}
        simulated = bool(content["data"].get("simulated"))
        return Calibrations(
            sensors, dict.fromkeys(sensors, ()), simulated, {**content["data"], "file": PurePath(source).name}
        )

    def view(self, every: Sequence[CurveCalibration], years: FloatArray, usage: float | None) -> View:
        """Use over the common range of all calibrations."""
        if usage is not None:
            raise DataError("--usage is a range of pitch; others are charted over the range calibrated")
        charted, last = curve_charted(every, years), every[-1]
        plots = any(len(fit.variances) > 1 for fit in every)
        unit = known_unit_of(last.response)
        return View(
            charted=charted,
            shown={name: Shown(name, 1.0, unit or f"in {last.response}") for name in charted.names},
            rows=charted.rows,
            model=str(last.formula),
            unit=unit or last.response,
            drawn=(unit or last.response, 1.0),
            usage=next(iter(charted.ranges.values())),
            usage_words=", ".join(f"{name} {low:g} to {high:g}" for name, (low, high) in charted.ranges.items()),
            interval=charted.interval,
            remarks=[
                *(["the calibrations' whole plots are taken to be of one design"] if plots else []),
            ],
        )
