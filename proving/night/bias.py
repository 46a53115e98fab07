"""Whether nights full of trouble still give unbiased calibrations: coefficients fitted, less the world's own."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Mapping, Sequence
from itertools import repeat
from math import hypot

import numpy as np

from proving.night.judged import Night
from proving.night.play import Played
from rig.errors import RunFileError
from rig.fitter.arrays import FloatArray
from rig.fitter.split_plot import SplitPlotDesign
from rig.procedures.tables.table import Table
from rig.run_file.read.reader import RunReader
from rig.sims.physics.expression import Formula
from rig.sims.physics.laboratory_truth import AnySensorTruth
from rig.sims.physics.pressure_truth import TransducerTruth
from rig.sims.physics.truth import SensorTruth
from rig.sims.twin import Accurate
from rig.tables.table_of_run import run_table


def deviations(played: Played) -> Iterator[tuple[str, float, float]]:
    """(quantity, coefficient less the truth over its standard error, degrees of freedom) of a complete night.

    Attitude: offset and sensitivity of every sensor, by least squares of a single sphere of gravity; pressure:
    offset and sensitivity, whole plots with an error of their own; any other laboratory: offset and slope over every
    factor of what the outputs differ from their formulas in the world file at the true settings, which is nothing.
    """
    assert played.path is not None
    try:
        table = run_table(played.path)
    except RunFileError:  # a night in which every point was given up
        return
    if played.scenario.lab == "attitude":
        yield from _attitude(played, table.columns)
    elif played.scenario.lab == "pressure":
        yield from _pressure(played, table.columns)
    else:
        yield from _any(played, table)


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


def _any(played: Played, table: Table) -> Iterator[tuple[str, float, float]]:
    truth, bench, columns = played.bench.sim.plant.truth, played.plan.bench, table.columns
    factors = table.factors
    levels = [np.ptp(columns[name]) for name in factors]
    if not all(levels):  # so few points were measured
        return
    slopes = [columns[name] / span for name, span in zip(factors, levels, strict=True)]
    x = np.column_stack([np.ones(len(columns["order"])), *slopes])
    plots = columns.get("whole_plot", np.arange(len(x)))
    terms = ("1", *factors)
    if len(x) - len(terms) < _FEWEST or len(np.unique(plots)) <= len(terms):
        return
    moments = _moments(played, columns)
    for name, sensor in bench.sensors.items():
        true = truth.sensors[name]
        assert isinstance(true, AnySensorTruth)
        twin = played.bench.sim.twin(sensor.reader)
        if isinstance(twin, Accurate) and twin.accuracy(sensor.channel, "V").digit > true.noise:
            continue  # errors of its steps are no noise
        formula = Formula.parse(true.formula, name)
        drawn = dict.fromkeys(truth.draws, 0.0)  # errors of settings, which whole plots are for
        read = [{n: float(columns[n][row]) for n in factors if n in bench.references} for row in range(len(x))]
        truly = _there(played, moments, (sensor.reader, sensor.channel))
        rows = [{**one, **known, **drawn} for one, known in zip(truly, read, strict=True)]
        y = columns[f"{name}_{sensor.unit}"] - np.array([formula.value(row) for row in rows])
        if len(np.unique(plots)) < len(x):
            fit = SplitPlotDesign(x, plots, terms).fit(y)
            found = fit.coefficients, fit.stderr, fit.df
        else:
            b, *_ = np.linalg.lstsq(x, y, rcond=None)
            df = len(y) - x.shape[1]
            cov = np.linalg.inv(x.T @ x) * float((y - x @ b) @ (y - x @ b)) / df
            found = b, np.sqrt(np.diag(cov)), np.full(len(terms), float(df))
        for term, error, stderr, df in zip(terms, *found, strict=True):
            yield f"{name} {term}", float(error / stderr), float(df)


def _moments(played: Played, columns: Mapping[str, FloatArray]) -> list[tuple[float, float]]:
    """World times between which each row of a table was measured."""
    assert played.path is not None
    with RunReader.open(played.path) as reader:
        night = Night(played, reader.run_list(), list(reader.records()))
    made = {(one.run_index, one.whole_plot): night.measured_s(one) for one in night.records if one.accepted}
    plots = columns.get("whole_plot", repeat(None))
    return [made[int(index), plot] for index, plot in zip(columns["run_index"], plots, strict=False)]


def _there(
    played: Played, moments: Sequence[tuple[float, float]], wire: tuple[str, str]
) -> Iterator[Mapping[str, float]]:
    """True values of the factors while an input was read.

    A setting is not exact: it has arrived within a band, and what is left of its way is the same whenever it is made
    from the same side. A calibration of the settings has that error in it, and no standard error shows it. It is an
    error of the bench, which a night does to nobody.
    """
    read = [one for one in played.tape.readings if (one.instrument, one.channel) == wire]
    begins = [one.t_s for one in read]
    for began, ended in moments:
        seen = read[bisect_left(begins, began - 1e-5) : bisect_right(begins, ended)]
        yield {name: float(np.mean([one.factors[name] for one in seen])) for name in seen[0].factors}


_FEWEST = 3
"""Degrees of freedom of the error from which on a night's calibration is judged."""


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
