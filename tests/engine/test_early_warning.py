"""Early warnings: what each test says and when, that a clean run is left alone, and what the controller does of it."""

from __future__ import annotations

import json
import math
import random
import re
import statistics
from pathlib import Path
from unittest.mock import patch

import pytest
from command import rig
from dry import SHORT, write_short
from ideal_bench import PROCEDURE, new_run, run_session

from rig.engine.early_warning import EarlyWarnings, in_unit, warnings_of
from rig.engine.response_statistics import ResponseTest
from rig.engine.session import Outcome
from rig.engine.warning_statistics import NoiseTest, Number, PreviousTest, RepeatTest, StillTest
from rig.examples import example
from rig.procedures.attitude.settings import PitchRollProcedure
from rig.procedures.general.settings import GeneralProcedure
from rig.run_file.read.reader import RunReader

LAB = example("attitude-lab")

PROCEDURE_OF_NIGHT = PitchRollProcedure.model_validate(
    {
        "kind": "pitch-roll",
        "name": "night",
        "replications": 4,
        "design": {"type": "D1", "pitch_max_deg": 30, "pitch_count": 7, "roll_count": 9},
    }
)
NIGHT, CONDUCT = PROCEDURE_OF_NIGHT.expand(), PROCEDURE_OF_NIGHT.conduct


def say(value: float) -> str:
    return f"{value:.3g}"


def body(point, rng, *, sd=50e-6, spoil=lambda readings: readings):
    """An observation of a sensor along the package's x axis, 5 V/g."""
    true = 0.01 + 5.0 * math.sin(math.radians(point.setpoints[0]))
    readings = spoil([true + rng.gauss(0.0, sd) for _ in range(10)])
    return {
        "outputs": {
            "x_V": {"mean": statistics.fmean(readings), "sd": statistics.stdev(readings), "readings": readings}
        },
        "temperatures": {"sensor_temperature_degC": {"mean": 23.0, "sd": 0.0, "readings": [23.0]}},
    }


def told(since, spoil, *, seed=3, sd=50e-6):
    """(points after `since`, warning) of a night in which something goes wrong."""
    rng, warnings, found = random.Random(seed), EarlyWarnings(NIGHT, None, CONDUCT), []
    for i, point in enumerate(NIGHT.points):
        wrong = spoil(point) if i >= since else (lambda readings: readings)
        found += [(i - since + 1, w) for w in warnings.add(point, None, body(point, rng, sd=sd, spoil=wrong))]
    return found


@pytest.mark.parametrize("seed", range(6))
def test_a_clean_night_is_left_alone(seed):
    assert told(10**9, None, seed=seed) == []


def test_a_bench_without_any_noise_is_left_alone():
    assert told(10**9, None, sd=0.0) == []


WATER = GeneralProcedure.model_validate(
    {
        "kind": "general",
        "name": "meter on water",
        "seed": 1,
        "replications": 2,
        "factors": {
            "flow_Lpm": {"levels": [5, 10, 15, 20, 25, 30, 35, 40, 45, 50], "order": "up-down"},
            "water_degC": {"levels": [15, 25, 35], "hard": True},
        },
        "model": {"formula": "1 + flow_Lpm + flow_Lpm^2 + flow_Lpm:water_degC"},
    }
)


def on_water(seed, water_sd, spoil=lambda _, value: value):
    """Warnings of a clean run in whole plots, of a meter whose water is at one temperature while the flow is swept."""
    run_list, rng = WATER.expand(), random.Random(seed)
    warnings, found = EarlyWarnings(run_list, None, WATER.conduct), []
    for point in run_list.points:
        flow, water = point.setpoints
        clean = 10 * flow * (1 - 3e-5 * (water - 25)) - 0.3 * flow * math.exp(-flow / 9)
        mean = spoil(point, clean + rng.gauss(0, 0.05))
        output = {"mean": mean, "sd": 0.03, "readings": [mean - 0.03, mean + 0.03]}
        read = water + rng.gauss(0, water_sd)
        about = {
            "temperatures": {"water_degC": {"mean": read, "sd": 0.0, "readings": [read]}},
            "references": {"flow_Lpm": {"mean": 1.004 * flow + 0.03 + rng.gauss(0, 1e-3)}},
        }
        found += warnings.add(point, point.whole_plot, {"outputs": {"meter_Hz": output}, **about})
    return [warning.message for warning in found]


@pytest.mark.parametrize("water_sd", [0.0, 0.003], ids=["to the digit", "within 3 mK"])
def test_no_temperature_is_predicted_from_a_whole_plot_at_another_one(water_sd):
    assert [on_water(seed, water_sd) for seed in range(3)] == [[]] * 3


def test_what_other_whole_plots_determine_is_predicted_and_a_jump_there_is_told():
    (told_of,) = on_water(1, 0.003, lambda point, mean: mean + 40 * (point.whole_plot >= 4))
    assert "away from what its settings gave before" in told_of


def around_mean(times):
    def spoil(_point):
        def louder(readings):
            mean = statistics.fmean(readings)
            return [mean + times * (r - mean) for r in readings]

        return louder

    return spoil


def test_rising_noise_is_told_once_with_how_much():
    ((after, warning),) = told(130, around_mean(2.0))
    assert after <= 6
    assert (warning.cause, warning.output) == ("noise", "x_V")
    assert "times as noisy" in warning.message
    assert "uV" in warning.message


@pytest.mark.parametrize(
    ("what", "readings", "words"),
    [
        ("frozen", lambda _: [1.25] * 10, "is frozen"),
        ("open", lambda rng: [rng.gauss(0, 1e-3) for _ in range(10)], ""),
        ("rail", lambda rng: [rng.gauss(11.9, 1e-3) for _ in range(10)], "is it at a rail?"),
    ],
)
def test_a_sensor_that_died_is_told_within_a_few_points(what, readings, words):
    rng = random.Random(1)
    found = [(after, w) for after, w in told(130, lambda _: lambda _: readings(rng)) if w.cause == "response"]
    assert len(found) == 1, what
    assert found[0][0] <= 4, what
    assert words in found[0][1].message


def test_a_sensor_that_lost_half_its_response_is_told():
    assert "response" in {w.cause for _, w in told(130, lambda _: lambda readings: [r / 2 for r in readings])}


def test_amperes_beside_the_cube_of_a_temperature_are_followed():
    """Small columns fell out of the fit: the voltage of a working thermometer was said to follow nothing."""
    settings = [(amperes, degC) for degC in (75.0, 0.0, 100.0, 25.0, 50.0) for amperes in (5e-5, 1e-4, 1.4e-4, 2e-4)]
    rows = [(a, t, a * t, t**2, a * t**2, t**3) for a, t in settings] * 2
    test = ResponseTest([max(column) - min(column) for column in zip(*rows, strict=True)], 0.03, say)
    said = [test.add(row, 1e6 * row[0] + 3900.0 * row[2], 1e-8, new_whole_plot=False) for row in rows]
    assert test._model is not None
    assert set(said) == {""}


@pytest.mark.parametrize("seed", range(40))
def test_the_short_look_finds_nothing_only_where_the_tests_of_response_find_nothing(seed):
    rng = random.Random(seed)
    short, full = (ResponseTest((0.0, 10.0), 0.03, say) for _ in range(2))
    gain, offset = rng.choice(
        [(0.0, 1.0), (0.5, 0.0), (rng.uniform(0.75, 0.85), 0.0), (1.0, rng.uniform(0.1, 1.0)), (1, 0)]
    )
    sd, spoiled_at, steps, looks, said = (
        rng.choice([0.0, 1e-3, 0.05]),
        rng.randrange(20, 80),
        rng.choice([1, 3, 9]),
        0,
        [],
    )
    for i in range(120):
        x = 10.0 * math.sin(i // steps) if i % 50 < 35 else 5.0
        y = 3.0 * x + rng.gauss(0.0, sd)
        read = gain * y + offset if i >= spoiled_at else y
        still = 0.0 if rng.random() < 0.2 else 1e-6
        with patch.object(ResponseTest, "_follows", return_value=False):
            expected = full.add((1.0, x), read, still, new_whole_plot=False)
        said.append((short.add((1.0, x), read, still, new_whole_plot=False), expected))
        looks += short._follows()
        assert short._off == full._off
    assert all(one == other for one, other in said)
    assert looks, "it was never used"
    if not gain:
        assert any(one for one, _ in said)


def test_a_sensor_that_never_lived_is_told_as_soon_as_the_settings_have_moved():
    rng = random.Random(1)
    found = told(0, lambda _: lambda _: [rng.gauss(0, 1e-4) for _ in range(10)])
    assert [w.cause for _, w in found] == ["response"]
    assert found[0][0] <= len(NIGHT) // 8


@pytest.mark.parametrize(("step", "told_of"), [(0.001, True), (0.1, False)])
def test_a_thermometer_that_hangs_is_told_unless_it_is_so_coarse_that_nobody_can_know(step, told_of):
    rng, warnings, found = random.Random(5), EarlyWarnings(NIGHT, None, CONDUCT), []
    for i, point in enumerate(NIGHT.points):
        given = body(point, rng)
        true = 23.0 + 0.3 * math.sin(i / 60.0)
        readings = [step * round((true + rng.gauss(0.0, 0.005)) / step) for _ in range(10)] if i < 100 else [22.9] * 10
        given["temperatures"]["sensor_temperature_degC"]["readings"] = readings
        found += [(i - 99, w) for w in warnings.add(point, None, given)]
    assert [w.cause for _, w in found] == ["thermometer"] * told_of
    if told_of:
        at, warned = found[0]
        assert at == 1
        assert warned.message.startswith("sensor_temperature_degC hangs: it has read 22.9 degC 10 times in a row")


def test_a_hygrometer_that_hangs_is_told_in_its_own_unit():
    rng, warnings, found = random.Random(5), EarlyWarnings(NIGHT, None, CONDUCT), []
    for i, point in enumerate(NIGHT.points):
        readings = [round(45.0 + rng.gauss(0.0, 0.02), 3) for _ in range(10)] if i < 100 else [45.1] * 10
        channel = {"mean": 45.0, "sd": 0.0, "readings": readings}
        found += warnings.add(point, None, {**body(point, rng), "temperatures": {"humidity_pct": channel}})
    (warned,) = found
    assert warned.message.startswith("humidity_pct hangs: it has read 45.1 pct 10 times in a row")


def test_thermometers_are_told_of_as_rarely_as_was_promised():
    """A thermometer whose neighbouring readings are the same in one of four cases, 20 runs of 2,000 readings."""
    for seed in range(20):
        rng, test = random.Random(seed), StillTest(200, 1, "degC")
        assert not any(test.add([rng.randrange(4) for _ in range(10)]) for _ in range(200)), seed


def test_drift_is_told_at_repeated_settings():
    drift = {"now": 0.0}

    def spoil(_point):
        drift["now"] += 2e-6
        return lambda readings: [r + drift["now"] for r in readings]

    found = told(0, spoil)
    assert [w.cause for _, w in found] == ["drift"]
    assert "uV" in found[0][1].message


def test_false_alarms_of_each_test_are_as_rare_as_was_promised():
    """6000 points of each test alone; proving/statistics/early_warnings.py does it at length."""
    rng, runs, points = random.Random(7), 60, 100
    alarms = dict.fromkeys(("noise", "repeats", "previous"), 0)
    for _ in range(runs):
        tests = NoiseTest(points, 1, say), RepeatTest(points, 1, say), PreviousTest(points, 1, say)
        said = [
            tests[0].add(Number(0.0, statistics.variance(rng.gauss(0, 1) for _ in range(8)), 8)) for _ in range(points)
        ]
        alarms["noise"] += any(said)
        alarms["repeats"] += any(tests[1].add(i % 40, rng.gauss(0, 1)) for i in range(points))
        alarms["previous"] += any(tests[2].add(rng.gauss(0, 1), 1.0, 0.0, 0.0) for _ in range(points))
    assert sum(alarms.values()) <= 1, alarms


def test_a_calibration_allows_for_its_own_error():
    test = PreviousTest(1000, 3, say)
    assert not any(test.add(3.0, 0.1, 1.0, 4.0) for _ in range(50))
    test = PreviousTest(1000, 3, say)
    assert any(test.add(5.0, 0.1, 1.0, 4.0) for _ in range(50))


@pytest.mark.parametrize(
    ("unit", "value", "text"),
    [
        ("V", -3.37e-5, "-33.7 uV"),
        ("V", 1.322, "1.322 V"),
        ("mV", 0.012, "12 uV"),
        ("mV", 9.9, "9.9 mV"),
        ("A", 2.0, "2 A"),
    ],
)
def test_values_are_told_in_units_for_people(unit, value, text):
    assert in_unit(unit, value) == text


# --- in the controller -----------------------------------------------------------------------------------------


LONGER = PROCEDURE.model_copy(update={"replications": 4})


def dies(after):
    """From then on the sensor has noise about one number, whatever the head does."""

    def spoil(_bench, head, reader):
        reader.noise_V = 1e-4
        fetch = reader.fetch

        def dead():
            found = fetch()
            if reader.starts <= after:
                return found
            return {**found, "1": [0.3 + 1e-4 * (-1) ** i + 1e-6 * reader.starts for i in range(len(found["1"]))]}

        reader.fetch = dead

    return spoil


def warned(path):
    with RunReader.open(path) as reader:
        reader.verify()
        return [(record.session, warned.cause) for record, warned in warnings_of(reader)]


def first_warned(path):
    """The first warning; each is there once only."""
    found = warned(path)
    causes = [cause for _, cause in found]
    assert len(causes) == len(set(causes)), found
    return found[0]


def test_a_warning_is_in_the_run_file_and_stops_nothing(tmp_path):
    path = new_run(tmp_path, LONGER)
    outcome, state, *_ = run_session(path, procedure=LONGER, spoil=dies(20))
    assert outcome is Outcome.COMPLETE
    assert len(state.accepted) == state.points
    assert first_warned(path) == (1, "response")
    shown = rig("status", path)
    assert "warning: x_V reads" in shown.stdout
    assert "what its settings gave before" in json.loads(rig("status", path, "--json").stdout)["warnings"][0]


class Killed(BaseException):
    """Stands for SIGKILL."""


def test_what_was_said_is_not_said_again_by_the_next_session(tmp_path):
    path = new_run(tmp_path, LONGER)

    def on_progress(news):
        if news.done >= 28:
            raise Killed

    with pytest.raises(Killed):
        run_session(path, procedure=LONGER, spoil=dies(20), on_progress=on_progress)
    assert first_warned(path) == (1, "response")
    outcome, *_ = run_session(path, procedure=LONGER, spoil=dies(0))
    assert outcome is Outcome.COMPLETE
    assert first_warned(path) == (1, "response")


def test_the_next_session_knows_what_came_before_it(tmp_path):
    path = new_run(tmp_path, LONGER)

    def on_progress(news):
        if news.done >= 20:
            raise Killed

    with pytest.raises(Killed):
        run_session(path, procedure=LONGER, spoil=dies(99), on_progress=on_progress)
    run_session(path, procedure=LONGER, spoil=dies(0))
    assert first_warned(path) == (2, "response")


def test_a_run_holds_at_a_warning_where_the_procedure_asks_for_it_and_goes_on_when_released(tmp_path):
    procedure = LONGER.model_copy(update={"warnings": LONGER.warnings.model_copy(update={"hold": True})})
    path = new_run(tmp_path, procedure)
    held = []

    def on_progress(news):
        if news.state == "holding":
            held.append(news.done)
            raise Killed

    with pytest.raises(Killed):
        run_session(path, procedure=procedure, spoil=dies(20), on_progress=on_progress)
    with RunReader.open(path) as reader:
        kinds = [r.kind for r in reader.records()]
    assert kinds[-2:] == ["event", "hold"]
    assert held == [23]
    outcome, state, *_ = run_session(path, procedure=procedure, spoil=dies(20))
    assert outcome is Outcome.COMPLETE
    assert len(state.accepted) == state.points


def test_a_mistake_in_the_warnings_themselves_costs_the_warnings_and_not_the_night(tmp_path):
    path = new_run(tmp_path)
    with patch.object(EarlyWarnings, "_judged", side_effect=ZeroDivisionError("planted")):
        outcome, state, *_ = run_session(path)
    assert outcome is Outcome.COMPLETE
    assert len(state.accepted) == state.points
    assert warned(path) == [(1, "itself")]


def test_a_procedure_can_do_without(tmp_path):
    procedure = LONGER.model_copy(update={"warnings": LONGER.warnings.model_copy(update={"enabled": False})})
    path = new_run(tmp_path, procedure)
    run_session(path, procedure=procedure, spoil=dies(20))
    assert warned(path) == []


def test_readings_that_leave_the_last_calibration_are_told_and_it_is_kept_in_the_run_file(tmp_path):
    bench, world = LAB / "bench.toml", tmp_path / "first.toml"
    # Without what nobody declared: a calibration that drifts between two replications allows for anything.
    world.write_text((LAB / "world.toml").read_text().partition("# What nobody declared")[0])
    first = rig("run", write_short(tmp_path), "--bench", bench, "--dry", "--world", world, "--out", tmp_path / "runs")
    assert first.returncode == 0, first.stderr
    earlier = first.stdout.strip()
    assert rig("fit", earlier, "--out", tmp_path / "last.json").returncode == 0
    shifted = tmp_path / "world.toml"
    shifted.write_text(world.read_text().replace("offset_V = 0.0123", "offset_V = 0.0153"))
    again = write_short(tmp_path / "b", SHORT + '[warnings]\nagainst = "../last.json"\n')
    moved = rig("run", again, "--bench", bench, "--dry", "--world", shifted, "--out", tmp_path / "runs")
    assert re.search(r"warning: x_V has left its last calibration by [23]\.?\d* mV", moved.stderr), moved.stderr
    assert "y_V has left" not in moved.stderr
    assert "z_V has left" not in moved.stderr
    with RunReader.open(Path(moved.stdout.strip())) as reader:
        assert "previous.json" in reader.documents()
    missing = write_short(tmp_path / "c", SHORT + '[warnings]\nagainst = "none.json"\n')
    refused = rig("run", missing, "--bench", bench, "--dry", "--out", tmp_path / "runs")
    assert refused.returncode == 78
    assert f"{missing}: warnings.against = 'none.json': there is no file" in refused.stderr
