"""The tracer on whole runs: the demo's two effects, clean runs, and the traps that make false alarms."""

import json
from dataclasses import replace

import numpy as np
import pytest

from proving.truth.attitude import D1, Bench, Plan, Sensor, simulate, told_the_truth
from rig.fitter.trace import aliases
from rig.fitter.trace.aliases import PER_COLUMN, Products
from rig.procedures.attitude.trace import trace

X, Y, Z = "x_V", "y_V", "z_V"
NIGHT = D1(180, 19, 13)  # half of the demo's, whose 2,886 points show no more than these
SMALL = D1(180, 13, 13)
# the paper's sizes: precision 1.5e-4 deg, pads 4e-4 deg on x, temperature effect of row 28(a) to (b)
HOT = tuple(Sensor(axis, S_per_degC=1.1e-4) for axis in "xyz")
DEMO = Bench(sensors=HOT, compliance={("y", "x"): 8e-4})
CLEAN = Bench()


def names(found):
    return {(s, e.effect) for s, t in found.sensors.items() for e in t.added}


DEMO_NAMES = {(s, "sensitivity-temperature") for s in (X, Y, Z)} | {(s, "isolation-pad-deflection") for s in (X, Z)}


@pytest.fixture(scope="module")
def demo():
    data, clean = simulate(DEMO, NIGHT, seed=0)
    return data, clean, trace(data)


def test_the_night_of_the_demo(demo):
    data, _, found = demo
    assert names(found) == DEMO_NAMES
    x = found.sensors[X]
    assert x.verdict == "explained"
    sigma = np.radians(1.5e-4) * 5.0
    assert x.before.sigma_E > 5 * sigma
    assert x.after.sigma_E == pytest.approx(sigma, rel=0.05)
    assert x.before.drift_S.value > 50  # as row 28(a): temperature shows in T_S and not in T_bias
    assert x.after.bias.value < 1.2
    assert x.cv_rms_after == pytest.approx(sigma, rel=0.05)
    pads = next(e for e in x.added if e.effect == "isolation-pad-deflection")
    assert pads.terms == ("sin(2*pitch)*cos(roll)",)
    assert pads.unit == "V"
    assert pads.stratum == "between-point"
    assert pads.coefficients[0] == pytest.approx(5.0 * np.radians(8e-4) / 2, rel=0.03)
    warm = next(e for e in x.added if e.effect == "sensitivity-temperature")
    assert warm.stratum == "point-by-replication"
    assert warm.coefficients[0] == pytest.approx(5.0 * 1.1e-4, rel=0.01)
    # three sensors judged together tell a package that turns from three cross-axis terms
    assert pads.separation["head-once-per-turn"] > 20
    assert len(data) == found.points == x.residual_after_V.size


def test_prediction_is_as_good_as_a_fit_that_is_told_the_truth(demo):
    data, clean, found = demo
    predicted = found.predict(data)
    without = (replace(DEMO, compliance={}), replace(DEMO, sensors=CLEAN.sensors))
    told = {sensor: told_the_truth(DEMO, without, data, sensor) for sensor in (X, Y, Z)}
    ratios = [np.std(predicted[s] - clean[s]) / np.std(told[s] - clean[s]) for s in (X, Y, Z)]
    assert np.median(ratios) < 1.1


def test_json_is_the_object_the_design_promises(demo):
    _, _, found = demo
    report = json.loads(json.dumps(found.to_json("night.csv"), allow_nan=False))
    assert report["data"] == {"file": "night.csv", "points": 1482, "kind": "pitch-roll"}
    x = report["sensors"][X]
    assert x["declared"] == "attitude-x"
    table = {"sigma_E", "sigma_bias", "sigma_prec", "T_bias", "F_bias_95", "T_b", "T_S", "F_bS_95", "cv_rms"}
    assert table <= set(x["before"])
    assert set(x["before"]) == set(x["after"])
    effect = {
        "effect",
        "stratum",
        "term",
        "coefficients",
        "stderr",
        "unit",
        "p_adjusted",
        "share",
        "aliases",
        "separate_by",
    }
    assert effect <= set(x["effects"][0])
    # nothing like it in 400 simulated runs, at least
    assert all(e["p_adjusted_is_bound"] and e["p_adjusted"] <= 1 / 401 for e in x["effects"])
    assert not any("not confirmed" in note for note in x["notes"])
    assert set(x["fitted"]["coefficients"]) >= {"1", "sin(pitch)"}


def test_same_data_same_answer():
    data, _ = simulate(DEMO, D1(180, 13, 9, replications=3), seed=0)
    first = trace(data)
    assert names(first)
    assert trace(data).to_json() == first.to_json()


def test_demo_on_a_smaller_design():
    """A bounded share of the 20-seed study; the whole of it: python -m proving attitude night."""
    found = [names(trace(simulate(DEMO, SMALL, seed)[0], validate=False)) for seed in (101, 102)]
    assert found == [DEMO_NAMES] * 2


def test_two_replications_do_not_end_in_a_crowd_of_stand_ins():
    """There and back again, temperature is nearly a function of the point: errors of the head take it up first."""
    assert names(trace(simulate(DEMO, D1(90, 13, 13, replications=2), seed=0)[0], validate=False)) == DEMO_NAMES


@pytest.mark.parametrize(
    "bench",
    [
        CLEAN,
        Bench(offset_sd=3.0),
        Bench(offset_sd=3.0, offset_walk=True),
        Bench(wander=5.0),
        Bench(jitter_deg=2e-4),
    ],
    ids=["clean", "offsets of replications", "offsets that walk", "an offset that walks all night", "a shaking head"],
)
def test_nothing_is_reported_where_nothing_is(bench):
    """Two runs of three sensors each, fixed seeds; the rates over many: python -m proving attitude noise."""
    reported = [names(trace(simulate(bench, D1(90, 13, 13), seed)[0], validate=False)) for seed in range(2)]
    assert reported == [set()] * 2


def test_verdict_on_replications_that_wander():
    data, _ = simulate(Bench(offset_sd=3.0), D1(90, 13, 13), seed=2)
    x = trace(data, validate=False).sensors[X]
    assert x.verdict == "unexplained"
    assert "between replications" in x.unnamed[0].cause
    assert trace(simulate(CLEAN, D1(90, 13, 13), 0)[0], validate=False).sensors[X].verdict == "nothing to add"


def test_an_offset_that_walks_all_night_is_said_to_walk():
    data, _ = simulate(replace(DEMO, wander=5.0), SMALL, seed=3)
    found = trace(data, validate=False)
    assert names(found) == DEMO_NAMES
    assert all(t.verdict == "explained" for t in found.sensors.values())  # the walk is a finding about the noise
    assert all("random walk" in t.unnamed[0].cause for t in found.sensors.values())


def with_strange(data, on_x):
    return replace(data, outputs={**data.outputs, X: data.outputs[X] + on_x})


def test_what_no_effect_explains_is_shown_and_not_named():
    """A cause the catalogue lacks must not be reported as whatever slightly resembles it."""
    data, clean = simulate(CLEAN, replace(SMALL, replications=4), seed=3)
    strange = 8e-5 * np.sin(3 * np.radians(data.pitch_deg)) * np.cos(2 * np.radians(data.roll_deg))
    odd = with_strange(data, strange)
    x = trace(odd, validate=False).sensors[X]
    assert x.added == ()
    assert x.verdict == "unexplained"
    assert x.unnamed[0].cause == "between points, 3 periods a turn in pitch and 2 in roll"
    assert x.unnamed[0].share > 0.9
    taken = trace(odd, unnamed=True)
    x = taken.sensors[X]
    assert x.added == ()
    assert x.verdict == "unexplained"
    assert x.unnamed[0].added
    assert x.unnamed[0].cause.startswith("between points, 3 periods a turn in pitch and 2 in roll: taken up")
    assert x.cv_rms_after < 0.5 * x.cv_rms_before
    assert np.std(taken.predict(odd)[X] - clean[X] - strange) < 0.1 * np.std(strange)
    json.dumps(taken.to_json(), allow_nan=False)


def test_what_one_sensor_shows_alone_is_not_of_the_head():
    """What a cube leaves of a fifth power resembles an error of the pitch axis, which other sensors would show.

    The nearest that a sensor may have is saturation; what that leaves is a second value of it, or a cube, by the noise.
    """
    data, _ = simulate(CLEAN, SMALL, seed=1)
    found = trace(with_strange(data, 9e-5 * np.sin(np.radians(data.pitch_deg)) ** 5), validate=False)
    assert {(X, "saturation")} <= names(found) <= {(X, "saturation"), (X, "sensor-third-order")}
    assert all(effect.doubtful for effect in found.sensors[X].added), "one unlisted cause would look like this"


def test_one_sensor_without_roll_cannot_tell_pads_from_the_head():
    bench = Bench(sensors=(Sensor("x"),), compliance={("y", "x"): 8e-4})
    data, _ = simulate(bench, Plan(np.linspace(-180, 180, 73), np.array([0.0])), seed=0)
    (effect,) = trace(data, validate=False).sensors[X].added
    assert effect.effect == "isolation-pad-deflection"
    assert effect.terms == ("sin(2*pitch)",)
    assert "head-once-per-turn" in effect.aliases
    assert "reversed" in effect.separate_by
    assert " V (" in effect.separate_by


def test_one_sensor_with_roll_can():
    for bench, name in (
        (Bench(sensors=(Sensor("x"),), compliance={("y", "x"): 8e-4}), "isolation-pad-deflection"),
        (Bench(sensors=(Sensor("x"),), pitch_error_deg=(4e-4, 0, 0, 0)), "head-once-per-turn"),
    ):
        data, _ = simulate(bench, D1(180, 19, 13), seed=0)
        found = trace(data, validate=False).sensors[X]
        (effect,) = found.added
        assert effect.effect == name
        # only the head can part commands that share an attitude
        assert (found.shared_attitude_before.p < 1e-6) == (name == "head-once-per-turn")
        assert found.shared_attitude_after.p > 1e-3


def test_temperature_that_only_rises_is_one_class_with_drift():
    bench = Bench(sensors=(Sensor("x", b_per_degC=4e-4),), degC_daily=0.25, degC_phase=-0.5, hours=3.0)
    data, _ = simulate(bench, D1(90, 13, 13), seed=1)
    assert np.corrcoef(data.elapsed_s, data.sensor_temperature_degC)[0, 1] > 0.99
    (effect,) = trace(data, validate=False).sensors[X].added
    assert {effect.effect, *effect.aliases} >= {"offset-temperature", "offset-drift"}


def test_random_order_and_missing_points():
    data, _ = simulate(DEMO, D1(180, 13, 13, order="random"), seed=2, drop=0.1)
    assert names(trace(data, validate=False)) == DEMO_NAMES


def test_backlash_without_roll_and_direction_alternating_by_replication():
    """There the offset of a replication and its direction are one: replications are the only evidence."""
    plan = Plan(np.linspace(-180, 180, 37), np.array([0.0]), replications=8)
    x_only = (Sensor("x"),)
    for seed in range(4):
        data, _ = simulate(Bench(sensors=x_only, offset_sd=0.5), plan, seed)
        assert ("x_V", "backlash-pitch") not in names(trace(data, validate=False))
    data, _ = simulate(Bench(sensors=x_only, pitch_backlash_deg=2e-3), plan, 0)
    (effect,) = trace(data, validate=False).sensors[X].added
    assert effect.effect == "backlash-pitch"
    assert effect.stratum == "replication"


def test_a_single_replication_is_judged_against_its_residual():
    data, _ = simulate(Bench(compliance={("y", "x"): 8e-4}), D1(180, 19, 13, replications=1), seed=1)
    found = trace(data)
    assert names(found) == {(X, "isolation-pad-deflection"), (Z, "isolation-pad-deflection")}
    assert found.sensors[X].cv_rms_after is None
    json.dumps(found.to_json(), allow_nan=False)


@pytest.mark.parametrize(
    ("bench", "plan"),
    [
        (Bench(sigma_deg=0.0), D1(90, 7, 5)),
        (CLEAN, Plan(np.array([-90.0, 0, 90, 180]), np.array([0.0, 90, -90]))),
        (CLEAN, Plan(np.array([-30.0, 30]), np.array([0.0, 90, 180]), replications=2)),
        (Bench(sensors=(Sensor("x"),)), Plan(np.array([-90.0, 0, 90]), np.array([0.0]), replications=2)),
        (Bench(sensors=(Sensor("x"),)), Plan(np.linspace(-36, 36, 37), np.array([0.0]), replications=1)),
        (Bench(degC_daily=0.0), D1(90, 7, 5, replications=3)),
    ],
    ids=["no noise", "tumble", "eight points", "three points, no roll", "one pass", "constant temperature"],
)
def test_little_data_is_no_reason_to_fail(bench, plan):
    found = trace(simulate(bench, plan, seed=0)[0], validate=False)
    assert all(t.verdict == "nothing to add" for t in found.sensors.values())
    json.dumps(found.to_json(), allow_nan=False)


def test_without_a_recorded_temperature_all_else_works():
    data, _ = simulate(Bench(compliance={("y", "x"): 8e-4}), replace(SMALL, replications=4), seed=0)
    cold = replace(data, sensor_temperature_degC=None)
    assert cold.take(np.arange(100)).sensor_temperature_degC is None
    found = trace(cold, validate=False)
    assert names(found) == {(X, "isolation-pad-deflection"), (Z, "isolation-pad-deflection")}
    report = json.loads(json.dumps(found.to_json(), allow_nan=False))
    assert report["reference"]["temperature_degC"] is None
    untested = "no sensor temperature was recorded: temperature effects could not be tested"
    assert all(untested in sensor["notes"] for sensor in report["sensors"].values())
    assert untested not in trace(data, validate=False).sensors[X].notes
    # what is predicted does not need a temperature either, unless an effect of it was found
    np.testing.assert_array_equal(found.predict(data)[X], found.predict(cold)[X])
    few = replace(SMALL, replications=2)
    hot = trace(simulate(Bench(sensors=HOT), few, seed=0)[0], validate=False)
    with pytest.raises(ValueError, match="no sensor temperature was recorded"):
        hot.predict(cold)
    hidden = trace(replace(simulate(DEMO, few, seed=0)[0], sensor_temperature_degC=None), validate=False)
    assert not any("temperature" in effect for _, effect in names(hidden))


def test_effects_that_replications_left_out_do_not_bear_out_are_noted():
    """Weak but significant pads: real, and yet of little use for what was not fitted."""
    data, _ = simulate(Bench(compliance={("y", "x"): 1e-4}), D1(180, 19, 13), seed=0)
    x = trace(data).sensors[X]
    assert x.added
    assert x.cv_rms_after > 0.8 * x.cv_rms_before
    assert any(note.startswith("not confirmed by replications left out: ") for note in x.notes)


def test_a_p_value_the_simulation_resolves_is_no_bound():
    """Pads that are hardly seen, and ones of twice the size."""
    found = [trace(simulate(Bench(compliance={("y", "x"): c}), SMALL, 2)[0], validate=False) for c in (5e-5, 1e-4)]
    effects = [e for one in found for t in one.sensors.values() for e in t.added]
    assert {e.p_adjusted_is_bound for e in effects} == {False, True}
    for e in effects:  # one in the number of simulated runs, which are 400 at least, and one more
        runs = 1.0 / e.p_adjusted - 1.0
        bound = runs == pytest.approx(round(runs), rel=1e-9) and runs > 399.0
        assert e.p_adjusted_is_bound == bound, e.p_adjusted


def test_with_temperature_in_the_declared_model_row_28a_becomes_row_28b(demo):
    """Table 2: sigma_E falls, T_S goes, and the pads' lack of fit, hidden in row (a), stands out in row (b)."""
    data, _, plainly = demo
    found = trace(data, temperature=True)
    assert names(found) == {(s, "isolation-pad-deflection") for s in (X, Z)}
    a, b = plainly.sensors[X].before, found.sensors[X].before
    assert a.bias.value < a.bias.limit_95
    assert a.drift_S.value > 100 * a.drift_S.limit_95
    assert b.bias.value > 10 * b.bias.limit_95
    assert b.drift_S.value < b.drift_S.limit_95
    x = found.sensors[X]
    assert x.declared == "attitude-x with temperature"
    per_degC, error = x.temperature.coefficients[1], np.sqrt(x.temperature.covariance[1, 1])
    assert per_degC == pytest.approx(5.0 * 1.1e-4, abs=4 * error)
    assert x.after.sigma_E == pytest.approx(np.radians(1.5e-4) * 5.0, rel=0.05)
    assert x.cv_rms_after == pytest.approx(x.after.sigma_E, rel=0.05)
    np.testing.assert_allclose(found.predict(data)[X], plainly.predict(data)[X], atol=2e-6)
    with pytest.raises(ValueError, match="no sensor temperature was recorded"):
        trace(replace(data, sensor_temperature_degC=None), temperature=True)
    with pytest.raises(ValueError, match="never changed"):
        trace(replace(data, sensor_temperature_degC=np.full(len(data), 23.0)), temperature=True)


def test_a_temperature_that_was_declared_is_not_missed_where_there_is_none():
    clean = [simulate(CLEAN, D1(90, 13, 13), seed)[0] for seed in range(2)]
    found = [trace(data, temperature=True, validate=False) for data in clean]
    assert [names(f) for f in found] == [set()] * 2


def test_a_column_of_which_nothing_is_left_explains_nothing():
    """Two replications, one up and one down: hysteresis is an offset of each, gone with these but for rounding."""
    rounding = Products(np.diag([1.0, 1e-34]), np.array([3.0, 1e-15]))
    assert rounding.price((1,)) < rounding.price((0,)), "1e-30 over 1e-34 passes for evidence"
    left = rounding.without(np.ones(2))
    assert left.price((1,)) == PER_COLUMN
    assert left.price((0,)) == rounding.price((0,))


def test_errors_of_the_fitted_parameters_are_those_of_the_joint_fit():
    """Least squares of declared model and effect together, by numpy."""
    bench = Bench(sensors=(Sensor("x", quadratic=2e-5), Sensor("y"), Sensor("z")))
    data, _ = simulate(bench, D1(180, 13, 13, replications=2), seed=3)
    found = trace(data, validate=False)
    (effect,) = found.sensors[X].added
    assert effect.effect == "sensor-second-order"
    a, r = np.radians(data.pitch_deg), np.radians(data.roll_deg)
    h = [np.ones_like(a), np.sin(a), np.cos(a) * np.sin(r), np.cos(a) * np.cos(r)]
    columns = np.column_stack([*h, effect.contribution_V / effect.coefficients[0]])
    rss = np.linalg.lstsq(columns, data.outputs[X], rcond=None)[1][0]
    stderr = np.sqrt(np.diag(np.linalg.inv(columns.T @ columns)) * rss / (len(data) - 5))
    table = found.sensors[X].outcome().to_json()["fitted"]["coefficients"]
    np.testing.assert_allclose([e["stderr"] for e in list(table.values())[:4]], stderr[:4], rtol=0.05)
    assert next(iter(table.values()))["df"] == len(data) - 5


def test_explanations_of_several_sensors_are_found_sensor_by_sensor():
    """Two sensors with three columns each, one of them twice: price of each set by numpy's least squares."""
    rng = np.random.default_rng(3)
    own = [rng.standard_normal((40, 3)) for _ in range(2)]
    columns = np.zeros((80, 7))
    columns[:40, :3], columns[40:, 3:6], columns[40:, 6] = *own, own[1][:, 0]
    y = columns @ [9.0, 0.0, 5.0, 7.0, -6.0, 0.0, 0.0] + rng.standard_normal(80)
    products = Products(columns.T @ columns, columns.T @ y)
    units = [(j,) for j in range(7)]
    assert products.parts(units).tolist() == [0, 0, 0, 1, 1, 1, 1]
    (path,) = aliases._paths(products, [(units, False)])
    assert max(path, key=len) == (0, 2, 3, 4), "of two equal columns the first"
    for terms, price in path.items():
        gained = y @ y - np.linalg.lstsq(columns[:, terms], y, rcond=None)[1][0]
        assert price == pytest.approx(PER_COLUMN * len(terms) - gained, rel=1e-12)


def test_columns_that_are_joined_through_others_are_one_part():
    """Each shares a row with the next only."""
    columns = np.zeros((12, 10))
    for j in range(6):
        columns[j : j + 2, 5 - j] = 1.0
    columns[8:, 6:] = np.eye(4)
    found = Products(columns.T @ columns, np.zeros(10)).parts([(j,) for j in range(10)])
    assert found.tolist() == [0, 0, 0, 0, 0, 0, 1, 2, 3, 4]


@pytest.mark.parametrize("sign", [0.0, 1.0])
def test_a_candidate_alone_has_the_price_that_it_has_with_one_that_explains_nothing(sign):
    rng = np.random.default_rng(4)
    columns, y = rng.standard_normal((30, 4)), rng.standard_normal(30)
    columns[:, 3] = 0.0
    dots = columns.T @ y
    products = Products(columns.T @ columns, dots, signs=np.full(4, -sign * np.sign(dots[0])))
    alone, beside = products.prices([(0,), (1,), (2,)]), products.prices([(3, 0), (3, 1), (3, 2)])
    np.testing.assert_allclose(alone, beside - PER_COLUMN, rtol=1e-12)
    assert sign or np.isfinite(alone).all()
