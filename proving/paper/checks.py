"""What sections 9 and 10 say of experiments 22 to 54, checked on the simulated ones: the pattern, not the digits."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from proving.paper import printed
from proving.paper.angles import Package
from proving.paper.printed import Row
from proving.paper.statement import Statement, above, below, between, short
from proving.paper.table_2 import SCALE, UNDER, Measured
from rig.fitter.arrays import FloatArray
from rig.procedures.attitude.angles import sin_cos

Judge = Callable[..., Statement]
"""`above`, `below` or `between`."""
_FULL = ("28(b)", "37", "44(a)", "44(b)", "44(c)", "47(a)", "47(b)", "47(c)")
_PADS = ("28(b)", "35", "37", "44(a)", "44(b)", "47(a)", "47(b)", "47(c)", "53 x", "53 y", "53 z")


def checks(measured: Measured) -> tuple[Statement, ...]:
    """Every check that the nights there are allow."""
    known = set(measured.figures())
    groups: tuple[tuple[str, Callable[[Measured], Iterator[Statement]]], ...] = (
        ("22 24 26", _without_roll),
        ("28(a) 28(b) 34 35", _within_30),
        ("37 42", _all_round),
        ("44(a) 44(b) 44(c)", _three_axes_90),
        ("47(a) 47(b) 47(c)", _three_axes_180),
        ("47(a) 47(b) 47(c)", _smaller_designs),
    )
    return tuple(check for needed, group in groups if set(needed.split()) <= known for check in group(measured))


def ranges(measured: Measured) -> tuple[Statement, ...]:
    """Sizes of Table 2 that the simulated sensors were made to have."""
    known = measured.figures()
    sigmas = (
        _as_printed(measured, f, "sigma_E / 1e-4 deg", _of(f, "sigma_E"), between, (2.0, 6.0))
        for f in _FULL
        if f in known
    )
    tests = (_as_printed(measured, f, "T_bias", _of(f, "T_bias"), between, (10.0, 115.0)) for f in _PADS if f in known)
    return (*sigmas, *tests)


def _without_roll(m: Measured) -> Iterator[Statement]:
    yield _not_significant(m, "22", "T_bias", "+-36 deg does not show the pads")
    yield _significant(m, "24", "T_bias", "+-180 deg does")
    yield _as_printed(
        m, "24", "sigma_E over sigma_E of figure 22", lambda r: r["24"].sigma_E / r["22"].sigma_E, above, 1.3
    )
    pitch, _ = _angles(m, "24")
    yield above("24", "two periods of pitch in 360 deg: share of the systematic residual", _share(m, "24", pitch), 0.8)
    for figure in ("24", "26"):
        for test in ("T_b", "T_S"):
            yield _not_significant(m, figure, test, "no drift of the sensor")
    yield _significant(m, "26", "T_bias", "the four-point tumble shows a bias")
    yield _wider(m, "26", "24", 2)
    rms = SCALE * float(np.sqrt(np.nanmean(Package.of(m, "22").errors()[0] ** 2)))
    says = "rms of inferred angles near sigma_E: ratio"
    yield between(
        "23", says, rms / m.rows["22"].sigma_E, (0.9, 1.25), printed=f"{1.74 / printed.ROWS['22'].sigma_E:.2f}"
    )
    package = Package.of(m, "24")
    error = np.abs(package.errors()[0])[np.abs(np.abs(pitch) - 90.0) < 0.1]
    outside = float(np.mean(~(error < 1e-3)))
    yield above("25", "most inferred angles at +-90 deg are outside the chart (1e-3 deg): share", outside, 0.5)
    level, steep = package.half_widths(np.array([0.0, 89.0]), np.zeros(2), of_roll=False)[1]
    yield above("25", "intervals become unbounded there: width at 89 deg over width at 0", float(steep / level), 20)


def _within_30(m: Measured) -> Iterator[Statement]:
    a, b = "28(a)", "28(b)"
    both = "28(a), (b)"
    yield _as_printed(
        m,
        both,
        "temperature correction halves sigma_E: ratio",
        lambda r: r[a].sigma_E / r[b].sigma_E,
        between,
        (1.5, 2.7),
    )
    yield _as_printed(m, a, "very significant sensitivity drift before it: T_S", _of(a, "T_S"), above, 100)
    yield _as_printed(m, a, "... less significant offset drift: T_S / T_b", lambda r: r[a].T_S / r[a].T_b, above, 2)
    yield _as_printed(m, a, "T_bias only minimally significant", _of(a, "T_bias"), below, 3)
    yield _as_printed(m, b, "drift greatly reduced: T_S after / before", lambda r: r[b].T_S / r[a].T_S, below, 0.05)
    yield _as_printed(m, b, "T_bias after / before", lambda r: r[b].T_bias / r[a].T_bias, above, 5)
    residual, (pitch, roll) = _systematic(m, b), _angles(m, b)
    steep, middle = (_rms(residual, rows) for rows in (np.abs(pitch) > 29.0, np.abs(pitch) < 6.0))
    yield above("30", "greatest dispersion at +-30 deg of pitch, least near 0: ratio", steep / middle, 2)
    tilt = np.abs(roll)
    side, level = (_rms(residual, rows) for rows in (np.abs(tilt - 90) < 1, np.abs(tilt - 90) > 89))
    says = "least dispersion near +-90 deg of roll, greatest near 0 and 180: ratio"
    yield below("31, 32", says, side / level, 0.5)
    yield from _sensor_2(m, "34")
    yield _fraction(m, "35", b)
    yield _wider(m, "35", b, 1.5)
    yield _under(m, "36")


def _all_round(m: Measured) -> Iterator[Statement]:
    yield _significant(m, "37", "T_bias", "sensor 1 over +-180 deg")
    share = _share(m, "37", *_angles(m, "37"))
    yield above("39, 41", "two periods of pitch and one of roll: share of the systematic residual", share, 0.7)
    yield from _sensor_2(m, "42")


def _three_axes_90(m: Measured) -> Iterator[Statement]:
    for figure in ("44(a)", "44(b)", "44(c)"):
        yield _significant(m, figure, "T_bias", "each of the three sensors")
        yield _significant(m, figure, "T_b", "offset drift of each")
    yield _significant(m, "44(a)", "T_S", "sensitivity drift of x")
    yield _not_significant(m, "44(b)", "T_S", "sensitivity drift of y")
    yield _significant(m, "44(c)", "T_S", "sensitivity drift of z")
    package, at = Package.of(m, "44(a)", "44(b)", "44(c)"), np.linspace(-80, 80, 33)
    of_roll, of_pitch = (package.half_widths(at, np.zeros(33), of_roll=which)[1] for which in (True, False))
    says = "prediction intervals are significantly greater of roll than of pitch: ratio of means within +-80 deg"
    yield above("45, 46", says, float(np.mean(of_roll) / np.mean(of_pitch)), 1.5)


def _three_axes_180(m: Measured) -> Iterator[Statement]:
    share = _share(m, "47(a)", *_angles(m, "47(a)"))
    yield above("47(a)", "two periods of pitch (and one of roll) of x: share of the systematic residual", share, 0.6)
    for figure in ("47(a)", "47(b)", "47(c)"):
        yield _significant(m, figure, "T_bias", "each of the three sensors")
    for figure in ("47(a)", "47(c)"):
        for test in ("T_b", "T_S"):
            yield _significant(m, figure, test, "drift of x and z")


def _smaller_designs(m: Measured) -> Iterator[Statement]:
    for figure in ("50 x", "50 y"):
        yield _significant(m, figure, "T_bias", "six-point tumble, x and y")
        yield _not_significant(m, figure, "T_b", "... no drift detected")
        yield _not_significant(m, figure, "T_S", "... no drift detected")
    for axis in "xyz":
        yield from _tumble(m, f"52 {axis}")
    for axis in "xyz":
        yield _fraction(m, f"53 {axis}", UNDER[f"54 {axis}"][0])
    x, full = "53 x", "47(a)"
    yield _wider(m, x, full, 1.5)
    yield _as_printed(
        m, x, "offset drift is no longer detected: T_b over T_b of 47(a)", lambda r: r[x].T_b / r[full].T_b, below, 0.5
    )
    yield _as_printed(
        m,
        x,
        "sensitivity drift much less significant: T_S over T_S of 47(a)",
        lambda r: r[x].T_S / r[full].T_S,
        below,
        0.5,
    )
    for axis in "xyz":
        yield _under(m, f"54 {axis}")


def _sensor_2(m: Measured, figure: str) -> Iterator[Statement]:
    yield _not_significant(m, figure, "T_bias", "sensor 2")
    says = "strong drift of sensor 2: the smaller of T_b and T_S"
    yield _as_printed(m, figure, says, lambda r: min(r[figure].T_b, r[figure].T_S), above, 100)


def _tumble(m: Measured, figure: str) -> Iterator[Statement]:
    full, small = UNDER[figure]
    ratio = m.residual_sd(full, small) / m.rows[small].sigma_E
    was = printed.RESIDUAL_SD[figure] / printed.ROWS[small].sigma_E
    yield above(figure, "sd of the full data's residuals over the tumble's sigma_E", ratio, 1.2, printed=f"{was:.1f}")
    data, fit = m.data(full), m.fit(small)
    half = np.degrees(fit.linear.prediction(fit.columns(data.pitch_deg, data.roll_deg)) / fit.parameters.S_V)
    covered = float(np.mean(np.abs(m.residual_deg(full, small)) < half))
    yield below(figure, "its 95 % prediction interval covers too few of them", 100 * covered, 95, "%")
    yield _wider(m, small, full, 2)


def _fraction(m: Measured, small: str, full: str) -> Statement:
    says = f"sigma_E near its value in {full}: ratio"
    return _as_printed(m, small, says, lambda r: r[small].sigma_E / r[full].sigma_E, between, (0.8, 1.25))


def _wider(m: Measured, small: str, full: str, limit: float) -> Statement:
    ratio = _calibration(m, small) / _calibration(m, full)
    return above(small, f"calibration interval wider than in {full}: ratio", ratio, limit, printed="larger")


def _under(m: Measured, figure: str) -> Statement:
    full, small = UNDER[figure]
    worse = 100 * (m.residual_sd(full, small) / m.rows[full].sigma_E - 1.0)
    was = 100 * (printed.RESIDUAL_SD[figure] / printed.ROWS[full].sigma_E - 1.0)
    says = f"residuals of {full} under coefficients of {small}: sd larger by"
    return below(figure, says, worse, 3, "%", printed=f"{was:.1f} %")


def _as_printed(
    m: Measured, where: str, says: str, of: Callable[[Mapping[str, Row]], float], judge: Judge, limit: object
) -> Statement:
    """Something of Table 2, of the simulated rows and of the printed ones."""
    return judge(where, says, of(m.rows), limit, printed=short(of(printed.ROWS)))


def _of(figure: str, name: str) -> Callable[[Mapping[str, Row]], float]:
    return lambda rows: float(getattr(rows[figure], name))


def _significant(m: Measured, figure: str, test: str, says: str) -> Statement:
    return _as_printed(m, figure, f"{test} significant: {says}", _of(figure, test), above, _limit(m, figure, test))


def _not_significant(m: Measured, figure: str, test: str, says: str) -> Statement:
    return _as_printed(m, figure, f"{test} not significant: {says}", _of(figure, test), below, _limit(m, figure, test))


def _limit(m: Measured, figure: str, test: str) -> float:
    row = m.rows[figure]
    return round(row.F_bias if test == "T_bias" else row.F_bS, 2)


def _calibration(m: Measured, figure: str) -> float:
    """Half-width of the calibration interval at level attitude, 1e-4 deg."""
    fit = m.fit(figure)
    half = fit.linear.confidence(fit.columns(np.zeros(1), np.zeros(1)))
    return SCALE * float(np.degrees(half[0] / fit.parameters.S_V))


def _angles(m: Measured, figure: str) -> tuple[FloatArray, FloatArray]:
    data = m.data(figure)
    return data.pitch_deg, data.roll_deg


def _systematic(m: Measured, figure: str) -> FloatArray:
    """(n,) mean residual over the replications of each row's point, deg."""
    point, residual = m.data(figure).point, m.residual_deg(figure)
    return np.asarray((np.bincount(point, residual) / np.bincount(point))[point])


def _share(m: Measured, figure: str, pitch_deg: FloatArray, roll_deg: FloatArray | None = None) -> float:
    """Share of the systematic residual's variance with two periods of pitch (and one of roll) in 360 deg."""
    waves = list(sin_cos(2.0 * pitch_deg))
    if roll_deg is not None:
        waves = [a * b for a in waves for b in sin_cos(roll_deg)]
    residual, columns = _systematic(m, figure), np.column_stack(waves)
    left = residual - columns @ np.linalg.lstsq(columns, residual, rcond=None)[0]
    return 1.0 - float(np.sum(left**2) / np.sum(residual**2))


def _rms(values: FloatArray, rows: NDArray[np.bool_]) -> float:
    return float(np.sqrt(np.mean(values[rows] ** 2)))
