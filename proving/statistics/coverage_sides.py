"""How often expanded uncertainties hold for readings of either direction, where a sensor has a loop.

The truth is proving/truth/loops.py. Nothing is stated by a register, so all uncertainty is what the run shows.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from proving.frame import Figures, Part, Results, Study
from proving.ledger import Result
from proving.truth.loops import pitch_run, transducer_output, whole_plots
from rig.fitter.budget import Budgeted, budgets
from rig.procedures.attitude.budget import AttitudeEvaluation
from rig.procedures.attitude.infer import infer_attitude
from rig.procedures.evaluate.budgeting import Evaluation
from rig.procedures.pressure.budget import PressureEvaluation

PRESSURES = ((1.5, 20.0, 20.0), (2.5, 20.0, 20.0), (3.5, 60.0, 60.0))
LOOP_mV, LOOP_V = 0.02, 2e-4
"""Widest place of the loop of a transducer, and that of an attitude sensor: five and ten errors of a reading."""
PITCH, ROLL = 30.0, 45.0


def either_side() -> Study:
    """Transducers in 18 whole plots, and packages of two sensors over pitch."""
    return Study({kind: partial(laboratory, kind=kind) for kind in ("pressure", "attitude")}, shares)


def laboratory(seed: int, kind: str) -> Result:
    """Whether outputs and inferred values of both sides are within U; scatter over that of readings without a loop."""
    return _pressure(seed) if kind == "pressure" else _attitude(seed)


def _pressure(seed: int) -> Result:
    rng = np.random.default_rng([413, seed])
    found, without = (PressureEvaluation(whole_plots(seed, one), "full", PRESSURES) for one in (LOOP_mV, 0.0))
    by_name, held = _budgets(found), _nothing()
    of_output, of_pressure = _of("output", by_name), _of("inferred", by_name)
    for i, (P, sensor, sse) in enumerate(PRESSURES):
        true, half = float(transducer_output(np.array(P), sensor, sse)), LOOP_mV / 2.0 * P * (5.0 - P) * 4.0 / 25.0
        for reading in (true + half, true - half):
            held["output"].append(bool(abs(of_output[i].value - reading) <= of_output[i].expanded_uncertainty))
            noise = 0.01 * rng.normal() + 0.004 * rng.normal()
            inferred = found.inferred("a_mV", np.full(len(PRESSURES), reading + noise))[i]
            held["inferred"].append(bool(abs(inferred - P) <= of_pressure[i].expanded_uncertainty))
    return {**held, "scatter": _scatter(found, without)}


def _attitude(seed: int) -> Result:
    rng = np.random.default_rng([414, seed])
    found, without = (
        AttitudeEvaluation(pitch_run(seed, one), [(PITCH, ROLL)], temperature=False, gravity=None)
        for one in (LOOP_V, 0.0)
    )
    by_name, held = _budgets(found), _nothing()
    of_x, of_pitch = _of("output", by_name)[0], _of("inferred", by_name)[0]
    x = 0.01 + 2.0 * np.sin(np.radians(PITCH))
    z = 0.02 + 1.9 * np.cos(np.radians(PITCH)) * np.cos(np.radians(ROLL))
    for reading in (x + LOOP_V / 2.0, x - LOOP_V / 2.0):
        held["output"].append(bool(abs(of_x.value - reading) <= of_x.expanded_uncertainty))
        read = np.array([[reading, z]]) + 2e-5 * rng.normal(size=2)
        answer = infer_attitude(found.calibration, read, near_deg=(np.array([PITCH]), np.array([ROLL])))
        held["inferred"].append(bool(abs(float(answer.pitch_deg[0]) - PITCH) <= of_pitch.expanded_uncertainty))
    return {**held, "scatter": _scatter(found, without)}


def _nothing() -> dict[str, list[bool]]:
    return {"output": [], "inferred": []}


def _budgets(found: Evaluation) -> list[Budgeted]:
    results = found.results
    type_a = (results.type_a, *found.reversibility())
    return list(budgets(results.names, results.units, results.values, type_a, ()))


def _of(sort: str, every: list[Budgeted]) -> list[Budgeted]:
    return [one for one in every if f" {sort} " in f" {one.name}"]


def _scatter(found: Evaluation, without: Evaluation) -> float:
    """Mean ratio of the standard deviations of the coefficients and outputs by scatter alone."""
    return float(np.mean(np.sqrt(found.results.of_fit / without.results.of_fit)))


def shares(results: Results) -> Figures:
    """In percent: readings within U; mean of the scatter over that without a loop."""
    held = {sort: 100.0 * float(np.mean([one[sort] for one in results])) for sort in ("output", "inferred")}
    wider = float(np.mean([one["scatter"] for one in results]))
    return {**held, "scatter over that without a loop": wider, "laboratories": len(results)}


PARTS = {"either-side": Part(either_side, 500)}
"""`python -m proving coverage-sides either-side`; proving/notes/budgets.md."""
