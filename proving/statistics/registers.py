"""How often expanded uncertainties of budgets hold, in laboratories whose instruments err as their certificates say.

The truth is proving/truth/laboratories.py: each laboratory draws its instruments' errors once and calibrates with them.
A seed is a number of laboratories.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from proving.frame import Figures, Part, Results, Study
from proving.ledger import Result
from proving.truth import laboratories as truth
from proving.truth import pressure as bridge
from rig.fitter.arrays import FloatArray
from rig.fitter.budget import combine
from rig.fitter.budget.budget import DOMINATED
from rig.fitter.budget.coverage import EXCESS
from rig.procedures.attitude.budget import AttitudeEvaluation
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.infer import infer_attitude
from rig.procedures.attitude.results import STANDARD_GRAVITY
from rig.procedures.evaluate.budgeting import Evaluation
from rig.procedures.evaluate.influences import Found, explain, influences
from rig.procedures.evaluate.stated import Curve, PlaceConstant, Stated, Statements
from rig.procedures.general.budget import GeneralEvaluation
from rig.procedures.general.for_budgets import general_evaluation
from rig.procedures.pressure.budget import PressureEvaluation
from rig.procedures.tables.table import Table

PITCH, ROLL = (
    angle.ravel() for angle in np.meshgrid(np.linspace(-60, 60, 7), np.linspace(-180, 150, 12), indexing="ij")
)
USED_AT = np.array([[0.0, 0.0], [25.0, 40.0], [-45.0, 120.0]])
VOLTS = {"x_V": 1.0, "y_V": 1.0, "z_V": 1.0}
BRIDGE = replace(bridge.HOMOSCEDASTIC, wholeplot_mV=2e-3, subplot_mV=1e-3)
PRESSURES = [(0.5, -90.0, 0.0), (2.5, -110.0, 15.0), (4.5, -70.0, -20.0)]
FORCES = np.tile(np.linspace(0.0, 10.0, 9), 3)
USED_FORCES = np.array([1.0, 5.0, 9.0])
LIMITS: dict[str, Any] = {"reads": True, "distribution": "rectangular"}


def coverage(laboratories: int = 100) -> Study:
    """Every laboratory is drawn afresh: 2 x 7 x 12 angles; 20 whole plots; 9 weights three times, also with a
    voltmeter whose limits of error dominate.

    Coverage factors are those of certificates: by shape where one or two limits dominate, else Student's t.
    """
    limits = partial(force, half_V=6e-3)
    cases: dict[str, Any] = {"attitude": attitude, "pressure": pressure, "force": force, "limits": limits}
    return Study({name: partial(case, laboratories=laboratories) for name, case in cases.items()}, shares)


def always(value: float) -> Curve:
    """The same uncertainty everywhere."""
    return lambda x: np.full_like(x, value)


def share(value: float) -> Curve:
    """An uncertainty in proportion."""
    return lambda x: np.abs(x) * value


def expanded(evaluation: Evaluation, stated: Statements) -> tuple[dict[str, float], dict[str, float]]:
    """Expanded uncertainty of every result for 95 %, with another meter in use and with the same."""
    errors = stated.errors
    first = influences(evaluation, replace(stated, errors=[e for e in errors if not e.reads]), same_meter=False)
    meter = Statements([e for e in errors if e.reads])
    other, same = (influences(evaluation, meter, same_meter=one) for one in (False, True))
    return _combined(evaluation, first, other), _combined(evaluation, first, same)


def _combined(evaluation: Evaluation, *found: Found) -> dict[str, float]:
    results = evaluation.results
    m = len(results.names)
    single, grouped = ([one for part in found for one in getattr(part, name)] for name in ("influences", "grouped"))
    s = np.array([one.sensitivities for one in single]).reshape(-1, m).T
    parts = [(np.diag(one.covariance), np.broadcast_to(one.df, m)) for one in (results.type_a, *grouped)]
    total = combine(s, np.array([one.df for one in single]), parts)
    limited = [i for i, one in enumerate(single) if one.distribution == "rectangular"]
    largest = np.sort(np.square(s[:, limited]), axis=1)[:, -2:].sum(axis=1)
    dominated = (largest > 0.0) & (total.standard_uncertainty**2 - largest <= DOMINATED**2 * largest)
    excess = np.array([EXCESS[one.distribution] for one in single])
    shaped = combine(s, np.array([one.df for one in single]), parts, excess=excess)
    limits = np.where(dominated, shaped.expanded_uncertainty, total.expanded_uncertainty)
    return dict(zip(results.names, limits.tolist(), strict=True))


def attitude(seed: int, laboratories: int) -> Result:
    """Offsets, sensitivities, outputs, and angles by another meter and by the same."""
    says, rng = truth.AttitudeCertificates(), np.random.default_rng(50_000 + seed)
    stated = Statements(
        (
            Stated("pitch", "", {"pitch_deg": 1.0}, "turn", np.zeros_like, always(says.pitch_turn_deg)),
            Stated("roll", "", {"roll_deg": 1.0}, "turn", np.zeros_like, always(says.roll_turn_deg)),
            Stated("zero", "", {"pitch_deg": 1.0}, "offset", np.zeros_like, always(says.zero_deg)),
            Stated("gain", "", VOLTS, "gain", np.zeros_like, share(says.gain_V), reads=True),
            Stated("offset", "", VOLTS, "offset", np.zeros_like, always(says.offset_V), reads=True),
            Stated("drift", "", VOLTS, "gain", np.zeros_like, share(says.half_drift / 3**0.5), **LIMITS),
        ),
        {
            "gravity": PlaceConstant("gravity", says.local, says.gravity),
            "levelling": PlaceConstant("levelling", 0.0, says.tilt_deg),
        },
    )
    pitch, roll = np.tile(PITCH, 2), np.tile(ROLL, 2)
    n = len(pitch)
    replicate = np.repeat([1, 2], n // 2)
    held: dict[str, int] = {}
    for _ in range(laboratories):
        lab = truth.attitude(says, pitch, roll, USED_AT, rng)
        outputs = dict(zip(VOLTS, lab.outputs.T, strict=True))
        data = AttitudeData(replicate, np.arange(n), np.arange(float(n)), pitch, roll, None, outputs)
        evaluation = AttitudeEvaluation(data, USED_AT.tolist(), temperature=False, gravity=says.local)
        explain(evaluation, stated)
        calibration = evaluation.calibration
        value = dict(zip(evaluation.results.names, evaluation.results.values.tolist(), strict=True))
        U, U_same = expanded(evaluation, stated)
        for words, read, limits in (("another meter", lab.readings, U), ("the same meter", lab.same, U_same)):
            found = infer_attitude(calibration, read, near_deg=(USED_AT[:, 0], USED_AT[:, 1]))
            for i, (a, r) in enumerate(USED_AT.tolist()):
                where = f"at pitch {a:g} deg, roll {r:g} deg"
                errors = {"pitch": found.pitch_deg[i] - a, "roll": found.roll_deg[i] - r}
                for angle, error in errors.items():
                    _count(held, f"{angle} {where}, {words}", error, limits[f"inferred {angle} {where}"])
        S = np.linalg.norm(lab.m_V, axis=1)
        for j, name in enumerate(VOLTS):
            told = {
                f"{name} offset": lab.b_V[j],
                f"{name} sensitivity per local g": S[j],
                f"{name} sensitivity per standard gravity": S[j] * STANDARD_GRAVITY / lab.gravity,
                f"{name} mx": lab.m_V[j, 0],
            }
            for i, (a, r) in enumerate(USED_AT.tolist()):
                told[f"{name} output at pitch {a:g} deg, roll {r:g} deg"] = lab.exact[i, j]
            for what, true in told.items():
                _count(held, what, value[what] - true, U[what])
    return {"held": held, "of": laboratories}


def pressure(seed: int, laboratories: int) -> Result:
    """Outputs, and pressures by another meter and by the same."""
    says, rng = truth.PressureCertificates(), np.random.default_rng(60_000 + seed)
    mV = {"bridge_mV": 1e3}
    stated = Statements(
        (
            Stated("standard gain", "", {"pressure_psia": 1.0}, "gain", np.zeros_like, share(says.gain)),
            Stated("standard offset", "", {"pressure_psia": 1.0}, "offset", np.zeros_like, always(says.offset_psi)),
            Stated("thermometer", "", {"sensor_temperature_degC": 1.0}, "offset", np.zeros_like, always(says.sensor_K)),
            Stated("gain", "", mV, "gain", np.zeros_like, share(says.gain_V), reads=True),
            Stated("offset", "", mV, "offset", np.zeros_like, always(says.offset_mV / 1e3), reads=True),
        ),
        {"line_head": PlaceConstant("line_head", 0.0, says.height_m)},
    )
    P, sensor, sse = np.array(PRESSURES).T
    held: dict[str, int] = {}
    for number in range(laboratories):
        errors = truth.PressureErrors.drawn(says, rng)
        clean, _ = bridge.simulate(BRIDGE, seed * laboratories + number)
        scatter = clean.outputs["bridge_mV"] - BRIDGE.output_mV(
            clean.pressure_psia, clean.sensor_temperature_degC, clean.sse_temperature_degC
        )
        true_T = clean.sensor_temperature_degC - errors.sensor_K
        read = BRIDGE.output_mV(errors.true_pressure(clean.pressure_psia), true_T, clean.sse_temperature_degC) + scatter
        data = replace(clean, outputs={"bridge_mV": errors.read(read)})
        evaluation = PressureEvaluation(data, "full", PRESSURES)
        value = dict(zip(evaluation.results.names, evaluation.results.values.tolist(), strict=True))
        exact = BRIDGE.output_mV(P, sensor, sse)
        later = exact + rng.normal(0.0, BRIDGE.wholeplot_mV, len(P)) + rng.normal(0.0, BRIDGE.subplot_mV, len(P))
        U, U_same = expanded(evaluation, stated)
        for words, read, limits in (("another meter", later, U), ("the same meter", errors.read(later), U_same)):
            found = evaluation.inferred("bridge_mV", read)
            for i, point in enumerate(PRESSURES):
                where = "at {:g} psia, sensor {:g} degC, SSE {:g} degC".format(*point)
                _count(held, f"pressure {where}, {words}", found[i] - P[i], limits[f"bridge inferred pressure {where}"])
                if limits is U:
                    output = f"bridge output {where}"
                    _count(held, output, value[output] - exact[i], U[output])
    return {"held": held, "of": laboratories}


def force(seed: int, laboratories: int, half_V: float | None = None) -> Result:
    """Coefficients, outputs and forces of a load cell; the certificate of the voltmeter is from a small sample."""
    says = truth.ForceCertificates() if half_V is None else truth.ForceCertificates(half_V=half_V)
    rng = np.random.default_rng(70_000 + seed)
    held: dict[str, int] = {}
    for _ in range(laboratories):
        lab = truth.force(says, FORCES, USED_FORCES, rng)
        volts = {"cell_V": 1.0}
        stated = Statements(
            (
                Stated("weights", "", {"force_kN": 1.0}, "gain", np.zeros_like, share(says.gain)),
                Stated("weight", "", {"force_kN": 1.0}, "setting", np.zeros_like, always(says.own_kN)),
                Stated("gain", "", volts, "gain", np.zeros_like, share(lab.said), df=says.df, reads=True),
                Stated("offset", "", volts, "offset", np.zeros_like, always(says.half_V / 3**0.5), **LIMITS),
            )
        )
        evaluation = _load_cell(lab.outputs)
        explain(evaluation, stated)
        value = dict(zip(evaluation.results.names, evaluation.results.values.tolist(), strict=True))
        U, _ = expanded(evaluation, stated)
        found = evaluation.inferred("cell_V", lab.readings)
        told = {"cell coefficient 1": lab.start, "cell coefficient force_kN": lab.slope}
        for i, F in enumerate(USED_FORCES.tolist()):
            told[f"cell output at force {F:g} kN"] = lab.start + lab.slope * F
            _count(held, f"force at {F:g} kN", found[i] - F, U[f"cell inferred force at force {F:g} kN"])
        for what, true in told.items():
            _count(held, what, value[what] - true, U[what])
    return {"held": held, "of": laboratories}


def _load_cell(volts: FloatArray) -> GeneralEvaluation:
    columns = {"force_kN": FORCES, "cell_V": volts, "replicate": np.repeat([1.0, 2.0, 3.0], len(FORCES) // 3)}
    declared = {"formula": "1 + force_kN"}
    table = Table(
        "a stand",
        columns,
        True,
        {},
        declared=declared,
        kind="general",
        outputs={"cell_V": "cell"},
        factors=("force_kN",),
    )
    return general_evaluation(table, [{"force_kN": value} for value in USED_FORCES.tolist()])


def _count(held: dict[str, int], what: str, error: float, limit: float) -> None:
    held[what] = held.get(what, 0) + int(abs(error) <= limit)


def shares(results: Results) -> Figures:
    """In percent: expanded uncertainties that hold."""
    of = sum(one["of"] for one in results)
    found = dict(_percent(results, of))
    every = list(found.values())
    return {**found, "least": min(every), "greatest": max(every), "mean": float(np.mean(every)), "of": of}


def _percent(results: Results, of: int) -> Iterator[tuple[str, float]]:
    for what in results[0]["held"]:
        yield what, 100.0 * sum(one["held"][what] for one in results) / of


PARTS = {"coverage": Part(coverage, 50)}
