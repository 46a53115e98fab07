"""What is found of the noise of attitude runs, and that it neither hides an effect nor makes one."""

import re
from dataclasses import replace

import numpy as np
import pytest

from proving.truth.attitude import D1, Bench, simulate
from proving.truth.attitude_hidden import CLEAN, sized
from rig.procedures.attitude.effects.gears import periods
from rig.procedures.attitude.effects.thermal import lagged
from rig.procedures.attitude.trace import trace

X = "x_V"
PLAN = D1(180, 13, 7)
SIGMA_V = np.radians(1.5e-4) * 5.0


def names(found):
    return {(s, e.effect) for s, t in found.sensors.items() for e in t.added}


def noise(found):
    return {(s, e.effect) for s, t in found.sensors.items() for e in t.noise}


def with_outliers(data, rows, sd):
    y = data.outputs[X].copy()
    y[rows] += np.array(sd) * SIGMA_V
    return replace(data, outputs={**data.outputs, X: y})


def test_readings_far_off_are_pointed_at_and_hide_nothing():
    data, _ = simulate(sized("cube", 1.0, PLAN), PLAN, seed=3)
    spoilt = with_outliers(data, [17, 311], [60.0, -25.0])
    found, plain = (trace(one, validate=False) for one in (spoilt, data))
    assert names(found) == names(plain) == {(X, "sensor-third-order")}
    assert set(found.outliers) == {17, 311}
    assert plain.outliers == ()
    (finding,) = [e for e in found.sensors[X].noise if e.effect == "outliers"]
    assert finding.stratum == "noise"
    assert finding.terms[0].startswith("order 17 at pitch")
    assert finding.coefficients == pytest.approx((60 * SIGMA_V, -25 * SIGMA_V), abs=5 * SIGMA_V)
    assert found.sensors[X].residual_after_V.size == len(data)
    assert found.sensors[X].residual_after_V[17] == pytest.approx(60 * SIGMA_V, abs=5 * SIGMA_V)
    kept, told = (one.sensors[X].added[0] for one in (found, plain))
    assert abs(kept.coefficients[0] - told.coefficients[0]) < told.stderr[0]
    assert [e["effect"] for e in found.to_json()["sensors"][X]["effects"]] == ["sensor-third-order", "outliers"]


def test_readings_far_off_make_no_effect():
    data, _ = simulate(CLEAN, PLAN, seed=4)
    found = trace(with_outliers(data, [5, 400], [120.0, 90.0]), validate=False)
    assert names(found) == set()
    assert set(found.outliers) == {5, 400}


def test_gross_errors_of_two_sensors_of_a_small_run_are_said_in_each():
    """Four readings of 364 were more than a share of all, together: nothing was said of them."""
    data, _ = simulate(sized("cube", 1.0, PLAN), PLAN, seed=3)
    y = data.outputs["y_V"].copy()
    y[[40, 200]] += 40.0 * SIGMA_V
    spoilt = with_outliers(replace(data, outputs={**data.outputs, "y_V": y}), [17, 311], [60.0, -25.0])
    found = trace(spoilt, validate=False)
    assert names(found) == {(X, "sensor-third-order")}
    assert noise(found) == {(X, "outliers"), ("y_V", "outliers")}
    assert set(found.outliers) == {17, 40, 200, 311}


def test_a_head_that_shakes_is_said_to_make_noise_that_grows_with_the_slope():
    found = trace(simulate(Bench(jitter_deg=3e-4), D1(180, 13, 13), seed=1)[0], validate=False)
    assert names(found) == set()
    (finding,) = [e for e in found.sensors[X].noise if e.effect == "noise-grows"]
    assert "slope" in finding.cause
    assert finding.coefficients[0] < 0.7 * finding.coefficients[1]
    low, high = (float(n) for n in re.findall(r"by (\d\.\d\d) to (\d\.\d\d) times", finding.size)[0])
    # of 600 such runs the component along x scatters by 0.77 times its standard error, those along y and z by 1.15
    assert (low, high) == pytest.approx((0.77, 1.15), abs=0.08)


def test_an_offset_that_walks_is_a_finding():
    found = trace(simulate(Bench(wander=8.0), D1(180, 13, 13), seed=1)[0], validate=False)
    assert names(found) == set()
    assert noise(found) == {(f"{axis}_V", "autocorrelation") for axis in "xyz"}
    (walk,) = found.sensors[X].noise
    assert walk.coefficients[0] == pytest.approx(8 * SIGMA_V, rel=0.6)


def test_an_effect_of_the_sensor_in_time_is_doubtful_beside_an_offset_that_walks():
    """A heater that follows the load looked like a walk and, in one sensor, like creep."""
    first, *others = Bench().sensors
    bench = Bench(wander=8.0, sensors=(replace(first, creep=3e-4), *others))
    found = trace(simulate(bench, D1(180, 13, 7), seed=1)[0], validate=False).sensors[X]
    (creep,) = found.added
    assert (creep.effect, found.verdict) == ("creep", "partly explained")
    assert "something wanders slowly" in creep.doubtful


def test_nothing_is_said_of_ordinary_noise():
    assert noise(trace(simulate(CLEAN, PLAN, seed=0)[0], validate=False)) == set()


def test_a_lag_is_that_of_a_body_of_one_time_constant():
    bench = Bench(lag_h=1.2)
    data, _ = simulate(bench, D1(180, 25, 13), seed=0)
    np.testing.assert_allclose(lagged(data, 1.2), bench.lagged(data.elapsed_s / 3600.0), atol=2e-6)
    part = data.take(np.arange(900, 1000))
    np.testing.assert_array_equal(lagged(part, 1.2), lagged(data, 1.2)[900:1000])


def test_periods_that_are_searched_end_where_half_a_period_is_a_step():
    assert periods(np.arange(-180.0, 181, 30)) == (3.0, 4.0, 5.0, 6.0), "a gear has no half teeth, and three at least"
    assert periods(np.array([-30.0, 0, 30])) == ()
    assert max(periods(np.linspace(-30, 30, 13))) == 36.0
    assert max(periods(np.linspace(-180, 180, 3601))) == 180.0, "no more than a search of minutes can try"


def test_angles_that_are_never_visited_twice_do_not_make_thousands_of_periods():
    """756 random angles made 10,994 columns: a trace of hours and of 18 GB."""
    print("seed 7")
    tried = periods(np.sort(np.random.default_rng(7).uniform(-90, 90, 756)))
    assert tried == tuple(np.arange(3.0, 181.0)), "whole numbers: uneven steps have no aliases at halves"
    few = periods(np.cumsum([0.0, 21.0, 7.0, 17.0, 3.0, 22.0, 8.0, 12.0]))
    assert max(few) <= 180 / (90 / 7)


def test_the_point_before_is_that_of_the_order_of_running():
    data, _ = simulate(CLEAN, PLAN, seed=0)
    back = data.take(np.arange(len(data))[::-1])
    np.testing.assert_array_equal(data.previous_pitch_deg[1:], data.pitch_deg[:-1])
    np.testing.assert_array_equal(back.previous_roll_deg[::-1], data.previous_roll_deg)
