"""Attitude runs with something that no catalogue lists: it is told without a name, or the name is doubtful."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from strangers_tables import table

import rig
from proving.truth.attitude import D1, simulate
from proving.truth.attitude_hidden import CLEAN, sized, together
from rig.fitter.trace.flexible import Block, evidence, orders_of, remainders, turns, waves
from rig.fitter.trace.lines import CLEAR, line
from rig.procedures.attitude.effects.steps import OFFSET_STEP_UNRECORDED
from rig.procedures.attitude.trace import trace
from rig.procedures.attitude.trace.make_problem import make_problem
from rig.procedures.attitude.trace.refine import refined

PLAN = D1(180, 13, 13, replications=4)
X = "x_V"


def with_error(error, seed, sensors=(X,), plan=PLAN):
    """A clean run with `error(data, scene angle)` in readings' standard deviations added to some sensors."""
    data, truth = simulate(CLEAN, plan, seed)
    outputs = dict(data.outputs)
    for sensor in sensors:
        sd = float(np.std(data.outputs[sensor] - truth[sensor]))
        outputs[sensor] = data.outputs[sensor] + sd * error(data)
    return replace(data, outputs=outputs)


def test_a_wave_over_an_angle_is_seen_and_noise_is_not():
    rng = np.random.default_rng(3)
    angle = np.tile(np.linspace(-180, 180, 13), 20)
    columns = turns(angle, 6)
    block = Block("over roll", columns, orders_of(columns), np.repeat(np.arange(1.0, 7.0), 2))
    noise = rng.standard_normal(angle.size)

    def centred(given):
        return given - given.mean(axis=0)

    (quiet,) = remainders(noise - noise.mean(), angle.size - 1, [block], centred)
    loud = noise + np.sin(3 * np.radians(angle))
    (seen,) = remainders(loud - loud.mean(), angle.size - 1, [block], centred)
    assert quiet.p > 1e-3
    assert seen.p < 1e-9
    assert seen.share == pytest.approx(1 / 3, abs=0.1)


def test_evidence_pays_for_what_is_free_to_fit():
    """A straight line is likelier as one column than as a smooth curve; a curve is likelier as that."""
    rng = np.random.default_rng(4)
    x = np.linspace(-1, 1, 200)
    smooth, rough = waves(x, 8), np.arange(1.0, 9.0)
    straight, bent = (rng.standard_normal(200) + 2 * shape for shape in (x, np.sin(5 * x)))
    assert evidence(straight, x[:, None]) > evidence(straight, smooth, rough) + 1
    assert evidence(bent, smooth, rough) > evidence(bent, x[:, None]) + 20


@pytest.mark.parametrize("kind", ["white", "remembers", "walks"])
def test_noise_of_any_colour_has_no_period(kind):
    n, found = 400, 0
    for seed in range(20):
        white = np.random.default_rng(seed).standard_normal(n)
        series = white
        if kind == "walks":
            series = np.cumsum(white)
        if kind == "remembers":
            series = np.convolve(white, 0.7 ** np.arange(30))[:n]
        told = line(series - series.mean(), np.arange(n) * 60.0, np.zeros(n, np.int64))
        found += told is not None and told.p < 1e-3
    assert found == 0


def test_a_period_is_found_with_its_length():
    n = 400
    series = np.random.default_rng(1).standard_normal(n) + np.sin(2 * np.pi * np.arange(n) / 6.43)
    told = line(series, np.cumsum(np.full(n, 60.0)), np.zeros(n, np.int64))
    assert told is not None
    assert told.p < 1e-6
    period = told.period if told.unit == "readings" else told.period / 60.0
    assert period == pytest.approx(6.43, rel=0.02)


def test_mains_that_beat_with_the_readings_are_left_without_a_name():
    found = trace(with_error(lambda d: 1.5 * np.sin(2 * np.pi * d.order / 6.43), seed=2), validate=False)
    sensor = found.sensors[X]
    assert sensor.verdict == "unexplained"
    assert not sensor.added
    assert any("periodic" in rest.cause for rest in sensor.unnamed)
    assert all(other.verdict == "nothing to add" for name, other in found.sensors.items() if name != X)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_shape_of_no_catalogue_is_not_explained(seed):
    """A ripple of nine periods over the range of the sensor: a converter's, say."""
    found = trace(with_error(lambda d: 1.4 * np.sin(9 * np.pi * np.sin(np.radians(d.pitch_deg))), seed), validate=False)
    sensor = found.sensors[X]
    assert sensor.verdict != "explained"
    assert sensor.unnamed or all(effect.doubtful for effect in sensor.added)


def test_a_gear_beside_an_index_error_is_doubtful(tmp_path):
    """A stranger's head with a pin for multiples of 15 degrees, and a drum, which is off, for what lies between."""
    file = tmp_path / "notch.csv"
    file.write_text(table("notch_or_drum").csv)
    for sensor in rig.open(file).trace().to_json()["sensors"].values():
        assert {one["effect"] for one in sensor["effects"]} >= {"gear-pitch", "index-error"}
        assert all(one["doubtful"] for one in sensor["effects"])
        assert sensor["verdict"] == "partly explained"


def test_a_drift_beside_a_daily_course_is_doubtful_before_the_day_has_come_back():
    """Of one quantity they follow any slow course together: a crane that parks above the hall was both, undoubted."""
    data, _ = simulate(together([sized("tilt, time", 1.0, PLAN), sized("tilt, day", 1.0, PLAN)]), PLAN, seed=3)
    for sensor in trace(data, validate=False).sensors.values():
        assert {effect.effect for effect in sensor.added} == {"tilt-drift", "tilt-daily"}
        assert all("found together" in (effect.doubtful or "") for effect in sensor.added)


SIX = D1(180, 13, 13, replications=6)


@pytest.mark.parametrize(("first", "seed"), [(3, 5), (4, 6)])
def test_a_step_between_replications_is_named_at_its_boundary_and_taken_out_whole(first, seed):
    data = with_error(lambda d: 2.0 * (d.replicate >= first), seed=seed, plan=SIX)
    found = trace(data, validate=False)
    (effect,) = found.sensors[X].added
    assert effect.effect == "offset-step-unrecorded"
    assert effect.terms == (f"from replication {first}",)
    clean = trace(simulate(CLEAN, SIX, seed)[0], validate=False).sensors[X]
    assert found.sensors[X].after.sigma_E == pytest.approx(clean.after.sigma_E, rel=0.02)
    assert all(not other.added for name, other in found.sensors.items() if name != X)


@pytest.mark.parametrize("seed", [5, 6])
@pytest.mark.parametrize("first", [3, 4])
def test_a_step_between_replications_is_never_silent_and_never_made_worse(first, seed):
    """Six numbers do not always name it: then replications are said to differ."""
    sensor = trace(with_error(lambda d: 2.0 * (d.replicate >= first), seed=seed, plan=SIX), validate=False).sensors[X]
    assert sensor.verdict != "nothing to add"
    assert sensor.after.sigma_E <= sensor.before.sigma_E
    assert sensor.added or any("between replications" in rest.cause for rest in sensor.unnamed)


def placed(since, seed=5):
    """Where a step of the x sensor's offset, 1 sd high, is placed that was found near 3/6 of the run."""
    data = with_error(lambda d: 1.0 * since(d), seed=seed, plan=SIX)
    problem = make_problem(data, [OFFSET_STEP_UNRECORDED])
    begins = float(np.min(data.elapsed_s[data.replicate == 4])) / 3600.0
    sought = [
        (abs(float(c.term.name.split()[1]) - begins), j)
        for j, c in enumerate(problem.candidates)
        if c.sensor == X and c.term.name.endswith(" h")
    ]
    (_, near) = min(sought)
    return refined(problem, (near,)).candidates[near].term.name, begins


def test_a_step_that_replications_do_not_place_is_placed_between_two_of_them():
    """Each replication has parameters of its own, and what is seen within them does not place it: some rows off."""
    name, _ = placed(lambda d: d.replicate >= 4)
    assert name == "from replication 4"


def test_a_step_within_a_replication_stays_there():
    def since(d):
        return d.elapsed_s >= np.sort(d.elapsed_s[d.replicate == 4])[10]

    name, begins = placed(lambda d: 2.5 * since(d))
    assert name.endswith(" h")
    assert float(name.split()[1]) > begins


def in_whole_plots(rng, plots=20, readings=11):
    """Times of readings every four minutes with two hours between whole plots, and which whole plot each is in."""
    waits = rng.uniform(150.0, 330.0, plots * readings) + 7200.0 * (np.arange(plots * readings) % readings == 0)
    return np.cumsum(waits), np.repeat(np.arange(plots), readings)


def test_a_period_faster_than_the_pauses_is_found():
    """A compressor of 18 minutes, seen eleven times in an hour and then not for two: was never tried."""
    rng = np.random.default_rng(61)
    elapsed_s, plot = in_whole_plots(rng)
    runs = ((elapsed_s / 1084.0 + 0.3) % 1.0 < 0.5) - 0.5
    found = line(rng.standard_normal(plot.size) + 2.0 * runs, elapsed_s, plot)
    assert found.p < CLEAR
    assert found.unit == "s"
    assert found.period == pytest.approx(1084.0, rel=1e-3)


@pytest.mark.parametrize("rho", [0.0, 0.6])
def test_noise_with_pauses_has_no_period(rho):
    rng = np.random.default_rng(62)
    for _ in range(60):
        elapsed_s, plot = in_whole_plots(rng)
        noise = rng.standard_normal(plot.size)
        for k in range(1, plot.size):
            if plot[k] == plot[k - 1]:
                noise[k] = rho * noise[k - 1] + np.sqrt(1.0 - rho**2) * noise[k]
        assert line(noise, elapsed_s, plot).p >= CLEAR
