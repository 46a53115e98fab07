"""Fractions of a measured run: loss of precision with fewer points, in JSON and in words.

The paper's fractions are a coarser grid with decimated interior rows and columns (NASA/TP-1999-209835, eq. 109,
sections 9.2.2 and 9.3.4): 13 x 25 points become 5 x 13 and, by 2 and 2, 53; 37 x 13 become 13 x 7 and 73.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.fitter.json_values import if_finite
from rig.procedures.attitude.data import SAME_ANGLE_DEG, AttitudeData
from rig.procedures.attitude.designs import Design, fraction, grid, tumble
from rig.procedures.attitude.fitted import with_temperature
from rig.procedures.attitude.fraction_advice import advised, sentence, settings
from rig.procedures.attitude.fractions import FAMILY, TUMBLE, Cell, MeasuredGrid, PartFit, fit_part
from rig.procedures.attitude.model import sigma_deg
from rig.procedures.attitude.table import attitude_data
from rig.procedures.attitude.table import unused as unused_columns
from rig.procedures.errors import DataError
from rig.procedures.evaluate.results import PlainFitted
from rig.procedures.present.blocks import Block
from rig.procedures.tables.table import Table

_DESIGN_T = ("T", "T6", "T4")

_FEWEST_ROWS, _FEWEST_COLUMNS = 5, 7
"""The coarsest of the paper's grids: 5 x 13 and 13 x 7. Coarser ones do not show a pattern with two periods
of pitch.
"""
_DECIMATIONS = ((1, 1), *((a, r) for a in (2, 3, 4) for r in (2, 3, 4)))
_OF_THE_PAPER, _OF_FIGURE_21 = (2, 2), (3, 4)
_THINNER = 1.3
"""Minimum ratio of numbers of points of successive listed fractions."""


@dataclass(frozen=True)
class Part:
    """Points of a measured grid.

    Attributes:
        name: "13 x 7 (2, 2)": the coarser grid's rows and columns, and K_a and K_R of eq. (109).
        design: the angles, as in a procedure.
        cells: (row, column) of each in the measured grid.
        every: K_a and K_R.
        points: number of visits in one replication.
    """

    name: str
    design: Design
    cells: tuple[Cell, ...]
    every: tuple[int, int]
    points: int

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the coarser grid."""
        return len(self.design.pitch_deg), len(self.design.roll_deg)


def compare_fractions(table: Table, which: str, *, temperature: bool | None = None) -> dict[str, Any]:
    """Fit fractions of a full pitch-roll run and compare each with the whole; returns JSON values.

    Args:
        table: of kind pitch-roll.
        which: "fraction" for a family of them, a number for the one with about that number of points, "tumble" for the
            six (four without roll) points of design T.
        temperature: whether offset and sensitivity depend on the sensor temperature in the declared model; None for the
            setting of the table's procedure.

    Raises:
        DataError: the data are not a full grid, it is too small, its angles do not contain the tumble, or `which` is
            invalid.
    """
    data, warm = attitude_data(table), with_temperature(table, temperature)
    try:
        measured = MeasuredGrid.of(data)
        parts = _parts(measured, which, roll=data.has_roll)
        whole = {sensor: fit_part(data, sensor, temperature=warm) for sensor in data.sensors}
        judged = [_judged(data, part, measured, whole, temperature=warm) for part in parts]
    except FitError as error:
        raise DataError(f"{table.source}: {error}") from error
    rows, columns = measured.visits.shape
    hours = float(np.ptp(data.elapsed_s)) / 3600.0
    full = {
        "name": f"{rows} x {columns}",
        "points": measured.points,
        "observations": len(data),
        "hours": hours,
        "missing": measured.missing,
        "sensors": {sensor: _sensor(part, part) for sensor, part in whole.items()},
    }
    fractions = [entry | {"hours": hours * entry["share"]} for entry in judged]
    chosen, why = _chosen(full, fractions, which)
    return {
        "data": {"points": len(table), "kind": "pitch-roll", "simulated": table.simulated, **table.provenance},
        "temperature": warm,
        "full": full,
        "fractions": fractions,
        "advice": {
            "name": chosen["name"],
            "why": why,
            "sentence": sentence(full, chosen),
            "procedure": settings(chosen),
        },
        "unused": unused_columns(table).to_json(),
    }


def _parts(measured: MeasuredGrid, which: str, *, roll: bool) -> Sequence[Part]:
    if which.upper() in _DESIGN_T or which == TUMBLE:
        return [tumble_of(measured, roll=roll)]
    if which == FAMILY:
        return family(measured)
    if not which.isdecimal() or not int(which):
        raise DataError(f"--points is a number of points, {FAMILY} or {TUMBLE}, not {which!r}")
    if int(which) >= measured.points:
        raise DataError(f"--points {which}: the run itself has {measured.points}; name fewer")
    return [nearest(measured, int(which))]


def _chosen(
    full: Mapping[str, Any], fractions: Sequence[Mapping[str, Any]], which: str
) -> tuple[Mapping[str, Any], str]:
    if which == FAMILY:
        return advised(full, fractions)
    if not which.isdecimal():
        return fractions[0], "was measured on the way"
    least = fractions[0]["points"] > int(which)
    return fractions[0], f"is the fraction nearest to {which} points" + (
        f"; {fractions[0]['points']} is the least that keeps both edges of this grid" if least else ""
    )


def family(measured: MeasuredGrid) -> list[Part]:
    """From most to fewest points: coarser grids decimated by 2 and 2, and the whole grid by 3 and 4 as in figure 21.

    Raises:
        FitError: the grid is too small for a fraction.
    """
    every = _candidates(measured)
    paper = [
        part
        for part in every
        if part.every == _OF_THE_PAPER or (part.every == _OF_FIGURE_21 and part.shape == measured.visits.shape)
    ]
    found: list[Part] = []
    for part in sorted(paper or every, key=lambda part: (-part.points, -part.shape[0])):
        if (found[-1].points if found else measured.points) >= _THINNER * part.points:
            found.append(part)
    return found or every[:1]


def nearest(measured: MeasuredGrid, points: int) -> Part:
    """The fraction with about this number of points; among equals one decimated by 2 and 2, then the one with the
    finest pitch.

    Raises:
        FitError: the grid is too small for a fraction.
    """
    return min(
        _candidates(measured),
        key=lambda part: (abs(part.points - points), part.every != _OF_THE_PAPER, -part.shape[0]),
    )


def tumble_of(measured: MeasuredGrid, *, roll: bool) -> Part:
    """Design T6, or T4 without roll, if its angles were measured.

    Raises:
        FitError: angles are missing; the message names them.
    """
    design = tumble(roll=roll)
    rows = {angle: _index(measured.pitch_deg, angle) for angle in design.pitch_deg}
    columns = {angle: _index(measured.roll_deg, angle) if roll else 0 for angle in design.roll_deg}
    missing = [f"pitch {angle:g}" for angle, at in rows.items() if at is None]
    missing += [f"roll {angle:g}" for angle, at in columns.items() if at is None]
    if missing:
        raise FitError(f"a tumble needs angles that were not visited: {', '.join(missing)} deg")
    found = ((rows[pitch], columns[angle]) for pitch, angle in design.points_deg())
    cells = tuple((row, column) for row, column in found if row is not None and column is not None)
    return Part(design.name, design, cells, (1, 1), measured.points_of(cells))


def _candidates(measured: MeasuredGrid) -> list[Part]:
    """Every coarser grid with both its ends, complete and decimated."""
    n, m = measured.visits.shape
    found = [
        part
        for by_row in _steps(n, _FEWEST_ROWS)
        for by_column in _steps(m, _FEWEST_COLUMNS)
        for part in _decimated(measured, by_row, by_column)
        if part.points < measured.points
    ]
    if not found:
        raise FitError(
            f"{n} pitch by {m} roll angles are too few for a fraction: it keeps both ends, every row or column that it "
            f"keeps is evenly spaced, and it has at least {_FEWEST_ROWS} by {_FEWEST_COLUMNS}"
        )
    return found


def _steps(lines: int, fewest: int) -> Iterator[int]:
    """Possible steps between kept lines that keep both ends, and enough lines."""
    for every in range(1, max(lines, 2)):
        if (lines - 1) % every == 0 and (lines - 1) // every + 1 >= min(fewest, lines):
            yield every


def _decimated(measured: MeasuredGrid, by_row: int, by_column: int) -> Iterator[Part]:
    pitch, roll = measured.pitch_deg[::by_row].tolist(), measured.roll_deg[::by_column].tolist()
    coarse = grid("D", pitch, roll)
    for every in _DECIMATIONS:
        if (len(pitch) - 1) % every[0] or (len(roll) - 1) % every[1]:
            continue
        design = fraction(coarse, pitch_every=every[0], roll_every=every[1])
        if every != (1, 1) and len(design) == len(coarse):
            continue
        cells = tuple((by_row * i, by_column * j) for i, j in design.cells)
        name = f"{len(pitch)} x {len(roll)}" + (f" ({every[0]}, {every[1]})" if every != (1, 1) else "")
        yield Part(name, design, cells, every, measured.points_of(cells))


def _index(angles_deg: FloatArray, wanted_deg: float) -> int | None:
    """Index of the angle; +180 and -180 deg are one, and the named one is preferred."""
    away = np.abs(np.mod(angles_deg - wanted_deg + 180.0, 360.0) - 180.0)
    alike = np.flatnonzero(away <= SAME_ANGLE_DEG)
    return int(alike[np.argmin(np.abs(angles_deg[alike] - wanted_deg))]) if alike.size else None


def _judged(
    data: AttitudeData, part: Part, measured: MeasuredGrid, whole: Mapping[str, PartFit], *, temperature: bool
) -> dict[str, Any]:
    rows = measured.rows_of(part.cells)
    fits = {sensor: fit_part(data, sensor, rows, temperature=temperature) for sensor in whole}
    observations = int(np.count_nonzero(rows))
    return {
        "name": part.name,
        "points": part.points,
        "observations": observations,
        "share": observations / len(data),
        "pitch_deg": list(part.design.pitch_deg),
        "roll_deg": list(part.design.roll_deg),
        "K_alpha": part.every[0],
        "K_R": part.every[1],
        "sensors": {sensor: _sensor(fit, whole[sensor]) for sensor, fit in fits.items()},
    }


def _sensor(part: PartFit, whole: PartFit) -> dict[str, Any]:
    """Table 2 and the parameters of a part, and its errors for the whole; degrees by the whole run's sensitivity."""
    S_V = whole.fit.parameters.S_V
    shift = part.shift(whole.fit)
    return {
        **part.fit.to_dict(),
        "interval95_deg": if_finite(sigma_deg(part.interval95_V, S_V)),
        "interval_ratio": if_finite(part.interval95_V / whole.interval95_V) if whole.interval95_V > 0 else None,
        "residual_deg": if_finite(sigma_deg(part.residual_V, S_V)),
        "coverage95": if_finite(part.coverage95),
        "shift": {name: if_finite(value) for name, value in zip(part.fit.linear.names, shift, strict=True)},
    }


@dataclass(frozen=True)
class FractionsCompared(PlainFitted):
    """A run and its fractions as JSON values."""

    table: Table
    which: str

    def blocks(self) -> Iterator[Block]:
        """Blocks for people."""
        from rig.procedures.attitude.fractions_shown import show_fractions  # noqa: PLC0415 - which needs this module

        return show_fractions(PurePath(self.table.source).name, self.table, self.result, self.which)
