"""How often expanded uncertainties hold in laboratories with an effect that nobody declared.

Results are compared with what the world truly gives at rest (proving/truth/stands.py, attitude_hidden.py,
whole_plot_hidden.py). `traced` are those of `rig certificate --traced`; `declared` those of the declared model, with a
line for the effects found. A statement of conformity is right where the true value is inside its tolerance.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from itertools import pairwise
from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from proving.frame import Figures, Part, Results, Study, pooled
from proving.ledger import Result
from proving.truth.attitude import D1, simulate, volts
from proving.truth.attitude_hidden import HIDDEN, sized
from proving.truth.stands import EFFECTS, METERS, USUAL_degC, stand
from proving.truth.whole_plot_hidden import hide
from rig.fitter.arrays import FloatArray
from rig.fitter.budget import Budgeted, budgets
from rig.fitter.decision import SimpleAcceptance, Tolerance, decide
from rig.procedures.attitude.budget import AttitudeEvaluation
from rig.procedures.attitude.budget_traced import TracedEvaluation as TracedAttitude
from rig.procedures.column_names import moves_of, spelled, stem_of, unit_of
from rig.procedures.errors import DataError
from rig.procedures.evaluate.budgeting import Evaluation
from rig.procedures.evaluate.influences import explain, influences
from rig.procedures.evaluate.stated import Statements
from rig.procedures.general.for_budgets import general_evaluation
from rig.procedures.pressure.budget import PressureEvaluation
from rig.procedures.pressure.budget_traced import TracedEvaluation
from rig.procedures.pressure.trace import trace_whole_plots
from rig.procedures.tables.table import Table
from rig.verbs.budget.evaluation import RunBudget
from rig.verbs.budget.undeclared import with_undeclared

FORCES = np.array([0.0, 2.0, 5.0, 10.0])
BINS = (0.0, 0.05, 0.2, 0.5, 0.8, 0.95, 1.0)
"""Ends of the bins of stated probabilities of conformity."""
OF_RESPONSE = ("cubic", "bend, sensor", "stop is near")
OF_TIME = ("drift of whole plots", "drift within", "gain drifts", "unrecorded step")
IN_WHOLE_PLOTS = (*OF_RESPONSE, *OF_TIME, "hysteresis", "creep", "carry-over")
OF_ATTITUDE = ("pads", "square", "cube", "offset drift", "sensitivity drift", "backlash, pitch", "hysteresis, pitch")
GRID = D1(90.0, 7, 9, replications=4)
ANGLES = np.array([[0.0, 0.0], [30.0, 90.0], [-60.0, -45.0]])
_WIDE = 4.0


def general() -> Study:
    """Load cells, with each effect of proving/truth/stands.py at 1 to 10 sd rms."""
    return Study({name: partial(_general, name=name) for name in EFFECTS}, shares, pooled(shares))


def others() -> Study:
    """Meters of no example (proving/truth/stands.py), with the same effects."""
    cases = {f"{meter}, {name}": partial(_general, name=name, meter=meter) for meter in METERS for name in EFFECTS}
    return Study(cases, shares, pooled(shares))


def _general(seed: int, name: str, meter: str = "") -> Result:
    rng = np.random.default_rng([410, seed, list(EFFECTS).index(name), *([list(METERS).index(meter)] if meter else [])])
    other = METERS[meter] if meter else None
    one = stand(name, FORCES, rng, float(10.0 ** rng.uniform(0.0, 1.0)), other)
    night = one.night
    quantity, put = (other.quantity, other.set_to) if other else ("force_kN", np.array)
    columns = {
        "replicate": night.replicate,
        "elapsed_s": night.time,
        quantity: put(night.force),
        f"{stem_of(quantity)}_side": night.side,
        **dict(zip(moves_of(quantity), (night.since, put(night.before)), strict=True)),
        "room_degC": night.room,
        "cell_V": one.volts,
    }
    declared = {"formula": other.declared if other else "1 + force_kN"}
    told: dict[str, Any] = {"declared": declared, "kind": "general", "outputs": {"cell_V": "cell"}}
    table = Table("a stand", columns, simulated=True, provenance={}, factors=(quantity,), **told)
    at = [{quantity: value, "room_degC": USUAL_degC} for value in put(FORCES).tolist()]

    def evaluate(*, traced: bool) -> Evaluation:
        return general_evaluation(table, at, traced=traced)

    first = f"room {USUAL_degC:g} degC, " if declared["formula"].startswith("1 + I((room_degC") else ""
    words = f"output at {first}{stem_of(quantity)} {{:g}} {spelled(unit_of(quantity))}"
    true = {f" {words.format(value)}": rest for value, rest in zip(put(FORCES).tolist(), one.at_rest, strict=True)}
    return held(evaluate, true, rng)


def whole_plots() -> Study:
    """Pressure transducers in whole plots, with effects of proving/truth/whole_plot_hidden.py at 2 to 8 errors."""
    return Study({name: partial(_whole_plot, name=name) for name in IN_WHOLE_PLOTS}, shares, pooled(shares))


def _whole_plot(seed: int, name: str) -> Result:
    rng = np.random.default_rng([411, seed, IN_WHOLE_PLOTS.index(name)])
    size = float(rng.uniform(2.0, 8.0))
    hidden = hide([name], [size], int(rng.integers(1 << 31)), transducers=2)
    data, (sensor, *_) = hidden.data, hidden.data.outputs
    added = size * hidden.columns[0][sensor]
    at_rest = hidden.truth[sensor] - (0.0 if name in OF_RESPONSE else added)
    rows = np.array([int(np.argmin(np.abs(data.pressure_psia - p))) for p in (0.5, 2.5, 5.0)])
    conditions = (data.pressure_psia, data.sensor_temperature_degC, data.sse_temperature_degC)
    points = [
        (float(p), float(sensor_degC), float(sse_degC)) for p, sensor_degC, sse_degC in np.transpose(conditions)[rows]
    ]
    true = {}
    for row, point in zip(rows.tolist(), points, strict=True):
        # an effect of time is in its mean over the run; each whole plot has the same pressures
        alike = np.abs(data.pressure_psia - point[0]) < 0.02
        mean = float(added[alike].mean()) if name in OF_TIME else 0.0
        where = "at {:g} psia, sensor {:g} degC, SSE {:g} degC".format(*point)
        true[f"{sensor.removesuffix('_mV')} output {where}"] = float(at_rest[row]) + mean
    trace = trace_whole_plots(data, hidden.model, validate=False)

    def evaluate(*, traced: bool) -> Evaluation:
        if traced:
            return TracedEvaluation(data, hidden.model, points, trace)
        return PressureEvaluation(data, hidden.model, points)

    return held(evaluate, true, rng)


def attitude() -> Study:
    """Packages of three sensors, with effects of proving/truth/attitude_hidden.py at 1 to 5 sd rms."""
    return Study({name: partial(_attitude, name=name) for name in OF_ATTITUDE}, shares, pooled(shares))


def _attitude(seed: int, name: str) -> Result:
    rng = np.random.default_rng([412, seed, OF_ATTITUDE.index(name)])
    bench = sized(name, float(rng.uniform(1.0, 5.0)), GRID)
    data, _ = simulate(bench, GRID, int(rng.integers(1 << 31)), **HIDDEN[name].options)
    exact = volts(bench, ANGLES[:, 0], ANGLES[:, 1])
    true = {
        f"{sensor} output at pitch {pitch:g} deg, roll {roll:g} deg": float(exact[i, j])
        for i, (pitch, roll) in enumerate(ANGLES.tolist())
        for j, sensor in enumerate(("x_V", "y_V", "z_V"))
    }
    at = [(pitch, roll) for pitch, roll in ANGLES.tolist()]

    def evaluate(*, traced: bool) -> Evaluation:
        made = TracedAttitude if traced else AttitudeEvaluation
        return made(data, at, temperature=False, gravity=None)

    return held(evaluate, true, rng)


def held(evaluate: Callable[..., Evaluation], true: Mapping[str, float], rng: np.random.Generator) -> Result:
    """Of each result with a true value: error over expanded uncertainty, traced and declared; and statements.

    Args:
        evaluate: an evaluation, by the name of its model.
        true: value by a part of the result's name.
        rng: draws tolerances.
    """
    declared, traced = (_budget(evaluate(traced=one)) for one in (False, True))
    runs = {"traced": traced}
    with suppress(DataError):  # a certificate refuses it, and says that --traced states it
        runs["declared"] = with_undeclared(declared, traced, {"": ("found",)}, shapes=False)
    found: dict[str, Any] = {"declared": [], "declared, stated": []}
    for word, run in runs.items():
        pairs = [(one, value) for one in run.budgets for part, value in true.items() if _is(one.name, part)]
        found[word] = [(one.value - value) / one.expanded_uncertainty for one, value in pairs]
        found[f"{word}, stated"] = [_stated(one, value, rng) for one, value in pairs]
    return found


def _is(name: str, part: str) -> bool:
    """Whether a result is meant: a model with more terms names its points with more quantities."""
    return part in f"{name}," and (f"{part}," in f"{name},")


def _budget(evaluation: Evaluation) -> RunBudget:
    """Budgets without any register: all that is uncertain is what the run shows."""
    explain(evaluation, Statements())
    results = evaluation.results
    type_a = (results.type_a, *influences(evaluation, Statements(), same_meter=False).grouped)
    made = budgets(results.names, results.units, results.values, type_a, ())
    run = SimpleNamespace(table=Table("a study", {}, simulated=True, provenance={}))
    return RunBudget(cast("Any", run), evaluation, made, results.sensors, type_a, (), ())


def _stated(one: Budgeted, true: float, rng: np.random.Generator) -> tuple[float, bool]:
    """Stated probability that a value is below a limit drawn anywhere near, and whether the true one is."""
    limit = true + rng.uniform(-_WIDE, _WIDE) * one.standard_uncertainty
    interval = Tolerance(-np.inf, limit)
    u, U = one.standard_uncertainty, one.expanded_uncertainty
    told = decide(one.value, u, interval, SimpleAcceptance(), expanded_uncertainty=U, df=one.df)
    return told.conformity_probability, bool(true <= limit)


def shares(results: Results) -> Figures:
    """In percent: expanded uncertainties that hold; and shares of statements that are true, by stated probability."""
    found: Figures = {}
    for word in ("traced", "declared"):
        errors = np.abs([one for result in results for one in result[word]])
        if not len(errors):
            continue
        found[word] = {"held": 100.0 * float(np.mean(errors <= 1.0)), "of": len(errors)}
        found[word]["greatest error / U"] = float(np.max(errors))
        said: FloatArray = np.array([one for result in results for one in result[f"{word}, stated"]], np.float64)
        for low, high in pairwise(BINS):
            here = said[(said[:, 0] >= low) & (said[:, 0] < high if high < 1.0 else said[:, 0] <= 1.0)]
            if len(here):
                found[word][f"conform at {low:g} to {high:g}"] = [float(x) for x in here.mean(axis=0)] + [len(here)]
    return {**found, "laboratories": len(results)}


PARTS = {
    "general": Part(general, 150),
    "others": Part(others, 15),
    "whole-plots": Part(whole_plots, 200),
    "attitude": Part(attitude, 100),
}
"""`python -m proving coverage-effects general`; proving/notes/coverage_effects.md."""
