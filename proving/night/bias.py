"""Whether nights full of trouble still give unbiased calibrations: coefficients fitted, less the world's own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import hypot

import numpy as np

from fitter.arrays import FloatArray
from fitter.split_plot import SplitPlotDesign
from proving.night.play import Played
from proving.night.scenario import LOAD_CELL_V, LOAD_CELL_V_PER_KN
from rig.tables import run_table
from sims.physics.pressure_truth import TransducerTruth
from sims.physics.truth import SensorTruth


def deviations(played: Played) -> Iterator[tuple[str, float, float]]:
    """(quantity, coefficient less the truth over its standard error, degrees of freedom) of a complete night.

    Attitude: offset and sensitivity of every sensor, by least squares of a single sphere of gravity; pressure:
    offset and sensitivity, whole plots with an error of their own; load cell: offset and sensitivity.
    """
    assert played.path is not None
    table = run_table(played.path)
    if played.scenario.lab == "attitude":
        yield from _attitude(played, table.columns)
    elif played.scenario.lab == "load-cell":
        yield from _load_cell(table.columns)
    else:
        yield from _pressure(played, table.columns)


def _attitude(played: Played, columns: Mapping[str, FloatArray]) -> Iterator[tuple[str, float, float]]:
    pitch, roll = np.radians(columns["pitch_deg"]), np.radians(columns["roll_deg"])
    x = np.column_stack(
        [np.ones_like(pitch), np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)]
    )
    truth = played.bench.sim.plant.truth.sensors
    replicates = np.asarray(columns["replicate"])
    for name in played.plan.bench.sensors:
        y, true = columns[f"{name}_V"], truth[name]
        assert isinstance(true, SensorTruth)
        b, *_ = np.linalg.lstsq(x, y, rcond=None)
        left, df = y - x @ b, len(y) - 4
        if df < 3 or len(np.unique(replicates)) < 2:
            return
        cov = np.linalg.inv(x.T @ x) * (left @ left) / df
        yield f"{name} offset", float((b[0] - true.offset_V) / np.sqrt(cov[0, 0])), df
        size = hypot(*b[1:])
        towards = b[1:] / size
        error = float(np.sqrt(towards @ cov[1:, 1:] @ towards))
        yield f"{name} sensitivity", float((size - true.sensitivity_V_per_g) / error), df


def _load_cell(columns: Mapping[str, FloatArray]) -> Iterator[tuple[str, float, float]]:
    force, y = columns["force_kN"], columns["cell_V"]
    x = np.column_stack([np.ones_like(force), force])
    b, *_ = np.linalg.lstsq(x, y, rcond=None)
    left, df = y - x @ b, len(y) - 2
    if df < 3:
        return
    cov = np.linalg.inv(x.T @ x) * (left @ left) / df
    for i, (what, true) in enumerate((("offset", LOAD_CELL_V), ("sensitivity", LOAD_CELL_V_PER_KN))):
        yield f"cell {what}", float((b[i] - true) / np.sqrt(cov[i, i])), df


def _pressure(played: Played, columns: Mapping[str, FloatArray]) -> Iterator[tuple[str, float, float]]:
    x = np.column_stack([np.ones_like(columns["pressure_psia"]), columns["pressure_psia"]])
    truth = played.bench.sim.plant.truth.sensors
    design = SplitPlotDesign(x, columns["whole_plot"], ("1", "P"))
    for name in played.plan.bench.sensors:
        fit = design.fit(columns[f"{name}_mV"])
        true = truth[name]
        assert isinstance(true, TransducerTruth)
        errors = fit.coefficients - np.array([true.offset_mV, true.sensitivity_mV_per_psi])
        for what, error, stderr, df in zip(("offset", "sensitivity"), errors, fit.stderr, fit.df, strict=True):
            yield f"{name} {what}", float(error / stderr), float(df)
