"""Attitude calibrations of any length with the memory of one block: rows are added, a triangle of five columns is kept.

Memory grows with the number of sensors, not of rows; the result is that of all rows at once, except for rounding. Table
2 is not included: the separation of scatter from lack of fit needs the readings of each point together.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fitter import LinearFit, Triangle
from fitter.checked import finite
from fitter.errors import FitError
from procedures.attitude.model import (
    COLUMNS,
    COLUMNS_NO_ROLL,
    LEAST,
    AttitudeParameters,
    NoRollParameters,
    attitude_columns,
    attitude_parameters,
    no_roll_parameters,
    nominal_axis,
)

Block = tuple[ArrayLike, ArrayLike, Mapping[str, ArrayLike]]
"""(m,) pitch and (m,) roll in degrees, and (m,) volts by output; m may differ from block to block."""

_ROWS = 8192
"""Number of rows processed together, for any size of blocks: they fit a processor's cache."""


@dataclass(frozen=True, eq=False)
class StreamFit:
    """One sensor, calibrated without stored rows.

    Attributes:
        sensor: name of the output.
        linear: least squares of `procedures.attitude.model.COLUMNS`, or `COLUMNS_NO_ROLL`, in volts.
        parameters: the paper's parameters of it.
    """

    sensor: str
    linear: LinearFit
    parameters: AttitudeParameters | NoRollParameters


def fit_stream(
    blocks: Iterable[Block], *, roll: bool = True, axes: Mapping[str, str] | None = None
) -> dict[str, StreamFit]:
    """Calibrate every output: eqs. (2), (4), (5) of NASA/TP-1999-209835, or eq. (1) without roll.

        fit_stream(((pitch, roll, {"x_V": volts}) for pitch, roll, volts in reader))

    Args:
        blocks: rows in blocks; read once.
        roll: whether the calibration has roll.
        axes: "x", "y" or "z" by output, if the first letter of a name does not give it.

    Raises:
        fitter.linear.RankError: the rows do not determine the model.
        FitError: there are no rows, a value is not finite, or a block has other outputs or other lengths.
    """
    names: tuple[str, ...] | None = None
    triangle = Triangle(COLUMNS if roll else COLUMNS_NO_ROLL)
    for pitch_deg, roll_deg, outputs in blocks:
        names = tuple(outputs) if names is None else names
        if set(outputs) != set(names):
            raise FitError(f"a block has {', '.join(outputs)} where the first had {', '.join(names)}")
        count = np.size(pitch_deg)
        pitch, rolled = finite("pitch_deg", pitch_deg, count), finite("roll_deg", roll_deg, count)
        volts = np.column_stack([finite(name, outputs[name], count) for name in names])
        for start in range(0, count, _ROWS):
            rows = slice(start, start + _ROWS)
            triangle = triangle.add(attitude_columns(pitch[rows], rolled[rows], roll=roll), volts[rows])
    if names is None or not triangle.n:
        raise FitError("there are no observations")
    return {name: _fitted(name, triangle.of(i).solve(LEAST), axes, roll=roll) for i, name in enumerate(names)}


def _fitted(sensor: str, linear: LinearFit, axes: Mapping[str, str] | None, *, roll: bool) -> StreamFit:
    c, covariance = linear.coefficients, linear.covariance
    if not roll:
        return StreamFit(sensor, linear, no_roll_parameters(c, covariance))
    return StreamFit(sensor, linear, attitude_parameters(nominal_axis(sensor, c, axes), c, covariance))
