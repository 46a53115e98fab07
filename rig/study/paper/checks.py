"""What sections 9 and 10 say of experiments 22 to 54, checked on the simulated ones: the pattern, not the digits."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from fitter.angles import sin_cos
from fitter.arrays import FloatArray
from rig.study.paper import printed
from rig.study.paper.angles import Package
from rig.study.paper.printed import Row
from rig.study.paper.statement import Statement, above, below
from rig.study.paper.table_2 import SCALE, UNDER, Measured

_FULL = ("28(b)", "37", "44(a)", "44(b)", "44(c)", "47(a)", "47(b)", "47(c)")
_PADS = ("28(b)", "35", "37", "44(a)", "44(b)", "47(a)", "47(b)", "47(c)", "53 x", "53 y", "53 z")
_TUMBLE = tuple(f"50 {axis}" for axis in "xyz")


def checks(measured: Measured) -> tuple[Statement, ...]:
    """Every check that the nights there are allow."""
    known = set(measured.figures())
    groups: tuple[tuple[set[str], Callable[[Measured], Iterator[Statement]]], ...] = (
        ({"22", "24", "26"}, _without_roll),
        ({"28(a)", "28(b)", "34", "35"}, _within_30),
        ({"37", "42"}, _all_round),
        ({"44(a)"}, _three_axes_90),
        ({"47(a)", "50 x", "53 x"}, _three_axes_180),
    )
    return tuple(check for needed, group in groups if needed <= known for check in group(measured))


def _without_roll(m: Measured) -> Iterator[Statement]:
    r = m.rows
    yield _not_significant(r["22"], "T_bias", "+-36 deg does not show the pads")
    yield _significant(r["24"], "T_bias", "+-180 deg does")
    yield _printed(
        above("24", "sigma_E is larger than that of figure 22: ratio", r["24"].sigma_E / r["22"].sigma_E, 1.3),
        f"{3.17 / 1.60:.2f}",
    )
    share = _share(m, "24", 2.0 * _data(m, "24")[0], np.zeros(1))
    yield above("24", "two periods of pitch in 360 deg: share of the systematic residual", share, 0.9)
    for figure in ("24", "26"):
        for test in ("T_b", "T_S"):
            yield _not_significant(r[figure], test, "no drift of the sensor")
    yield _significant(r["26"], "T_bias", "the four-point tumble shows a bias")
    yield _printed(
        above(
            "26",
            "calibration intervals are larger than those of figure 24: ratio",
            _calibration(m, "26") / _calibration(m, "24"),
            2,
        ),
        "larger",
    )
    error, _ = Package.of(m, "22").errors()
    rms = SCALE * float(np.sqrt(np.nanmean(error**2)))
    yield _printed(
        below("23", "rms of inferred angles over sigma_E, near one", abs(rms / r["22"].sigma_E - 1.0), 0.25),
        f"{1.74 / 1.60 - 1:.2f}",
    )
    pitch = _data(m, "24")[0]
    package = Package.of(m, "24")
    error = np.abs(package.errors()[0])
    at_90 = np.abs(np.abs(pitch) - 90.0) < 0.1
    open_or_far = float(np.mean(~(error[at_90] < 1e-3)))
    yield above("25", "most inferred angles at +-90 deg are outside the chart (1e-3 deg): share", open_or_far, 0.5)
    level, steep = package.half_widths(np.array([0.0, 89.0]), np.zeros(2), of_roll=False)[1]
    yield above("25", "intervals become unbounded there: at 89 deg over that at 0", float(steep / level), 20)


def _within_30(m: Measured) -> Iterator[Statement]:
    r = m.rows
    a, b = r["28(a)"], r["28(b)"]
    yield _printed(
        _between("28(a), (b)", "temperature correction halves sigma_E: ratio", a.sigma_E / b.sigma_E, 1.5, 2.7), "2.01"
    )
    yield _printed(above("28(a)", "very significant sensitivity drift before it: T_S", a.T_S, 100), f"{919}")
    yield _printed(above("28(a)", "... less significant offset drift: T_S / T_b", a.T_S / a.T_b, 2), f"{919 / 102:.1f}")
    yield _printed(below("28(a)", "T_bias only minimally significant", a.T_bias, 3), "1.33")
    yield _printed(
        below("28(b)", "drift greatly reduced: T_S after / before", b.T_S / a.T_S, 0.05), f"{5.14 / 919:.3f}"
    )
    yield _printed(above("28(b)", "T_bias after / before", b.T_bias / a.T_bias, 5), f"{26.2 / 1.33:.0f}")
    residual, (pitch, roll) = _means(m, "28(b)"), _data(m, "28(b)")
    steep, mid = np.abs(pitch) > 29.0, np.abs(pitch) < 6.0
    yield above(
        "30",
        "greatest dispersion at +-30 deg of pitch, least near 0: ratio",
        _rms(residual, steep) / _rms(residual, mid),
        2,
    )
    level = np.isclose(np.abs(roll), 0.0) | np.isclose(np.abs(roll), 180.0)
    side = np.isclose(np.abs(roll), 90.0)
    yield below(
        "31, 32",
        "least dispersion near +-90 deg of roll, greatest near 0 and 180: ratio",
        _rms(residual, side) / _rms(residual, level),
        0.5,
    )
    yield _not_significant(r["34"], "T_bias", "sensor 2")
    yield _printed(
        above("34", "strong drift of sensor 2: the smaller of T_b and T_S", min(r["34"].T_b, r["34"].T_S), 100), "1570"
    )
    yield _fraction(m, "35", "28(b)")
    yield _wider(m, "35", "28(b)")
    yield _under(m, "36")


def _all_round(m: Measured) -> Iterator[Statement]:
    r = m.rows
    yield _significant(r["37"], "T_bias", "sensor 1 over +-180 deg")
    share = _share(m, "37", 2.0 * _data(m, "37")[0], _data(m, "37")[1])
    yield above("39, 41", "two periods of pitch and one of roll: share of the systematic residual", share, 0.7)
    yield _not_significant(r["42"], "T_bias", "sensor 2")
    yield _printed(
        above("42", "strong drift of sensor 2: the smaller of T_b and T_S", min(r["42"].T_b, r["42"].T_S), 100), "717"
    )


def _three_axes_90(m: Measured) -> Iterator[Statement]:
    for figure in ("44(a)", "44(b)", "44(c)"):
        yield _significant(m.rows[figure], "T_bias", "each of the three sensors")
        yield _significant(m.rows[figure], "T_b", "offset drift of each")
    yield _significant(m.rows["44(a)"], "T_S", "sensitivity drift of x")
    yield _not_significant(m.rows["44(b)"], "T_S", "sensitivity drift of y")
    yield _significant(m.rows["44(c)"], "T_S", "sensitivity drift of z")
    package, at = Package.of(m, "44(a)", "44(b)", "44(c)"), np.linspace(-80, 80, 33)
    of_roll, of_pitch = (package.half_widths(at, np.zeros(33), of_roll=which)[1] for which in (True, False))
    ratio = float(np.mean(of_roll) / np.mean(of_pitch))
    yield above(
        "45, 46",
        "prediction intervals of roll are significantly greater than those of pitch: ratio of means within +-80 deg",
        ratio,
        1.5,
    )


def _three_axes_180(m: Measured) -> Iterator[Statement]:
    r = m.rows
    share = _share(m, "47(a)", 2.0 * _data(m, "47(a)")[0], _data(m, "47(a)")[1])
    yield above("47(a)", "two periods of pitch (and one of roll) of x: share of the systematic residual", share, 0.6)
    for figure, test in (("47(a)", "T_b"), ("47(a)", "T_S"), ("47(c)", "T_b"), ("47(c)", "T_S")):
        yield _significant(r[figure], test, "drift of x and z")
    for figure in _TUMBLE[:2]:
        yield _significant(r[figure], "T_bias", "six-point tumble, x and y")
        yield _not_significant(r[figure], "T_b", "... no drift detected")
        yield _not_significant(r[figure], "T_S", "... no drift detected")
    for axis in "xyz":
        yield from _tumble(m, f"52 {axis}")
    for axis, letter in zip("xyz", "abc", strict=True):
        yield _fraction(m, f"53 {axis}", f"47({letter})")
    yield _wider(m, "53 x", "47(a)")
    yield _printed(
        below(
            "53 x",
            "offset drift is not detected any more: T_b / T_b of figure 47(a)",
            r["53 x"].T_b / r["47(a)"].T_b,
            0.5,
        ),
        f"{2.03 / 15.0:.2f}",
    )
    yield _printed(
        below(
            "53 x",
            "sensitivity drift considerably less significant: T_S / T_S of 47(a)",
            r["53 x"].T_S / r["47(a)"].T_S,
            0.5,
        ),
        f"{9.73 / 76.7:.2f}",
    )
    for axis in "xyz":
        yield _under(m, f"54 {axis}")


def ranges(measured: Measured) -> tuple[Statement, ...]:
    """Sizes of Table 2 that the simulated sensors were made to have."""
    rows = measured.rows
    found = [
        _printed(_between(f, "sigma_E / 1e-4 deg", rows[f].sigma_E, 2.0, 6.0), f"{printed.ROWS[f].sigma_E:g}")
        for f in _FULL
        if f in rows
    ]
    found += [
        _printed(_between(f, "T_bias", rows[f].T_bias, 10.0, 115.0), f"{printed.ROWS[f].T_bias:g}")
        for f in _PADS
        if f in rows
    ]
    return tuple(found)


def _tumble(m: Measured, figure: str) -> Iterator[Statement]:
    full, small = UNDER[figure]
    ratio = m.residual_sd(full, small) / m.rows[small].sigma_E
    was = printed.RESIDUAL_SD[figure] / printed.ROWS[small].sigma_E
    yield _printed(above(figure, "sd of the full data's residuals over the tumble's sigma_E", ratio, 1.2), f"{was:.1f}")
    data, fit = m.data(full), m.fit(small)
    half = np.degrees(fit.linear.prediction(fit.columns(data.pitch_deg, data.roll_deg)) / fit.parameters.S_V)
    covered = float(np.mean(np.abs(m.residual_deg(full, small)) < half))
    yield below(figure, "its 95 % prediction interval covers too few of them", 100 * covered, 95, "%")
    yield above(
        figure,
        "its calibration interval is wider than the full one's: ratio",
        _calibration(m, small) / _calibration(m, full),
        2,
    )


def _fraction(m: Measured, small: str, full: str) -> Statement:
    change = 100 * (m.rows[small].sigma_E / m.rows[full].sigma_E - 1.0)
    was = 100 * (printed.ROWS[small].sigma_E / printed.ROWS[full].sigma_E - 1.0)
    return _printed(below(small, f"sigma_E near that of {full}: change", abs(change), 25, "%"), f"{abs(was):.0f} %")


def _wider(m: Measured, small: str, full: str) -> Statement:
    ratio = _calibration(m, small) / _calibration(m, full)
    return _printed(above(small, f"calibration intervals larger than those of {full}: ratio", ratio, 1.5), "larger")


def _under(m: Measured, figure: str) -> Statement:
    full, small = UNDER[figure]
    worse = 100 * (m.residual_sd(full, small) / m.rows[full].sigma_E - 1.0)
    was = 100 * (printed.RESIDUAL_SD[figure] / printed.ROWS[full].sigma_E - 1.0)
    return _printed(
        below(figure, f"residuals of {full} under coefficients of {small}: sd larger by", worse, 3, "%"), f"{was:.1f} %"
    )


def _significant(row: Row, test: str, says: str) -> Statement:
    value, limit = getattr(row, test), row.F_bias if test == "T_bias" else row.F_bS
    return _printed(above(row.figure, f"{test} significant: {says}", value, round(limit, 2)), _of(row, test))


def _not_significant(row: Row, test: str, says: str) -> Statement:
    value, limit = getattr(row, test), row.F_bias if test == "T_bias" else row.F_bS
    return _printed(below(row.figure, f"{test} not significant: {says}", value, round(limit, 2)), _of(row, test))


def _of(row: Row, test: str) -> str:
    return f"{getattr(printed.ROWS[row.figure], test):g}"


def _between(where: str, says: str, value: float, low: float, high: float) -> Statement:
    return Statement(where, says, "", f"{value:.3g}", "", f"{low:g} to {high:g}", low <= value <= high)


def _printed(statement: Statement, value: str) -> Statement:
    return Statement(**{**vars(statement), "printed": value})


def _calibration(m: Measured, figure: str) -> float:
    """Half-width of the calibration interval at level attitude, 1e-4 deg."""
    fit = m.fit(figure)
    half = fit.linear.confidence(fit.columns(np.zeros(1), np.zeros(1)))
    return SCALE * float(np.degrees(half[0] / fit.parameters.S_V))


def _data(m: Measured, figure: str) -> tuple[FloatArray, FloatArray]:
    data = m.data(figure)
    return data.pitch_deg, data.roll_deg


def _means(m: Measured, figure: str) -> FloatArray:
    """(n,) systematic residual: mean over the replications of each row's point, deg."""
    point, residual = m.data(figure).point, m.residual_deg(figure)
    return np.asarray((np.bincount(point, residual) / np.bincount(point))[point])


def _share(m: Measured, figure: str, of_pitch: FloatArray, of_roll: FloatArray) -> float:
    """Share of the systematic residual's variance that is of these periods, by a fit of sines and cosines of both."""
    (s, c), (sr, cr) = sin_cos(of_pitch), sin_cos(of_roll)
    residual = _means(m, figure)
    columns = np.column_stack([a * b for a in (s, c) for b in (sr, cr)] if of_roll.size > 1 else [s, c])
    left = residual - columns @ np.linalg.lstsq(columns, residual, rcond=None)[0]
    return 1.0 - float(np.sum(left**2) / np.sum(residual**2))


def _rms(values: FloatArray, rows: NDArray[np.bool_]) -> float:
    return float(np.sqrt(np.mean(values[rows] ** 2)))
