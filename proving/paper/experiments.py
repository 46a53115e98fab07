"""Figures 22 to 54 from the simulated nights: residuals and errors of inferred angles, with 95 % intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from proving.paper.angles import Package
from proving.paper.plots import PITCH, ROLL, Figure, Line, Panel
from proving.paper.table_2 import SCALE, UNDER, Measured
from rig.fitter.arrays import FloatArray, IntArray
from rig.procedures.attitude.data import AttitudeData

_MARKS = "osD^v<"
_RESIDUAL, _PITCH_ERROR, _ROLL_ERROR = (f"{what} / 1e-4 deg" for what in ("residual", "pitch error", "roll error"))
_FINE = 181
_ONE = "for replication 1, a curve for each"


@dataclass(frozen=True)
class _View:
    """What one of the paper's figures shows.

    Attributes:
        number: of the figure.
        caption: what it shows.
        rows: of Table 2, or of `UNDER`; one panel each, or together where angles are inferred from all of them.
        what: "output", "pitch" or "roll": whose error.
        over: "pitch" or "roll", the abscissa.
        one: draw replication 1 alone, as curves.
        bound: of the ordinate, 1e-4 deg; None for what the errors need.

    """

    number: str
    caption: str
    rows: tuple[str, ...]
    what: str = "output"
    over: str = "pitch"
    one: bool = False
    bound: float | None = None


_90, _180, _TUMBLE = (("44(a)", "44(b)", "44(c)"), ("47(a)", "47(b)", "47(c)"), ("50 x", "50 y", "50 z"))
_VIEWS = (
    _View("22", "pitch sensor without roll, +-36 deg", ("22",)),
    _View("23", "inferred pitch, without roll, +-36 deg", ("22",), "pitch"),
    _View("24", "pitch sensor without roll, +-180 deg", ("24",)),
    _View("25", "inferred pitch, without roll, +-180 deg", ("24",), "pitch", bound=15.0),
    _View("26", "pitch sensor without roll, four-point tumble", ("26",)),
    _View("27", "inferred pitch, four-point tumble", ("26",), "pitch", bound=15.0),
    _View("28", "sensor 1 with roll, +-30 deg, (a) without and (b) with temperature correction", ("28(a)", "28(b)")),
    _View("29", "inferred pitch of sensor 1, +-30 deg", ("28(b)",), "pitch"),
    _View("30", f"inferred pitch of sensor 1, +-30 deg, {_ONE} roll", ("28(b)",), "pitch", one=True),
    _View("31", "sensor 1, +-30 deg, over roll", ("28(b)",), over="roll"),
    _View("32", "inferred pitch of sensor 1, +-30 deg, over roll", ("28(b)",), "pitch", "roll"),
    _View("33", f"inferred pitch of sensor 1, +-30 deg, {_ONE} pitch", ("28(b)",), "pitch", "roll", one=True),
    _View("34", "sensor 2 with roll, +-30 deg", ("34",)),
    _View("35", "sensor 1, 53-point fraction over +-30 deg", ("35",)),
    _View("36", "sensor 1, all points under the fraction's coefficients", ("36",)),
    _View("37", "sensor 1 with roll, +-180 deg, four replications", ("37",)),
    _View("38", "inferred pitch of sensor 1, +-180 deg", ("37",), "pitch", bound=25.0),
    _View("39", f"sensor 1, +-180 deg, {_ONE} roll", ("37",), one=True),
    _View("40", "sensor 1, +-180 deg, over roll", ("37",), over="roll"),
    _View("41", f"sensor 1, +-180 deg, {_ONE} pitch", ("37",), over="roll", one=True),
    _View("42", "sensor 2 with roll, +-180 deg", ("42",)),
    _View("43", "inferred pitch of sensor 2, +-180 deg", ("42",), "pitch", bound=80.0),
    _View("44", "three sensors with roll, +-90 deg", _90),
    _View("45", f"pitch inferred from three sensors, +-90 deg, {_ONE} roll", _90, "pitch", one=True),
    _View("46", f"roll inferred from three sensors, +-90 deg, {_ONE} roll", _90, "roll", one=True, bound=40.0),
    _View("47", "three sensors with roll, +-180 deg", _180),
    _View("48", f"pitch inferred from three sensors, +-180 deg, {_ONE} roll", _180, "pitch", one=True),
    _View("49", f"roll inferred from three sensors, +-180 deg, {_ONE} roll", _180, "roll", one=True, bound=40.0),
    _View("50", "three sensors, six-point tumble", _TUMBLE),
    _View("51", "pitch inferred from three sensors, six-point tumble", _TUMBLE, "pitch"),
    _View("51", "roll inferred from three sensors, six-point tumble", _TUMBLE, "roll"),
    _View("52", "three sensors, all points under the tumble's coefficients", ("52 x", "52 y", "52 z")),
    _View("53", "x sensor, 73-point fraction", ("53 x",)),
    _View("54", "x sensor, all points under the fraction's coefficients", ("54 x",)),
)


def figures_22_to_54(measured: Measured) -> tuple[Figure, ...]:
    """As plots, those that the nights there are allow; the two views of figure 51 beside one another."""
    known = set(measured.figures())
    drawn: dict[str, Figure] = {}
    for view in _VIEWS:
        if not {row for name in view.rows for row in UNDER.get(name, (name,))} <= known:
            continue
        panels = _output_panels(measured, view) if view.what == "output" else (_angle_panel(measured, view),)
        before = drawn.get(view.number)
        both = panels if before is None else (*before.panels, *panels)
        drawn[view.number] = Figure(view.number, view.caption if before is None else before.caption, both, True)
    return tuple(drawn.values())


def _output_panels(measured: Measured, view: _View) -> tuple[Panel, ...]:
    panels = []
    for name in view.rows:
        data_of, fit_of = UNDER.get(name, (name, name))
        data, fit = measured.data(data_of), measured.fit(fit_of)
        columns = fit.columns(*_everywhere(data, view.over))
        halves = [
            np.degrees(half / fit.parameters.S_V)
            for half in (fit.linear.confidence(columns), fit.linear.prediction(columns))
        ]
        residual = measured.residual_deg(data_of, fit_of)
        panels.append(_panel(view, name if len(view.rows) > 1 else "", data, residual, halves, _RESIDUAL))
    return tuple(panels)


def _angle_panel(measured: Measured, view: _View) -> Panel:
    package = Package.of(measured, *view.rows)
    of_roll = view.what == "roll"
    halves = package.half_widths(*_everywhere(package.data, view.over), of_roll=of_roll)
    error = package.errors()[1 if of_roll else 0]
    return _panel(view, "", package.data, error, halves, _ROLL_ERROR if of_roll else _PITCH_ERROR)


def _everywhere(data: AttitudeData, over: str) -> tuple[FloatArray, FloatArray]:
    """(m,) pitch and (m,) roll: the abscissa finely, at every angle of the other kind that was visited."""
    x, other = (data.pitch_deg, data.roll_deg) if over == "pitch" else (data.roll_deg, data.pitch_deg)
    fine = np.linspace(x.min(), x.max(), _FINE)
    grids = np.meshgrid(fine, np.unique(np.round(other, 1)), indexing="ij")
    fine_all, other_all = (np.ravel(each) for each in grids)
    return (fine_all, other_all) if over == "pitch" else (other_all, fine_all)


def _panel(
    view: _View,
    title: str,
    data: AttitudeData,
    error_deg: FloatArray,
    halves_deg: Sequence[FloatArray],
    label: str,
) -> Panel:
    """Errors at the observations, intervals as `_everywhere` has their attitudes."""
    x, other = (data.pitch_deg, data.roll_deg) if view.over == "pitch" else (data.roll_deg, data.pitch_deg)
    x, other, y = np.round(x, 1), np.round(other, 1), SCALE * error_deg
    fine = np.linspace(x.min(), x.max(), _FINE)
    widest = [SCALE * half.reshape(_FINE, -1).max(axis=1) for half in halves_deg]
    if view.one:
        shown = (data.replicate_index == 0) & (other >= -0.01)
        lines = _curves(x[shown], y[shown], other[shown], "roll" if view.over == "pitch" else "pitch")
        y = y[shown]
    else:
        lines = _marks(x, y, data.replicate)
    for half, style, name in zip(widest, (":", "-."), ("calibration", "prediction"), strict=True):
        lines.append(Line(fine, half, f"95 % {name} interval", style, "0.25"))
        lines.append(Line(fine, -half, "", style, "0.25"))
    bound = view.bound
    if bound is None:
        bound = 1.15 * float(max(np.nanpercentile(np.abs(y), 99.8), np.nanmedian(widest[1])))
    return Panel(title, PITCH if view.over == "pitch" else ROLL, label, tuple(lines), (-bound, bound))


def _marks(x: FloatArray, y: FloatArray, replicate: IntArray) -> list[Line]:
    return [
        Line(x[rows], y[rows], f"replication {r}", _MARKS[i % len(_MARKS)], faint=True)
        for i, r in enumerate(np.unique(replicate))
        for rows in [replicate == r]
    ]


def _curves(x: FloatArray, y: FloatArray, by: FloatArray, name: str) -> list[Line]:
    lines = []
    for value in np.unique(by):
        rows = np.flatnonzero(by == value)
        rows = rows[np.argsort(x[rows], kind="stable")]
        lines.append(Line(x[rows], y[rows], f"{name} {value:g}", "-"))
    return lines
