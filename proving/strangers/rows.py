"""A stranger's table as other methods get it: our catalogue's columns beside the declared model, and the variables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rig.fitter.split_plot import SplitPlotDesign
from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.linear import orthonormal
from rig.fitter.split_plot import SplitPlotDesign
from rig.procedures.attitude.effects import CATALOGUE
from rig.procedures.attitude.table import attitude_data
from rig.procedures.attitude.trace.make_problem import make_problem as problem_of_attitude
from rig.procedures.general.column_roles import Roles, read_roles
from rig.procedures.general.trace.run import problem_of
from rig.procedures.pressure.effects import PRESSURE_CATALOGUE
from rig.procedures.pressure.fit import named_formula
from rig.procedures.pressure.table import whole_plot_data
from rig.procedures.pressure.trace.problem import pose as pose_pressure
from rig.procedures.pressure.trace.run import scene_of
from proving.strangers.sets import Made
from proving.strangers.traced import options_of, with_file
from rig.tables import FileSource

ALIKE = 0.995
"""Correlation from which on two columns are one: the name of either is the name of both."""
FOLDS = 5


@dataclass(frozen=True, eq=False)
class Rows:
    """A table for methods that choose columns. Sensors stand below one another, each in units of its residual's rms.

    Attributes:
        y: (N,) response beside the declared model.
        columns: (N, J) of the catalogue, the same beside it, of unit rms; no two alike.
        names: (J,) of each: those of all columns that are like it.
        fold: (N,) what is left out together in cross-validation.
        parts: rows of each sensor, and (n,) variables by name.

    """

    y: FloatArray
    columns: FloatArray
    names: tuple[frozenset[str], ...]
    fold: IntArray
    parts: tuple[tuple[slice, Mapping[str, FloatArray]], ...]


def rows_of(kind: str, made: Made) -> Rows:
    """A table of a set, ready for the peers. Raises what reading and posing it do."""
    of = {"attitude": _attitude, "whole_plots": _whole_plots, "general": _general}[kind]
    return with_file(made, lambda path: of(path, made))


def _attitude(path: Path, made: Made) -> Rows:
    """Each replication with parameters of its own, as the set declares it."""
    data = attitude_data(FileSource(path).table)
    problem = problem_of_attitude(data, CATALOGUE)
    columns = problem.columns_at("replications", range(len(problem.candidates)))
    outputs = problem.outputs_at("replications")
    a, r = np.radians(data.pitch_deg), np.radians(data.roll_deg)
    gravity = (np.sin(a), -np.sin(r) * np.cos(a), -np.cos(r) * np.cos(a))
    variables: dict[str, FloatArray] = {
        "pitch": data.pitch_deg,
        "roll": data.roll_deg,
        "time": data.elapsed_s,
        "order": np.asarray(data.order, np.float64),
        "move": _step(data.pitch_deg),
    }
    if data.sensor_temperature_degC is not None:
        variables["temperature"] = data.sensor_temperature_degC
    along = {name: gravity["xyz".index(name[0])] if name[0] in "xyz" else gravity[0] for name in problem.sensors}
    of_each = [{**variables, "gravity": along[name]} for name in problem.sensors]
    fold = np.unique(data.replicate, return_inverse=True)[1]
    return _stacked(outputs, columns, [c.effect.name for c in problem.candidates], fold, of_each)


def _whole_plots(path: Path, made: Made) -> Rows:
    """Rows whitened by the whole-plot error that restricted likelihood finds beside the declared model."""
    data = whole_plot_data(FileSource(path).table)
    names, declared = named_formula("full").columns(data.table)
    problem = pose_pressure(data, names, declared, scene_of(data), PRESSURE_CATALOGUE)
    kept = [j for j, c in enumerate(problem.candidates) if c.effect.stratum != "noise"]
    outputs, columns = [], []
    ratio = SplitPlotDesign(declared, data.whole_plot, names).fit_many(problem.outputs.T).ratio
    for i in range(len(problem.sensors)):
        block = np.column_stack([problem.outputs[i], problem.raw[i][:, kept]])
        left = _whitened(block, declared, data.whole_plot_index, float(ratio[i]))
        outputs.append(left[:, 0])
        columns.append(left[:, 1:])
    begun = np.array([data.elapsed_s[data.whole_plot_index == w].min() for w in range(data.whole_plot_index.max() + 1)])
    variables = {
        "pressure": data.pressure_psia,
        "sensor_temperature": data.sensor_temperature_degC,
        "sse_temperature": data.sse_temperature_degC,
        "time": data.elapsed_s,
        "order": np.asarray(data.order, np.float64),
        "time_in_plot": data.elapsed_s - begun[data.whole_plot_index],
        "move": _step(data.pressure_psia),
    }
    fold = data.whole_plot_index % FOLDS
    names_of = [problem.candidates[j].effect.name for j in kept]
    return _stacked(np.stack(outputs), np.stack(columns), names_of, fold, [variables] * len(outputs))


def _general(path: Path, made: Made) -> Rows:
    """A whole plot's or a replication's error whitened where it is declared."""
    given = options_of(list(made.options))
    group = tuple(name for text in given.get("group", ()) for name in text.split(","))
    plots = tuple(given["whole_plot"].split(",")) if "whole_plot" in given else ()
    single = {name: given[name] for name in ("replicate", "time", "direction", "wrap") if name in given}
    roles = Roles(given["response"], given["formula"], group=group, whole_plot=plots, **single)
    _, data, _ = read_roles(FileSource(path).read, roles)
    problem = problem_of(data)
    names = [c.effect.name for c in problem.candidates for _ in range(c.term.columns.shape[1])]
    block = np.column_stack([data.y, problem.columns])
    if data.shared is None:
        basis = orthonormal(data.columns)
        left = block - basis @ (basis.T @ block)
    else:
        fitted = SplitPlotDesign(data.columns, data.shared, data.names).fit_many(data.y[:, None])
        left = _whitened(block, data.columns, data.shared, float(fitted.ratio[0]))
    variables = {n: np.asarray(v, np.float64) for n, v in {**data.scene.settings, **data.scene.covariates}.items()}
    if data.scene.time is not None:
        variables[data.scene.time.name] = data.scene.time.values
    variables |= {name: np.asarray(one.index, np.float64) for name, one in data.scene.groups.items()}
    if data.scene.direction is not None:
        variables["direction"] = np.asarray(data.scene.direction[1], np.float64)
    variables["order"] = np.arange(len(data.y), dtype=np.float64)
    n = len(data.y)
    fold = np.random.default_rng(n).permutation(n) % FOLDS if data.shared is None else data.shared % FOLDS
    return _stacked(left[:, 0][None], left[:, 1:][None], names, fold, [variables])


def _step(values: FloatArray) -> FloatArray:
    """(n,) change from the row before; zero at the first."""
    return np.diff(values, prepend=values[:1])


def _whitened(block: FloatArray, declared: FloatArray, groups: IntArray, ratio: float) -> FloatArray:
    """(n, q) columns beside the declared model, where groups of rows share an error: `ratio` times a row's."""
    count = np.bincount(groups)[groups].astype(np.float64)
    part = 1.0 - 1.0 / np.sqrt(1.0 + count * max(ratio, 0.0))

    def white(columns: FloatArray) -> FloatArray:
        means = np.stack([np.bincount(groups, c) for c in columns.T], axis=1) / np.bincount(groups)[:, None]
        return np.asarray(columns - part[:, None] * means[groups])

    basis, both = orthonormal(white(declared)), white(block)
    return np.asarray(both - basis @ (basis.T @ both))


def _stacked(
    outputs: FloatArray,
    columns: FloatArray,
    names: Sequence[str],
    fold: IntArray,
    variables: Sequence[Mapping[str, FloatArray]],
) -> Rows:
    """Sensors (S, n) and columns (S, n, J) below one another, without columns that are nothing or alike."""
    sensors, n, count = columns.shape
    sd = np.sqrt(np.mean(outputs**2, axis=1))
    sd = np.where(sd > 0, sd, 1.0)
    flat = (columns / sd[:, None, None]).reshape(sensors * n, count)
    rms = np.sqrt(np.mean(flat**2, axis=0))
    useful = np.flatnonzero(np.isfinite(rms) & (rms > 1e-9 * np.max(rms[np.isfinite(rms)], initial=0.0)))
    x = flat[:, useful] / rms[useful]
    near = np.abs(x.T @ x) / len(x) >= ALIKE
    taken = np.zeros(len(useful), bool)
    kept, classes = [], []
    for j in range(len(useful)):
        if not taken[j]:
            mine = np.flatnonzero(near[j] & ~taken)
            taken[mine] = True
            kept.append(j)
            classes.append(frozenset(names[useful[i]] for i in mine))
    parts = tuple((slice(i * n, (i + 1) * n), variables[i]) for i in range(sensors))
    y = (outputs / sd[:, None]).ravel()
    return Rows(y, x[:, kept], tuple(classes), np.tile(fold, sensors).astype(np.int64), parts)
