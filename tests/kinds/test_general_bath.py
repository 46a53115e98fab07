"""A bath that takes time: forecasts, the time left with a person in between, where it starts, a thermometer in it."""

from __future__ import annotations

import itertools

import few_points
import general_lab as lab
import pytest
from command import rig
from general_lab import written

from proving.forger import forge
from rig.bench.config import parse_bench
from rig.engine.session import Outcome, Signals
from rig.errors import ConfigurationError, RigError
from rig.run_file.read.reader import RunReader
from rig.run_file.verify.sense import judged
from rig.run_file.verify.verification import verify_file
from rig.runs.controller import start_run
from rig.runs.forecast import rehearse
from rig.runs.plans import load_plan
from rig.tables.table_of_run import run_table

SLOW = lab.BATH.replace("dwell_s = 60\n", "dwell_s = 60\ntime_constant_s = 120\n")
THERMOMETER = """
[instruments.scanner]
driver = "keysight-34970a"
address = "/dev/rig/scanner"
nplc = 10
channels = { "101" = "rtd-4w-385" }
[temperatures.NAME]
reader = "scanner"
channel = "101"
"""
NO_STANDARD = (
    lab.BATH.split("[references")[0].replace(', "103"="volts"', "").replace("/dev/rig/scanner", "/dev/rig/bridge")
    + '[factors]\nbath_degC = "bath"\n[limits]\nbath_degC = [10, 110]\n'
)
WARM = (
    lab.BATH_PROCEDURE.replace("[0,25,50,75,100]", "[15,35]")
    .replace("replications=2", "replications=1")
    .replace("+bath_degC^2", "")
    .replace("[soak]", "[soak]\npoll_s = 60")
)
REFERENCE = '[references.bath_degC]\nformula = "0.1 + 0.00039*bath_degC"\nnoise = 1e-7\n'
WARM_WORLD = lab.BATH_WORLD.replace(REFERENCE, "")


def made(plan, folder, told=lambda _: None):
    paths = []
    result = start_run(plan, folder, signals=Signals(), announce=paths.append, on_progress=told)
    assert result.outcome is Outcome.COMPLETE, result.message
    return paths[0]


def test_a_rehearsed_bath_takes_the_time_that_the_bench_file_says(tmp_path):
    procedure, bench, world = written(tmp_path, WARM, SLOW, lab.BATH_WORLD)
    end = []
    made(load_plan(procedure, bench, dry=True, world=world), tmp_path, lambda news: end.append(news.elapsed_s))
    forecast = rehearse(load_plan(procedure, bench), lambda _: None)
    assert forecast.total_s == pytest.approx(end[-1], rel=0.03)
    assert forecast.assumed == ()


def test_a_bath_of_unknown_speed_is_assumed_to_be_slow_and_this_is_said(tmp_path):
    known, unknown = (
        rehearse(load_plan(*written(tmp_path, WARM, bench)[:2]), lambda _: None) for bench in (SLOW, lab.BATH)
    )
    assert unknown.total_s > 1.5 * known.total_s
    assert unknown.assumed == (
        "assumed: bath approaches its setting with a time constant of 480 s; instruments.bath.time_constant_s in the "
        "bench file says better",
    )


def test_the_advice_of_a_plan_about_a_thermometer_can_be_followed(tmp_path):
    slow = NO_STANDARD + THERMOMETER.replace("NAME", "bath_degC") + "follows_s = 1500\n"
    files = written(tmp_path, WARM, slow)
    done = rig("plan", files[0], "--bench", files[1])
    assert done.returncode == 0, done.stderr
    assert "assumed" not in done.stdout


def test_the_time_left_does_not_rise_when_a_person_comes_before_a_soak(tmp_path):
    steps = '[[by_hand]]\nbefore_whole_plot = {}\nsay = "bleed the run"\nchange = "bled"\n'
    procedure = WARM.replace("[15,35]", "[15,35,55,75]") + "".join(map(steps.format, range(1, 5)))
    files = written(tmp_path, procedure, SLOW, lab.BATH_WORLD + "[person]\nafter_s = 300\n")
    news = []
    made(load_plan(files[0], files[1], dry=True, world=files[2]), tmp_path, lambda one: news.append(one.remaining_s))
    left = [one for one in news if one is not None]
    assert len(left) > 10
    assert max(b - a for a, b in itertools.pairwise(left)) < 600, "at most what a soak was better or worse"


def test_a_bath_starts_at_the_laboratory_and_its_limits_can_be_real(tmp_path):
    files = written(tmp_path, WARM, NO_STANDARD, WARM_WORLD)
    made(load_plan(files[0], files[1], dry=True, world=files[2]), tmp_path)
    cold = WARM_WORLD.replace("time_constant_s = 120", "time_constant_s = 120\nrest = 4")
    files = written(tmp_path, WARM, NO_STANDARD, cold)
    done = rig("run", files[0], "--bench", files[1], "--dry", "--world", files[2], "--out", tmp_path / "cold")
    assert done.returncode != 0
    assert "bath is at 4.00 degC, outside 10 to 110; look at bath, then resume" in " ".join(done.stderr.split())


def test_a_second_thermometer_in_the_bath_reads_the_bath(tmp_path):
    bench = NO_STANDARD + THERMOMETER.replace("NAME", "inlet_degC") + 'place = "bath_degC"\n'
    files = written(tmp_path, WARM, bench, WARM_WORLD)
    columns = run_table(made(load_plan(files[0], files[1], dry=True, world=files[2]), tmp_path)).columns
    assert columns["inlet_degC"] == pytest.approx(1.001 * columns["bath_set_degC"] - 0.03, abs=0.1)
    with pytest.raises(ConfigurationError, match=r"place = 'tank_degC' is unknown; known: package, .*, lab, bath_degC"):
        parse_bench(bench.replace('place = "bath_degC"', 'place = "tank_degC"'), "bench.toml")


def test_limits_without_the_value_at_rest_are_said_to_need_it(tmp_path):
    """The simulated bath stands at room temperature before anything is set."""
    bench = SLOW.replace("bath_degC = [-20, 140]", "bath_degC = [40, 140]")
    assert bench != SLOW
    procedure, bench_file, _ = written(tmp_path, WARM.replace("[15,35]", "[50,60]"), bench, lab.BATH_WORLD)
    with pytest.raises(RigError, match="nothing had been set yet: the limits have to include the value at rest"):
        rehearse(load_plan(procedure, bench_file), lambda _: None)


IN_A_BOX = f"""name = "a box"
{lab.DVM}{lab.CHAMBER}{THERMOMETER.replace("NAME", "air_degC")}place = "bath_degC"
follows_s = 900
[sensors.cell]
reader = "dvm"
unit = "mV"
[factors]
bath_degC = "oven"
[limits]
bath_degC = [-60, 100]
"""
SOAKED = """kind = "general"
name = "a box"
seed = 1
[factors.bath_degC]
levels = [10, 40]
hard = true
[soak]
dwell_s = 600
[measure]
readings = 2
[model]
formula = "1 + bath_degC"
"""
BOX_WORLD = """seed = 2
[sensors.cell]
formula = "100 + 10*bath_degC"
[sensor_chamber]
body_time_constant_s = 900
"""


def test_a_soak_waits_for_a_thermometer_whose_place_is_its_factor(tmp_path):
    files = written(tmp_path, SOAKED, IN_A_BOX, BOX_WORLD)
    path = made(load_plan(files[0], files[1], dry=True, world=files[2]), tmp_path)
    began = few_points.records(path, status="whole-plot")
    assert len(began) == 2
    for one in began:
        assert one.event.settling["air_degC"]["outcome"] == "settled"
    with RunReader.open(path) as reader:
        assert judged(reader, 10).findings == (), "its drift too was as asked for"

    def without(*ordinals):
        def change(run):
            for at, one in enumerate(run.all("event", "whole-plot")):
                if at in ordinals:
                    del one["body"]["settling"]["air_degC"]

        return [str(one) for one in verify_file(forge(path, tmp_path / "changed.sqlite", change)).findings]

    assert without(0, 1) == [], "as runs of 2026-11-24 and before are: no soak waited for it"
    (found,) = without(1)
    assert "does not say how air_degC settled" in found


def test_the_assumption_about_a_soak_names_the_key_that_removes_it(tmp_path):
    unsaid = IN_A_BOX.replace("follows_s = 900\n", "")
    without = unsaid.replace('place = "bath_degC"\n', "")

    def assumed(bench):
        return rehearse(load_plan(*written(tmp_path, SOAKED, bench)[:2]), lambda _: None).assumed

    assert assumed(IN_A_BOX) == ()
    (one,) = assumed(unsaid)
    assert one.endswith("; temperatures.air_degC.follows_s in the bench file says better")
    (one,) = assumed(without)
    assert 'temperatures.NAME.follows_s, of a thermometer with place = "bath_degC", in the bench file' in one
