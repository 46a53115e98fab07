"""An angle of a dividing head as a factor of the kind general: hard to change, one of two, and easy."""

from __future__ import annotations

import itertools
import json

import general_lab as lab
import pytest
from command import rig
from general_lab import run_dry, written

from proving.night import checks
from proving.night.mishaps import Mishap
from proving.night.play import play
from proving.night.scenario import Scenario
from rig.engine.hard_factors import HardFactors
from rig.engine.session import Outcome
from rig.errors import ConfigurationError
from rig.run_file.events.bench import Fault
from rig.run_file.events.points import WholePlotBegan, WholePlotLost
from rig.run_file.read.reader import RunReader
from rig.run_file.verify.sense import judged
from rig.runs.plans import load_plan
from rig.tables.table_of_run import run_table

HEAD = """
[instruments.head]
driver = "newport-esp301"
address = "/dev/rig/head"
"""
BENCH = lab.SOURCE.replace("input_V = [-8, 8]", "input_V = [-8, 8]\npitch_deg = [-30, 30]\nroll_deg = [-30, 30]") + HEAD
WORLD = """seed = 2
[sensors.meter]
formula = "0.01 + 0.2*pitch_deg + 0.1*input_V + seat"
noise = 1e-6
[draws.seat]
of = "pitch_deg"
sd = 0.003
[sources.input_V]
time_constant_s = 0.3
"""
PROCEDURE = """kind = "general"
name = "level"
seed = 1
replications = REPLICATIONS
[factors.input_V]
levels = [-5, 5]
[factors.pitch_deg]
levels = [-10, 0, 10]
hard = true
band = 0.002
overtravel = 1
[settle]
dwell_s = 3
[model]
formula = "1 + input_V + pitch_deg"
[recovery]
continue_gap_s = 600
"""
BRIEF = PROCEDURE.replace("REPLICATIONS", "1")


def events(path, kind):
    with RunReader.open(path) as reader:
        reader.verify()
        return [r.event for r in reader.records() if isinstance(r.event, kind)]


def began(path):
    return [event.settings["pitch_deg"] for event in events(path, WholePlotBegan)]


def night(folder, *mishaps, gap_s=2.0, faults="", procedure=BRIEF, bench=BENCH, world=WORLD):
    """A night of this laboratory: its run file, and what does not hold."""
    folder.mkdir(exist_ok=True)
    documents = {"bench.toml": bench, "procedure.toml": procedure, "world.toml": world + faults}
    played = play(Scenario(1, "level", documents, mishaps, (gap_s,) * 20, 1000), folder)
    try:
        return played, checks.judge(played)
    finally:
        played.bench.close()


def test_two_files_make_a_laboratory_whose_hard_factor_is_an_angle(tmp_path):
    procedure, bench, _ = written(tmp_path, PROCEDURE.replace("REPLICATIONS", "2"), BENCH, WORLD)
    told = rig("plan", procedure, "--bench", bench).stdout
    assert "12 points, 6 whole plots" in told
    assert "s to set each further one" in told
    path, result = run_dry(tmp_path, PROCEDURE.replace("REPLICATIONS", "2"), BENCH, WORLD)
    assert result.outcome is Outcome.COMPLETE, result.message
    with RunReader.open(path) as reader:
        assert judged(reader, 9).findings == ()
    fitted = json.loads(rig("fit", path, "--json").stdout)
    assert fitted["sigma_wholeplot"] == pytest.approx(0.003, rel=0.6)
    assert fitted["sigma_subplot"] < 2e-5
    assert fitted["coefficients"]["pitch_deg"]["df"] == pytest.approx(4)
    table = run_table(path).columns
    plots = began(path)
    assert len(plots) == 6
    first = next(iter(events(path, WholePlotBegan))).approach["pitch"][0]
    ways = [first, *(1 if b > a else -1 for a, b in itertools.pairwise(plots))]
    sides = dict(zip(table["whole_plot"].tolist(), table["pitch_side"].tolist(), strict=True))
    assert [sides[number] for number in range(1, 7)] == ways
    for event, side in zip(events(path, WholePlotBegan), ways, strict=True):
        came, start = event.approach["pitch"]
        assert not side or (came == side and side * (event.settings["pitch_deg"] - start) >= 0.9)


@pytest.mark.parametrize(("gap_s", "lost"), [(2.0, []), (700.0, ["left alone for 12 min"])])
def test_after_a_kill_the_angle_is_verified_and_measured_again_after_a_longer_time(tmp_path, gap_s, lost):
    played, wrong = night(tmp_path, Mishap(52.0, "kill", {}), gap_s=gap_s)
    assert (wrong, len(played.sessions)) == ([], 2)
    assert [event.reason[:21] for event in events(played.path, WholePlotLost)] == lost
    assert began(played.path) == ([0, 10, -10] if not lost else [0, 10, 10, -10])


MOVED = '[[faults]]\nkind = "slip"\non = "head"\nat_s = 60\naxis = "pitch"\namount_deg = 0.5\nencoder = "sees"\n'
STALLED = '[[faults]]\nkind = "stall"\non = "head"\nat_s = 31\nfor_s = 30\naxis = "pitch"\n'
OFF = '[[faults]]\nkind = "drive-fault"\non = "head"\nat_s = 52\naxis = "roll"\n'


@pytest.mark.parametrize(
    ("mishaps", "faults", "why"),
    [
        ((Mishap(52.0, "kill", {}),), MOVED, "pitch is at"),
        ((), MOVED.replace("60", "52"), "pitch is at"),
        ((Mishap(52.0, "power-cut", {}),), "", "machine was restarted"),
        ((), OFF, "homed again"),
    ],
)
def test_an_angle_that_does_not_stand_any_more_is_set_anew_from_its_planned_side(tmp_path, mishaps, faults, why):
    played, wrong = night(tmp_path, *mishaps, gap_s=30.0, faults=faults)
    assert wrong == []
    (lost,) = events(played.path, WholePlotLost)
    assert why in lost.reason
    assert began(played.path) == [0, 10, 10, -10]


def test_a_head_that_stalls_on_the_way_to_a_whole_plot_is_not_taken_to_have_arrived(tmp_path):
    procedure = BRIEF + '[faults]\nsoak = ["retry 10", "abort"]\n'
    played, wrong = night(tmp_path, faults=STALLED, procedure=procedure)
    assert wrong == []
    (fault,) = events(played.path, Fault)
    assert fault.evidence["pitch"]["outcome"] == "timed-out"
    assert began(played.path) == [0, 10, -10]


def test_the_checks_of_nights_see_an_angle_that_is_assumed_after_a_kill(tmp_path, monkeypatch):
    monkeypatch.setattr(HardFactors, "out_of_place", lambda *_: "")
    _, wrong = night(tmp_path, Mishap(52.0, "kill", {}), gap_s=30.0, faults=MOVED)
    assert {violation.invariant for violation in wrong} >= {"one stay", "verifies"}


def test_one_angle_is_hard_and_the_other_easy(tmp_path):
    procedure = BRIEF.replace("input_V", "roll_deg").replace("[factors.roll_deg]", "[factors.roll_deg]\nband = 0.002")
    bench = BENCH.replace("[factors]\n", '[factors]\npitch_deg = "head"\nroll_deg = "head"\n')
    world = WORLD.replace("0.1*input_V", "0.1*roll_deg + 0.004*roll_side")
    path, result = run_dry(tmp_path, procedure, bench, world)
    assert result.outcome is Outcome.COMPLETE, result.message
    with RunReader.open(path) as reader:
        assert judged(reader, 9).findings == ()
    table = run_table(path).columns
    seat = table["meter_V"] - 0.01 - 0.2 * table["pitch_deg"] - 0.1 * table["roll_deg"] - 0.004 * table["roll_side"]
    for number in (1, 2, 3):
        here = seat[table["whole_plot"] == number]
        assert len(here) == 2


def test_only_its_own_angles_are_a_heads(tmp_path):
    bench = BENCH.replace("[factors]\n", '[factors]\ntilt_deg = "head"\n')
    procedure, bench, _ = written(tmp_path, BRIEF.replace("pitch_deg", "tilt_deg"), bench)
    with pytest.raises(ConfigurationError, match="head is a head, and tilt_deg none of its angles"):
        load_plan(procedure, bench)


OVEN = BENCH.replace('input_V = "calibrator"', 'input_V = "calibrator"\nbox_degC = "oven"') + lab.CHAMBER
OVEN_PROCEDURE = (
    BRIEF.replace("hard = true", 'order = "up-down"')
    .replace("input_V", "box_degC")
    .replace("levels = [-5, 5]", "levels = [20, 30]\nhard = true")
    .replace("[settle]", "[soak]\ndwell_s = 30\ndrift_degC_per_h = 20\npoll_s = 58\n[settle]")
)


def test_a_temperature_that_stands_goes_on_when_the_head_is_homed_again(tmp_path):
    world = WORLD.replace("0.1*input_V + seat", "0.1*box_degC").replace(
        '[draws.seat]\nof = "pitch_deg"\nsd = 0.003\n', ""
    )
    faults = OFF.replace("at_s = 52", "at_s = 1275")
    played, wrong = night(tmp_path, faults=faults, procedure=OVEN_PROCEDURE, bench=OVEN, world=world)
    assert wrong == []
    assert [event.planned for event in events(played.path, WholePlotBegan)] == [1, 2]


def test_an_angle_that_stands_where_it_is_parked_is_not_commanded_again(tmp_path):
    played, wrong = night(tmp_path, Mishap(24.0, "stop", {}))
    assert (wrong, [ended.how for ended in played.sessions]) == ([], ["stopped", "complete"])
    assert began(played.path) == [0, 10, -10]
