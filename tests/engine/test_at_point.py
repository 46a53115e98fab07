"""What is done at a point: how it is reached, what is written down of it, what ends or disturbs it."""

from __future__ import annotations

import ideal_pressure_bench as pressure
import pytest
from few_points import (
    FIRST_LEGS,
    LEGS,
    PARKED,
    POINTS,
    Killed,
    accepted,
    attitude,
    kill_where,
    records,
    run,
    run_whole_plots,
    whole_plot,
)
from ideal_bench import PROCEDURE, new_run, run_session
from test_policies import in_an_enclosure

from rig.drivers.errors import NoReply
from rig.engine.early_warning import EarlyWarnings, Warned
from rig.engine.session import Outcome
from rig.run_file.write.writer import RunWriter


def test_an_observation_says_how_the_point_was_reached_read_and_found(tmp_path):
    path, head = run(tmp_path)
    assert head.sent == [*LEGS, PARKED]
    seen = [r.data for r in accepted(path)]
    parts = [
        "approach",
        "readback",
        "settling",
        "moved",
        "measured_s",
        "environment",
        "outputs",
        "temperatures",
        "taken_s",
        "flags",
    ]
    assert [list(data) for data in seen] == [parts] * POINTS
    assert [data["approach"]["roll"] for data in seen] == [[1, -2.0], [1, 0.0], [-1, 92.0], [-1, 90.0]]
    assert [data["readback"] for data in seen][2] == {"pitch_deg": 30.0, "roll_deg": 90.0}
    for data in seen:
        began, ended = data["measured_s"]
        assert ended - began == 2.0
        assert {axis: s["outcome"] for axis, s in data["settling"].items()} == {"pitch": "settled", "roll": "settled"}
    assert seen[0]["measured_s"][0] == 5.0
    assert [r.data for r in records(path, "fault")] == []


def test_a_point_read_over_a_hole_in_time_is_kept_as_rejected(tmp_path):
    def spoil(bench, _head, reader):
        fetch = reader.fetch

        def fetch_late():
            if reader.starts == 2:
                bench.clock.sleep(60.0)  # nobody waits for it: time in which the controller had no turn
            return fetch()

        reader.fetch = fetch_late

    path, _ = run(tmp_path, spoil=spoil)
    (rejected,) = records(path, "observation", "rejected")
    seen = accepted(path)
    assert rejected.run_index == 1
    assert set(rejected.data) == {*seen[1].data, "hole_s"}
    assert rejected.data["hole_s"] == pytest.approx(60.0, abs=1.0)
    assert [r.attempt for r in seen] == [1, 2, 1, 1]


def test_after_a_fault_of_an_instrument_the_way_begins_at_the_point_before(tmp_path):
    """Two failures running: the way back is planned anew each time."""

    def spoil(_bench, _head, reader):
        fetch, failures = reader.fetch, iter((False, True, True, False))

        def fetch_or_fail():
            if next(failures, False):
                raise NoReply("dvm is silent")
            return fetch()

        reader.fetch = fetch_or_fail

    path, head = run(tmp_path, spoil=spoil)
    again = [*FIRST_LEGS, {"roll": 90.0}]
    assert head.sent == [*again, *again, *again, *LEGS[3:], PARKED]
    assert [r.attempt for r in accepted(path)] == [1, 3, 1, 1]


def turning_at(leg, roll):
    """Once, roll turns elsewhere than where a leg sends it."""

    def spoil(_bench, head, _reader):
        move, turned = head.move, []

        def move_and_turn(targets):
            move(targets)
            if targets == leg and not turned:
                turned.append(targets)
                head._to = {**head._to, "roll": roll}

        head.move = move_and_turn

    return spoil


@pytest.mark.parametrize(
    ("leg", "roll", "says"),
    [
        (3, 91.5, "roll arrived from 91.5, nearer than its overtravel: did it slip?"),
        (3, 90.0, "roll did not arrive from its planned side"),
        (3, 89.0, "roll did not arrive from its planned side"),
        (3, 91.9, ""),
        (0, -1.75, "roll arrived from -1.75, nearer than its overtravel: did it slip?"),
        (0, -1.8, ""),
    ],
)
def test_an_axis_that_did_not_come_as_planned_is_told_with_what_was_seen(tmp_path, leg, roll, says):
    path, _ = run(tmp_path, spoil=turning_at(LEGS[leg], roll))
    found = [(r.run_index, r.data["fault"], r.data["message"]) for r in records(path, "fault")]
    assert found == ([(2 if leg else 0, "not_settled", says)] if says else [])
    for fault in records(path, "fault"):
        assert {axis: s["outcome"] for axis, s in fault.data["evidence"].items()} == {
            "pitch": "settled", "roll": "settled",
        }  # fmt: skip


@pytest.mark.parametrize(
    ("axis", "bands", "leaves"), [("pitch", 1.5, True), ("roll", -1.5, True), ("roll", 1.0, False)]
)
def test_an_axis_that_left_its_band_is_told_with_what_was_seen(tmp_path, axis, bands, leaves):
    def creep(_bench, head, reader):
        fetch = reader.fetch

        def fetch_and_creep():
            readings = fetch()
            if reader.starts == 1:
                head._from = {**head._to, axis: head._to[axis] + bands * PROCEDURE.settle.band_deg}
                head._to = dict(head._from)
            return readings

        reader.fetch = fetch_and_creep

    path, _ = run(tmp_path, spoil=creep)
    found = [(r.run_index, r.data["message"], list(r.data["evidence"])) for r in records(path, "fault")]
    assert found == [(0, f"{axis} left its band while it was measured", ["pitch", "roll"])] * leaves


@pytest.mark.parametrize(("timeout_s", "most_s"), [(700.0, 700.0), (100.0, 600.0)])
def test_a_move_may_take_as_long_as_settling_and_ten_minutes_at_least(tmp_path, timeout_s, most_s):
    def stuck(_bench, head, _reader):
        read, stop, stopped = head.read, head.stop, []

        def never_still():
            moving = len(head.sent) == 3 and True not in stopped
            return {axis: state._replace(moving=state.moving or moving) for axis, state in read().items()}

        def stop_it():
            stopped.append(len(head.sent) == 3)
            stop()

        head.read, head.stop = never_still, stop_it

    path, _ = run(tmp_path, attitude(settle={"dwell_s": 1.0, "timeout_s": timeout_s}), spoil=stuck)
    (fault,) = records(path, "fault")
    assert fault.data["message"].startswith(f"moving took longer than {most_s:g} s")


# --- the enclosure --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("off", "left"), [(0.5, False), (-0.5, False), (0.75, True), (-0.75, True)])
@pytest.mark.parametrize("policy", ["accept", "retry"])
def test_an_enclosure_that_left_its_tolerance_is_told_with_both_figures(tmp_path, monkeypatch, off, left, policy):
    faults = {"temperature_left": [policy]}
    box, procedure = in_an_enclosure(monkeypatch, attitude(faults=faults), tolerance_degC=0.5)
    procedure = procedure.model_copy(update={"recovery": attitude().recovery})
    path = new_run(tmp_path, procedure)

    def on_progress(news):
        box.offset = off if news.state == "recording" and news.done == 1 and not records(path, "fault") else 0.0

    outcome, _, _, message = run_session(path, procedure=procedure, on_progress=on_progress)
    assert outcome is Outcome.COMPLETE, message
    words = f"box is at {25 + off:.2f} degC, not within 0.5 of 25"
    found = [(r.run_index, r.status, r.data["fault"], r.data["message"]) for r in records(path, "fault")]
    assert found == [(1, "retry", "temperature_left", words)] * (left and policy == "retry")
    flagged = [["temperature"] * (left and policy == "accept" and index == 1) for index in range(POINTS)]
    assert [r.data["flags"] for r in accepted(path)] == flagged


# --- warnings -------------------------------------------------------------------------------------------------


@pytest.fixture
def warning(monkeypatch):
    """Warns of the second observation of a run; what the warnings were asked, as (point, whole plot, body)."""
    asked = []

    def add(_self, point, number, body):
        asked.append((point.index, number, body))
        return [Warned("drift", "x_V", "it drifts"), Warned("noise", "x_V", "it is loud")] * (len(asked) == 2)

    monkeypatch.setattr(EarlyWarnings, "add", add)
    return asked


def test_warnings_are_given_every_observation_and_what_they_say_is_written_down(tmp_path, warning):
    path, _ = run(tmp_path)
    assert [(index, number) for index, number, _ in warning] == [(i, None) for i in range(POINTS)]
    assert [set(body) for *_, body in warning] == [set(r.data) for r in accepted(path)]
    said = records(path, "event", "warning")
    assert [(r.run_index, r.data) for r in said] == [
        (1, {"cause": "drift", "output": "x_V", "message": "it drifts"}),
        (1, {"cause": "noise", "output": "x_V", "message": "it is loud"}),
    ]
    assert records(path, "hold") == []


def test_where_the_procedure_asks_for_it_a_warning_stops_motion_and_holds(tmp_path, warning):
    procedure, heads, told = attitude(warnings={"hold": True}), [], []

    def spoil(_bench, head, _reader):
        stop = head.stop
        head.stop = lambda: (told.append("stop"), stop())
        heads.append(head)

    path = new_run(tmp_path, procedure)
    with pytest.raises(Killed):
        run_session(
            path, procedure=procedure, spoil=spoil, on_progress=kill_where(lambda news: news.state == "holding")
        )
    held = records(path)[-1]
    assert (held.kind, held.run_index) == ("hold", 1)
    assert held.data == {"why": "a warning, and the procedure asks to hold at one"}
    assert heads[0].sent == LEGS[:3]
    assert len(warning) == 2
    assert told[-2:] == ["stop", "stop"], "for the hold, and for the safe state"
    outcome, *_ = run_session(path, procedure=procedure)
    assert outcome is Outcome.COMPLETE
    assert len(accepted(path)) == POINTS


def test_without_warnings_nothing_is_held(tmp_path):
    run(tmp_path, attitude(warnings={"hold": True}))
    (tmp_path / "without").mkdir()
    path, _ = run(tmp_path / "without", attitude(warnings={"enabled": False, "hold": True}))
    assert records(path, "hold") == []


# --- whole plots ----------------------------------------------------------------------------------------------


def test_the_first_point_of_a_whole_plot_is_reached_without_what_was_set_in_the_one_before(tmp_path, warning):
    procedure, bench = whole_plot([[-60, 0], [-50, 10]]), pressure.PressureBench()
    assert [(p.setpoints[0], p.sides[0]) for p in procedure.expand().points] == [(1, 0), (2.5, 1), (2.5, -1), (1, -1)]
    run_whole_plots(tmp_path, procedure, bench)
    vented = [14.7, 14.7]
    assert bench.supply.sent == [1.0, 2.5, 2.55, 2.5, 1.0, *vented]
    assert [(index, number) for index, number, _ in warning] == [(0, 1), (1, 1), (2, 2), (3, 2)], "warnings know it"


def test_a_reading_that_lost_its_whole_plot_is_durable_together_with_the_loss(tmp_path, monkeypatch):
    append, appended = RunWriter.append, []

    def noted(self, record, *, commit=True):
        appended.append((record.kind, record.status, commit))
        append(self, record, commit=commit)

    monkeypatch.setattr(RunWriter, "append", noted)
    procedure, bench = whole_plot(), pressure.PressureBench()
    moved = []

    def on_progress(news):
        if news.state == "recording" and news.done == 1 and not moved:
            moved.append(True)
            bench.cold_box.offset = 1.0
        elif news.state == "preparing":
            bench.cold_box.offset = 0.0

    path = run_whole_plots(tmp_path, procedure, bench, on_progress=on_progress)
    (rejected,) = records(path, "observation", "rejected")
    assert rejected.run_index == 1
    assert "cold_box" in rejected.data["lost"]
    at = appended.index(("observation", "rejected", False))
    assert appended[at + 1] == ("event", "whole-plot-lost", True)
