"""Simulated calibrations of curves, each equation written here again; no code is shared with what is judged."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rig.procedures.tables.table import Table

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Truth:
    """One kind of calibration.

    Attributes:
        curve: response for (n,) abscissas.
        x: (n,) settings.
        sigma: (n,) standard deviation of a reading at (n,) abscissas.
        sigma_x: standard deviation of a recorded abscissa.
        plots: number of whole plots, over which the settings are spread; 0 for independent rows.
        sigma_plot: standard deviation of the error common to a whole plot.
        x_name: column of the abscissa.
        y_name: column of the response.
    """

    curve: Callable[[FloatArray], FloatArray]
    x: FloatArray
    sigma: Callable[[FloatArray], FloatArray]
    sigma_x: float = 0.0
    plots: int = 0
    sigma_plot: float = 0.0
    x_name: str = "x"
    y_name: str = "y"


def _same(sigma: float) -> Callable[[FloatArray], FloatArray]:
    return lambda x: np.full(len(x), sigma)


def _platinum(t: FloatArray) -> FloatArray:
    """IEC 60751, by its two ranges."""
    above = 100.0 + 0.39083 * t - 5.775e-5 * t * t
    return np.where(t < 0.0, above - 4.183e-10 * (t - 100.0) * t * t * t, above)


def _water(t: FloatArray) -> FloatArray:
    """Antoine's equation in Pa."""
    return np.array([math.pow(10.0, 10.19621 - 1730.63 / (233.426 + each)) for each in t.tolist()])


def _thermistor(t: FloatArray) -> FloatArray:
    """Beta model of a 10 kohm thermistor, for a formula of one's own."""
    return np.asarray(1e4 * np.exp(3950.0 * (1.0 / (t + 273.15) - 1.0 / 298.15)))


TRUTHS = {
    "line": Truth(lambda x: 3.0 + 2.0 * x, np.linspace(0.0, 10.0, 8), _same(0.3)),
    "parabola": Truth(lambda x: 1.0 + 2.0 * x + 0.1 * x * x, np.linspace(0.0, 9.0, 10), _same(0.2)),
    "logarithm": Truth(lambda x: 1.0 + 4.0 * np.log(x), np.linspace(1.0, 9.0, 10), _same(0.1)),
    "exponential": Truth(lambda x: 0.5 + 4.0 * np.exp(-0.4 * x), np.linspace(0.0, 4.0, 12), _same(0.04)),
    "thermistor": Truth(_thermistor, np.linspace(0.0, 70.0, 9), _same(40.0)),
    "callendar-van-dusen": Truth(
        _platinum, np.repeat([-80.0, -40.0, 0.0, 60.0, 120.0, 200.0], 2), _same(2e-3), x_name="t_degC", y_name="R_ohm"
    ),
    "antoine, weights": Truth(
        _water, np.linspace(20.0, 100.0, 12), lambda x: 0.002 * _water(x), x_name="t_degC", y_name="p_Pa"
    ),
    "stated": Truth(lambda x: 3.0 + 2.0 * x, np.linspace(0.0, 10.0, 8), lambda x: 0.1 + 0.05 * x),
    "errors in both": Truth(lambda x: 3.0 + 2.0 * x + 0.05 * x * x, np.linspace(0.0, 10.0, 9), _same(0.2), 0.1),
    "whole plots": Truth(
        lambda x: 0.5 + 4.0 * np.exp(-0.4 * x),
        np.tile(np.linspace(0.0, 4.0, 5), 8),
        _same(0.02),
        plots=8,
        sigma_plot=0.03,
    ),
}


def calibration(name: str, rng: np.random.Generator) -> Table:
    """A table of one simulated calibration."""
    truth = TRUTHS[name]
    x = truth.x
    y = truth.curve(x) + rng.normal(size=len(x)) * truth.sigma(x)
    columns = {truth.x_name: x + rng.normal(size=len(x)) * truth.sigma_x, "u": truth.sigma(x)}
    columns["w"] = 1.0 / truth.curve(x) ** 2
    if truth.plots:
        plot = np.repeat(np.arange(truth.plots), len(x) // truth.plots)
        columns["plot"] = plot.astype(np.float64)
        y = y + rng.normal(size=truth.plots)[plot] * truth.sigma_plot
    return Table("simulated", {**columns, truth.y_name: y}, True, {})


def readings(name: str, count: int, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """(count,) abscissas inside the range, and one new reading at each."""
    truth = TRUTHS[name]
    low, high = float(truth.x.min()), float(truth.x.max())
    x = rng.uniform(low + 0.05 * (high - low), high - 0.05 * (high - low), count)
    noise = rng.normal(size=count) * truth.sigma(x) + rng.normal(size=count) * truth.sigma_plot
    return x, truth.curve(x) + noise
