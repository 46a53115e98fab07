"""Influences of stated errors on results: held against what physics says, and against a simulated bench.

The truth is proving/truth/attitude.py, written from rotations; nothing of it is shared with the influences.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from proving.truth.attitude import D1, Bench, Plan, volts, without_noise
from proving.truth.pressure import HOMOSCEDASTIC
from proving.truth.pressure import simulate as simulate_pressure
from rig.fitter.budget import Influence
from rig.procedures.attitude.budget import AttitudeEvaluation
from rig.procedures.evaluate.budgeting import Shift
from rig.procedures.evaluate.influences import Found, corrected, influences
from rig.procedures.evaluate.stated import PlaceConstant, Stated, Statements
from rig.procedures.general.for_budgets import general_evaluation
from rig.procedures.pressure.budget import PressureEvaluation
from rig.procedures.pressure.influences import line_head
from rig.procedures.tables.table import Table

BENCH, PLAN = Bench(), D1(60.0, 7, 9, replications=2)
AT = [(0.0, 0.0), (30.0, 40.0)]
VOLTS = {"x_V": 1.0, "y_V": 1.0, "z_V": 1.0}
LEVEL, AWAY = "at pitch 0 deg, roll 0 deg", "at pitch 30 deg, roll 40 deg"


def always(value):
    return lambda x: np.full_like(x, value)


def share(value):
    return lambda x: np.abs(x) * value


def stated(name, columns, behaves, standard, **more):
    return Stated(name, "a certificate", columns, behaves, np.zeros_like, standard, **more)


def attitude(bench: Bench = BENCH) -> AttitudeEvaluation:
    data, exact = without_noise(bench, PLAN)
    noise = np.random.default_rng(7).normal(size=exact.shape) * 1e-8
    outputs = dict(zip(VOLTS, (exact + noise).T, strict=True))
    return AttitudeEvaluation(replace(data, outputs=outputs), AT, temperature=False, gravity=9.8)


def found(evaluation, *errors, place=(), same_meter=False) -> Found:
    constants = {one.name: one for one in place}
    return influences(evaluation, Statements(errors, constants), same_meter=same_meter)


def by_result(evaluation, one: Influence) -> dict[str, float]:
    return dict(zip(evaluation.results.names, one.sensitivities.tolist(), strict=True))


def test_a_gain_of_the_voltmeter_moves_the_sensitivity_and_cancels_in_angles_of_the_same_voltmeter():
    evaluation, gain = attitude(), stated("gain", VOLTS, "gain", share(1e-5), reads=True)
    (other,), (same,) = (found(evaluation, gain, same_meter=same).influences for same in (False, True))
    for one in (other, same):
        moved = by_result(evaluation, one)
        assert moved["x_V sensitivity per local g"] == pytest.approx(1e-5 * 5.0, rel=1e-5)
        assert moved["z_V offset"] == pytest.approx(1e-5 * 0.001, rel=1e-2)
    angle = f"inferred pitch {AWAY}"
    assert by_result(evaluation, same)[angle] == pytest.approx(0.0, abs=1e-10)
    # gravity is one g: three outputs of a meter that reads too much do not fit it, so little of the gain is left
    assert abs(by_result(evaluation, other)[angle]) < np.degrees(1e-5)


def test_an_offset_of_the_voltmeter_is_an_offset_and_an_angle_of_arc_sine():
    evaluation, offset = attitude(), stated("offset", {"x_V": 1.0}, "offset", always(1e-4), reads=True)
    (one,) = found(evaluation, offset).influences
    moved = by_result(evaluation, one)
    assert moved["x_V offset"] == pytest.approx(1e-4, rel=1e-9)
    assert moved["y_V offset"] == 0.0
    assert moved[f"x_V output {AWAY}"] == pytest.approx(1e-4, rel=1e-6)
    # level, with x along gravity's cosine: -u / S
    assert moved[f"inferred pitch {LEVEL}"] == pytest.approx(-np.degrees(1e-4 / 5.0), rel=2e-3)


def test_a_tilt_of_the_base_is_a_bias_in_every_replication():
    """Without roll it is not seen in the residuals, and goes to inferred pitch as it is."""
    data, exact = without_noise(BENCH, Plan(np.linspace(-60, 60, 7), np.zeros(1), 3))
    noise = np.random.default_rng(8).normal(size=len(exact)) * 1e-8
    evaluation = AttitudeEvaluation(
        replace(data, outputs={"x_V": exact[:, 0] + noise}), [(10.0, 0.0)], temperature=False, gravity=None
    )
    (one,) = found(evaluation, place=[PlaceConstant("levelling", 0.0, 1e-3)]).influences
    assert by_result(evaluation, one)["inferred pitch at pitch 10 deg, roll 0 deg"] == pytest.approx(1e-3, rel=1e-6)


def test_local_gravity_scales_the_sensitivity_per_standard_gravity_alone():
    evaluation = attitude()
    (one,) = found(evaluation, place=[PlaceConstant("gravity", 9.8, 9.8e-6)]).influences
    moved = by_result(evaluation, one)
    value = dict(zip(evaluation.results.names, evaluation.results.values, strict=True))
    name = "y_V sensitivity per standard gravity"
    assert value[name] == pytest.approx(5.1 * 9.80665 / 9.8, rel=1e-6)
    assert moved[name] == pytest.approx(-1e-6 * value[name], rel=1e-6)
    assert sum(abs(v) for n, v in moved.items() if "standard gravity" not in n) == 0.0


@pytest.mark.parametrize(
    ("truth", "error"),
    [
        (Bench(pitch_error_deg=(1e-3, 0, 0, 0)), ({"pitch_deg": 1.0}, "turn", 0)),
        (Bench(pitch_error_deg=(0, 1e-3, 0, 0)), ({"pitch_deg": 1.0}, "turn", 1)),
        (Bench(roll_error_deg=(1e-3, 0, 0, 0)), ({"roll_deg": 1.0}, "turn", 0)),
        (Bench(pitch_zero_deg=1e-3), ({"pitch_deg": 1.0}, "offset", 0)),
        (Bench(lean_deg=1e-3), ("levelling", "", 1)),
    ],
    ids=["pitch, sine", "pitch, cosine", "roll, sine", "zero", "tilt"],
)
def test_a_sensitivity_is_what_the_error_does_to_the_evaluation_of_a_simulated_run(truth, error):
    """The head reads less than it turns by its error: the evaluation of the wrong run is off by minus the influence."""
    columns, behaves, which = error
    evaluation = attitude()
    if behaves:
        made = found(evaluation, stated("error", columns, behaves, always(1e-3))).influences[which]
    else:
        made = found(evaluation, place=[PlaceConstant("levelling", 0.0, 1e-3)]).influences[which]
    off = attitude(truth).results.values - evaluation.results.values
    names = evaluation.results.names
    angles = [i for i, name in enumerate(names) if name.startswith("inferred")]
    # angles are inferred from the run's own model of the outputs; hold the model against the true bench instead
    outputs = [i for i, name in enumerate(names) if " output " in name]
    volt = [i for i, name in enumerate(names) if names[i].endswith((" mx", " my", " mz", " offset"))]
    assert angles
    for i in (*volt, *outputs):
        assert off[i] == pytest.approx(-made.sensitivities[i], rel=1e-3, abs=2e-7), names[i]


def test_angles_in_use_are_off_as_the_influence_says():
    """A calibration by a head with an error, used on readings of the true bench."""
    evaluation, wrong = attitude(), attitude(Bench(pitch_error_deg=(1e-3, 5e-4, 0, 0), lean_deg=7e-4))
    head = found(evaluation, stated("head", {"pitch_deg": 1.0}, "turn", always(1e-3))).influences
    lean = found(evaluation, place=[PlaceConstant("levelling", 0.0, 7e-4)]).influences[1]
    predicted = -(head[0].sensitivities + 0.5 * head[1].sensitivities + lean.sensitivities)
    true = volts(BENCH, *np.array(AT).T)
    model = evaluation._model  # with its weights of the three sensors, which follow the scatter of a run
    values = dict(zip(evaluation.results.names, model.values(wrong._base, true, 9.8), strict=True))
    expected = dict(zip(evaluation.results.names, predicted, strict=True))
    for (pitch, roll), where in zip(AT, (LEVEL, AWAY), strict=True):
        assert values[f"inferred pitch {where}"] - pitch == pytest.approx(expected[f"inferred pitch {where}"], abs=5e-8)
        assert values[f"inferred roll {where}"] - roll == pytest.approx(expected[f"inferred roll {where}"], abs=5e-8)


def test_errors_that_are_in_the_scatter_or_act_on_nothing_are_named():
    evaluation = attitude()
    notes = found(
        evaluation,
        stated("jitter", {"pitch_deg": 1.0}, "reading", always(1e-3)),
        stated("thermometer", {"sensor_temperature_degC": 1.0}, "offset", always(0.1)),
    ).notes
    assert "jitter: independent in every observation, so it is in the scatter" in notes[0]
    assert notes[1] == "thermometer: the model of the results does not use it"


def test_corrections_are_added_in_the_units_of_the_columns():
    one = Stated("c", "s", {"bridge_mV": 1e3}, "offset", lambda x: 0.01 * x, always(0.0))
    columns = corrected({"bridge_mV": np.array([10.0, 20.0]), "other": np.zeros(2)}, [one])
    assert columns["bridge_mV"].tolist() == pytest.approx([10.1, 20.2])


def pressure() -> PressureEvaluation:
    data, _ = simulate_pressure(replace(HOMOSCEDASTIC, wholeplot_mV=1e-4, subplot_mV=1e-4), 3)
    return PressureEvaluation(data, "full", [(1.0, -90.0, 0.0), (4.0, -100.0, 10.0)])


def test_errors_of_the_pressure_standard_go_to_inferred_pressures_and_outputs_one_to_one():
    evaluation = pressure()
    gain, offset = found(
        evaluation,
        stated("gain", {"pressure_psia": 1.0}, "gain", share(1e-4)),
        stated("offset", {"pressure_psia": 1.0}, "offset", always(1e-3)),
    ).influences
    for P, where in (
        (1.0, "at 1 psia, sensor -90 degC, SSE 0 degC"),
        (4.0, "at 4 psia, sensor -100 degC, SSE 10 degC"),
    ):
        name = f"bridge inferred pressure {where}"
        assert by_result(evaluation, gain)[name] == pytest.approx(1e-4 * P, rel=1e-4)
        assert by_result(evaluation, offset)[name] == pytest.approx(1e-3, rel=1e-4)


def test_a_voltmeter_that_reads_the_transducer_in_use_too_cancels():
    evaluation = pressure()
    gain = stated("gain", {"bridge_mV": 1e3}, "gain", share(1e-4), reads=True)
    name = "bridge inferred pressure at 1 psia, sensor -90 degC, SSE 0 degC"
    (other,), (same,) = (found(evaluation, gain, same_meter=same).influences for same in (False, True))
    reading = dict(zip(evaluation.results.names, evaluation.results.values, strict=True))[
        "bridge output at 1 psia, sensor -90 degC, SSE 0 degC"
    ]
    assert abs(by_result(evaluation, other)[name]) == pytest.approx(1e-4 * reading / 2.0, rel=0.02)
    assert by_result(evaluation, same)[name] == pytest.approx(0.0, abs=1e-9)


def test_the_head_of_the_line_is_a_share_of_the_pressure():
    # 1 m of air at 20 degC and 101 325 Pa: 1.2041 kg/m3, from tables of humid air (CIPM-2007, dry)
    assert line_head(np.array([101325.0]), 1.0)[0] == pytest.approx(101325.0 - 1.2041 * 9.80665, abs=2e-3)
    evaluation = pressure()
    (one,) = found(evaluation, place=[PlaceConstant("line_head", 0.0, 0.5)]).influences
    name = "bridge inferred pressure at 4 psia, sensor -100 degC, SSE 10 degC"
    assert by_result(evaluation, one)[name] == pytest.approx(4.0 * 0.5 * 1.2041 * 9.80665 / 101325.0, rel=1e-3)


def general():
    rng, force = np.random.default_rng(4), np.tile(np.array([0.0, 2.0, 5.0, 8.0, 10.0]), 3)
    columns = {
        "force_kN": force,
        "cell_V": 0.01 + 0.5 * force + rng.normal(0, 1e-6, 15),
        "replicate": np.repeat([1.0, 2.0, 3.0], 5),
    }
    return general_evaluation(
        Table(
            "a run",
            columns,
            True,
            {},
            declared={"formula": "1 + force_kN"},
            kind="general",
            outputs={"cell_V": "cell"},
            factors=("force_kN",),
        ),
        [{"force_kN": 4.0}],
    )


def test_errors_of_weights_and_voltmeter_of_a_load_cell():
    evaluation = general()
    weights, meter, offset = found(
        evaluation,
        stated("weights", {"force_kN": 1.0}, "gain", share(5e-5)),
        stated("meter", {"cell_V": 1.0}, "gain", share(3e-5), reads=True),
        stated("offset", {"cell_V": 1.0}, "offset", always(1e-4), reads=True),
    ).influences
    assert by_result(evaluation, weights)["cell coefficient force_kN"] == pytest.approx(-0.5 * 5e-5, rel=1e-4)
    assert by_result(evaluation, weights)["cell inferred force at force 4 kN"] == pytest.approx(4 * 5e-5, rel=1e-4)
    assert by_result(evaluation, meter)["cell output at force 4 kN"] == pytest.approx(2.01 * 3e-5, rel=1e-4)
    assert by_result(evaluation, offset)["cell inferred force at force 4 kN"] == pytest.approx(-2e-4, rel=1e-4)


def test_independent_errors_of_settings_average_over_settings():
    evaluation = general()
    (group,) = found(evaluation, stated("weights", {"force_kN": 1.0}, "setting", always(1e-5))).grouped
    u = dict(zip(evaluation.results.names, np.sqrt(np.diag(group.covariance)), strict=True))
    # a straight line through five settings, whatever the number of replications: b u / sqrt(sum (x - 5)^2)
    assert u["cell coefficient force_kN"] == pytest.approx(0.5e-5 / np.sqrt(25 + 9 + 0 + 9 + 25), rel=1e-4)
    assert group.kind == "B"


def test_replications_average_errors_that_are_made_anew():
    evaluation = general()
    (group,) = found(evaluation, stated("mounting", {"cell_V": 1.0}, "replication", always(1e-3))).grouped
    u = dict(zip(evaluation.results.names, np.sqrt(np.diag(group.covariance)), strict=True))
    assert u["cell coefficient 1"] == pytest.approx(1e-3 / np.sqrt(3), rel=1e-9)
    assert u["cell coefficient force_kN"] == pytest.approx(0.0, abs=1e-12)


def test_evaluations_without_a_change_are_their_results():
    for evaluation in (attitude(), pressure(), general()):
        assert evaluation.evaluate(Shift()) == pytest.approx(evaluation.results.values, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(
    ("made", "place"),
    [
        (attitude, {"pitch_deg": 30.0, "roll_deg": 40.0}),
        (pressure, {"pressure_psia": 4.0, "sensor_temperature_degC": -100.0, "sse_temperature_degC": 10.0}),
        (general, {"force_kN": 4.0}),
    ],
)
def test_every_result_at_a_point_has_its_settings_and_a_coefficient_none(made, place):
    results = made().results
    away = {"attitude": AWAY, "pressure": "at 4 psia", "general": "at force 4 kN"}[made.__name__]
    assert len(results.at) == len(results.names)
    for name, at in zip(results.names, results.at, strict=True):
        assert (dict(at) == place) == (away in name)
        assert bool(at) == (" at " in name)
