"""Somebody changes a twin at its panel while a dry run measures: what is told, what is not used, and how it goes on.

Readings since the last good answer are not used. A setting is made again, and the point, or its whole plot, is measured
again.
"""

from __future__ import annotations

from unittest.mock import patch

import pytest
from command import rig
from dry import LAB as ATTITUDE
from dry import SHORT as ANGLES
from dry_pressure import LAB as PRESSURE
from dry_pressure import SHORT as PRESSURES
from few_points import accepted, records

from rig.engine.session import Outcome, Signals
from rig.run_file.read.reader import RunReader
from rig.run_file.verify.sense import judged
from rig.runs.controller import start_run
from rig.runs.plans import load_plan
from rig.simulated import dry_run

ANGLES = ANGLES.replace("replications = 2", "replications = 1").replace("[-120, 0, 120]", "[-120, 120]")
PRESSURES = PRESSURES.replace("[[10, 20], [20, 10], [20, 30], [30, 20], [15, 15]]", "[[10, 20], [20, 10], [20, 30]]")
PRESSURES = PRESSURES.replace("1 + P + T_sensor + T_SSE", "1 + P")
CIA402 = 'driver = "cia402-pair"\naddress = "can:socketcan/can1"'


@pytest.fixture
def night(tmp_path):
    def run(text, lab, change, *, bench_text="", state="measuring", done=4):
        (tmp_path / "procedure.toml").write_text(text)
        bench = tmp_path / "bench.toml"
        bench.write_text(bench_text or (lab / "bench.toml").read_text())
        plan = load_plan(tmp_path / "procedure.toml", bench, dry=True, world=lab / "world.toml")
        paths, twins, changed = [], [], []
        original = dry_run.DryBench.__init__

        def kept(self, *args, **kwargs):
            original(self, *args, **kwargs)
            twins.append(self.sim.twin)

        def on_progress(news):
            if not changed and news.state == state and news.done == done:
                changed.append(news.state)
                change(twins[-1])

        with patch.object(dry_run.DryBench, "__init__", kept):
            result = start_run(plan, tmp_path, signals=Signals(), announce=paths.append, on_progress=on_progress)
        assert changed
        with RunReader.open(paths[0]) as reader:
            assert [str(one) for one in judged(reader, 100).findings] == []
        return result, paths[0]

    return run


def told(path):
    return [r.data["message"] for r in records(path, "fault")]


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("setpoint", 24.0, "setpoint reads 24 degC, not 23 degC"),
        ("mode", "off", "mode reads off, not auto"),
    ],
)
def test_an_enclosure_that_somebody_sets_or_switches_off_is_told_and_settles_again(night, name, value, said):
    result, path = night(ANGLES, ATTITUDE, lambda twin: twin("enclosure").set_at_panel(name, value))
    assert result.outcome is Outcome.COMPLETE, result.message
    (message,) = told(path)
    assert said in message
    assert len(records(path, "event", "environment-settled")) == 2
    for record in accepted(path):
        (chamber,) = record.data["environment"].values()
        assert (chamber["setpoint_degC"], chamber["running"]) == (pytest.approx(23.0, abs=1e-4), True)


def test_a_profile_that_somebody_starts_ends_the_run_with_what_to_do(night):
    result, path = night(ANGLES, ATTITUDE, lambda twin: twin("enclosure").set_at_panel("profile_state", "running"))
    assert result.outcome is Outcome.FAULT
    assert "its profile is running, and sets the setpoint; end it at its panel" in result.message
    assert len(accepted(path)) == 4


def test_a_chamber_of_a_whole_plot_that_somebody_sets_loses_the_whole_plot(night):
    result, path = night(PRESSURES, PRESSURE, lambda twin: twin("sse_chamber").set_at_panel("setpoint", 15.0), done=6)
    assert result.outcome is Outcome.COMPLETE, result.message
    assert "setpoint reads 15 degC, not" in told(path)[0]
    (lost,) = records(path, "event", "whole-plot-lost")
    assert "sse_chamber is set to 15 degC, not to" in lost.data["reason"]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda supply: supply.set_unit("BAR"), ":UNIT:PRES? answers BAR, not PSI"),
        (lambda supply: supply.set_setpoint("1.7"), ":SOUR:PRES? answers 1.7000000, not"),
        (lambda supply: supply.set_band("1"), ":SOUR:PRES:INL? answers 1.0000000, not 0.01"),
    ],
)
def test_a_pressure_controller_that_somebody_changes_is_set_again(night, change, said):
    result, path = night(PRESSURES, PRESSURE, lambda twin: change(twin("supply")), done=6)
    assert result.outcome is Outcome.COMPLETE, result.message
    (message,) = told(path)
    assert said in message
    assert not records(path, "event", "whole-plot-lost")
    run_list = [r.run_index for r in accepted(path)]
    assert sorted(run_list) == list(range(15))


def test_drives_that_another_tool_changes_are_set_again(night):
    text = (ATTITUDE / "bench.toml").read_text()
    text = text.replace('driver = "newport-esp301"\naddress = "/dev/rig/head"', CIA402)
    assert CIA402 in text
    change = lambda twin: twin("head").drives["roll"].write(0x6067, 0, (360).to_bytes(4, "little"))  # noqa: E731
    result, path = night(ANGLES, ATTITUDE, change, bench_text=text)
    assert result.outcome is Outcome.COMPLETE, result.message
    (message,) = told(path)
    assert "roll: 6067h:00 reads 360, not" in message


@pytest.mark.parametrize("driver", ["newport-esp301", "cia402-pair"])
def test_a_motor_that_somebody_switches_off_during_the_readings_is_told(night, driver):
    """The angle may stand all the same; nobody knows, and the point is measured again."""
    text = (ATTITUDE / "bench.toml").read_text()
    if driver == "cia402-pair":
        text = text.replace('driver = "newport-esp301"\naddress = "/dev/rig/head"', CIA402)

    def off(twin):
        if driver == "cia402-pair":
            twin("head").drives["roll"].write(0x6040, 0, (6).to_bytes(2, "little"))
        else:
            twin("head")._axes[2].powered = False

    result, path = night(ANGLES, ATTITUDE, off, bench_text=text, state="recording")
    assert result.outcome is Outcome.COMPLETE, result.message
    assert "control is off; was it switched off, or without power?" in told(path)[0]


def test_a_unit_that_cannot_be_asked_is_named_before_the_run(tmp_path):
    """The CAN unit's protocol has no question about its settings; plan and doctor say so."""
    (tmp_path / "procedure.toml").write_text(PRESSURES)
    words = "daq: nothing can be asked that tells whether somebody has changed its settings"
    planned = rig("plan", tmp_path / "procedure.toml", "--bench", PRESSURE / "bench.toml")
    assert words in " ".join(planned.stdout.split())
    looked = rig("doctor", "--bench", PRESSURE / "bench.toml", "--dry")
    assert words.replace("daq: ", "") in " ".join(looked.stdout.split())
