"""What is done at a point, on runs of a few points: what is judged by which limit, in which words, and what is kept."""

from __future__ import annotations

from dataclasses import replace

import ideal_pressure_bench as pressure
import pytest
from ideal_bench import PROCEDURE, new_run, run_session

from drivers.errors import NoReply
from procedures import PitchRollProcedure, WholePlotProcedure
from rig.engine.early_warning import EarlyWarnings, Warned
from rig.engine.measuring import Channel, Observation
from rig.engine.session import Outcome
from rig.run_file.reader import RunReader
from rig.run_file.writer import RunWriter

MOST_MV = 0.02
POINTS = 4
FIRST_LEGS = [{"pitch": -32.0, "roll": -2.0}, {"pitch": -30.0, "roll": 0.0}]
LEGS = [*FIRST_LEGS, {"roll": 90.0}, {"roll": 92.0}, {"pitch": 30.0, "roll": 90.0}, {"roll": 0.0}]
PARKED = {"pitch": 0.0, "roll": 0.0}


def attitude(**more):
    """Four points: pitch -30, -30, 30, 30 deg and roll 0, 90, 90, 0 deg."""
    design = {"type": "D", "pitch_deg": [-30, 30], "roll_deg": [0, 90]}
    values = PROCEDURE.model_dump(exclude_unset=True) | {"replications": 1, "design": design} | more
    return PitchRollProcedure.model_validate(values)


def whole_plot(temperatures=((-60, 0),), pressures=(1.0, 2.5), **more):
    """Whole plots of few pressures, at which two readings are to scatter by no more than 0.02 mV."""
    design = {
        "type": "list",
        "temperatures_degC": list(temperatures),
        "pressures_psia": list(pressures),
        "repeated_psia": [],
    }
    measure = {"readings": 2, "max_sd_mV": MOST_MV, "repeats": 0}
    values = pressure.PROCEDURE.model_dump(exclude_unset=True) | {"design": design, "measure": measure} | more
    return WholePlotProcedure.model_validate(values)


class Killed(BaseException):
    """Stands for SIGKILL."""


def kill_where(condition):
    def on_progress(news):
        if condition(news):
            raise Killed

    return on_progress


def records(path, kind=None, status=None):
    with RunReader.open(path) as reader:
        reader.verify()
        return [r for r in reader.records() if kind in (None, r.kind) and status in (None, r.status)]


def accepted(path):
    return records(path, "observation", "accepted")


def run(folder, procedure=None, **options):
    """A complete run; its file and its head."""
    procedure = procedure or attitude()
    path = new_run(folder, procedure)
    outcome, _, head, message = run_session(path, procedure=procedure, **options)
    assert outcome is Outcome.COMPLETE, message
    assert [r.run_index for r in accepted(path)] == list(range(len(procedure.expand().points)))
    return path, head


# --- noise ----------------------------------------------------------------------------------------------------


def scattering(bench, sd_mV):
    """The bridge scatters by this much, by pressure; returns the pressures in the order in which they are read."""
    fetch, asked = bench.dvm.fetch, []

    def fetch_scattering():
        readings, psia = dict(fetch()), bench.supply.setpoint
        if len(readings["1"]) == 2:
            asked.append(psia)
            assert len(asked) < 9, "asked again and again"
            off_V = sd_mV[psia] / 2**0.5 / 1e3
            readings["1"] = [readings["1"][0] - off_V, readings["1"][1] + off_V]
        return readings

    bench.dvm.fetch = fetch_scattering
    return asked


def run_scattering(folder, sd_mV, **faults):
    procedure, bench = whole_plot(faults=faults), pressure.PressureBench()
    asked = scattering(bench, sd_mV)
    path = pressure.new_run(folder, procedure)
    outcome, _, message = pressure.run_session(path, bench, procedure=procedure)
    return path, outcome, message, asked


def flags(path):
    return {r.data["readback"]["pressure_psia"]: r.data["flags"] for r in records(path, "observation")}


def test_scatter_of_a_sensor_in_millivolts_is_held_against_millivolts(tmp_path):
    path, outcome, message, _ = run_scattering(tmp_path, {1.0: 0.9 * MOST_MV, 2.5: 1.1 * MOST_MV})
    assert outcome is Outcome.COMPLETE, message
    assert flags(path) == {1.0: [], 2.5: ["noisy"]}


def test_what_is_too_noisy_is_told_in_volts_with_the_point(tmp_path):
    path, outcome, message, asked = run_scattering(tmp_path, dict.fromkeys((1.0, 2.5), 0.06), noisy=["abort"])
    assert outcome is Outcome.FAULT
    words = "bridge_mV scatters by 6e-05 V at point 0, more than 2e-05 V"
    assert message.startswith(words)
    assert [(r.data["fault"], r.data["message"]) for r in records(path, "fault")] == [("noisy", words)]
    assert len(asked) == 1


def test_a_policy_counts_what_failed_at_the_point_in_hand(tmp_path):
    noisy = ["retry 1", "accept"]
    path, outcome, message, asked = run_scattering(tmp_path, dict.fromkeys((1.0, 2.5), 2 * MOST_MV), noisy=noisy)
    assert outcome is Outcome.COMPLETE, message
    assert [(r.run_index, r.status) for r in records(path, "fault")] == [(0, "retry"), (1, "retry")]
    assert flags(path) == {1.0: ["noisy"], 2.5: ["noisy"]}
    assert len(asked) == 4


def test_the_noisiest_of_outputs_in_different_units_is_told_by_their_volts():
    scales = {"x_V": 1.0, "bridge_mV": 1e3}
    found = Observation({"x_V": Channel((1.0, 1.002)), "bridge_mV": Channel((1.0, 1.2))}, {})
    assert found.noisiest(scales) == ("x_V", pytest.approx(0.002 / 2**0.5))


def noisy_at(*starts):
    def spoil(_bench, _head, reader):
        start = reader.start

        def start_noisy(count):
            due = start(count)
            reader.noise_V = 0.01 if reader.starts in starts else 0.0
            return due

        reader.start = start_noisy

    return spoil


def test_a_noisy_point_is_read_again_so_often_and_all_of_it_is_kept(tmp_path):
    procedure = attitude(measure={"readings": 4, "max_sd_V": 1e-3, "repeats": 2})
    path, head = run(tmp_path, procedure, spoil=noisy_at(2, 4, 5, 7, 8, 9))
    kept = [r.data.get("rejected", []) for r in accepted(path)]
    assert [len(again) for again in kept] == [0, 1, 2, 2]
    assert [r.data["flags"] for r in accepted(path)] == [[], [], [], ["noisy"]]
    for again in (again for point in kept for again in point):
        assert again["noisy"] == "x_V"
        assert again["outputs"]["x_V"]["sd"] == pytest.approx(0.01 * (4 / 3) ** 0.5)
    assert head.sent == [*LEGS, PARKED], "nothing is moved for it"


# --- readings that do not count -------------------------------------------------------------------------------


def overloaded_at(*starts):
    def spoil(_bench, _head, reader):
        reader.overloads = set(starts)

    return spoil


def test_an_overload_is_written_down_and_told_with_the_point(tmp_path):
    path, _ = run(tmp_path, spoil=overloaded_at(3))
    (rejected,) = records(path, "observation", "rejected")
    assert (rejected.run_index, rejected.data["overload"]) == (2, ["x_V"])
    assert rejected.data["readings"]["x_V"][0] is None
    (fault,) = records(path, "fault")
    assert (fault.data["fault"], fault.data["message"]) == ("overload", "x_V out of range at point 2")


def test_outputs_that_hang_are_told_with_the_point(tmp_path):
    def spoil(_bench, _head, reader):
        fetch, seen = reader.fetch, []

        def hanging():
            seen.append(fetch())
            return seen[1] if reader.starts in (3, 4) else seen[-1]

        reader.fetch = hanging

    path, _ = run(tmp_path, spoil=spoil)
    words = "x_V at point 2 hangs: the same reading to the last digit, again and again"
    assert [(r.run_index, r.status, r.data["fault"], r.data["message"]) for r in records(path, "fault")] == [
        (2, "retry", "frozen", words)
    ] * 2


def test_what_outputs_read_in_the_session_before_is_remembered(tmp_path):
    last = []

    def remember(_bench, _head, reader):
        fetch = reader.fetch
        reader.fetch = lambda: (last.append(fetch()), last[-1])[1]

    def repeat_once(_bench, _head, reader):
        fetch = reader.fetch
        reader.fetch = lambda: last[-1] if reader.starts == 1 else fetch()
        reader.starts = 0

    path = new_run(tmp_path, attitude())
    with pytest.raises(Killed):
        run_session(path, procedure=attitude(), spoil=remember, on_progress=kill_where(lambda news: news.done == 2))
    assert run_session(path, procedure=attitude(), spoil=repeat_once)[0] is Outcome.COMPLETE
    assert [(r.run_index, r.data["fault"]) for r in records(path, "fault")] == [(2, "frozen")]


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


# --- what is written down, and the ways -----------------------------------------------------------------------


def test_an_observation_says_how_the_point_was_reached_read_and_found(tmp_path):
    path, head = run(tmp_path)
    assert head.sent == [*LEGS, PARKED]
    seen = [r.data for r in accepted(path)]
    parts = ["approach", "readback", "settling", "measured_s", "environment", "outputs", "temperatures", "flags"]
    assert [list(data) for data in seen] == [parts] * POINTS
    assert [data["approach"]["roll"] for data in seen] == [[1, -2.0], [1, 0.0], [-1, 92.0], [-1, 90.0]]
    assert [data["readback"] for data in seen][2] == {"pitch_deg": 30.0, "roll_deg": 90.0}
    for data in seen:
        began, ended = data["measured_s"]
        assert ended - began == 2.0
        assert {axis: s["outcome"] for axis, s in data["settling"].items()} == {"pitch": "settled", "roll": "settled"}
    assert seen[0]["measured_s"][0] == 5.0
    assert [r.data for r in records(path, "fault")] == []


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


def turning_short(times):
    """Once, an axis sent beyond a point turns so much nearer to it: 1 is the point itself."""

    def spoil(_bench, head, reader):
        move, turned = head.move, []

        def move_and_turn_short(targets):
            move(targets)
            if reader.starts == 2 and targets == {"roll": 92.0} and not turned:
                turned.append(targets)
                head._to = {**head._to, "roll": 92.0 - 2.0 * times}

        head.move = move_and_turn_short

    return spoil


@pytest.mark.parametrize(
    ("times", "says"),
    [
        (0.25, "roll arrived from 91.5, nearer than its overtravel: did it slip?"),
        (1.0, "roll did not arrive from its planned side"),
        (1.5, "roll did not arrive from its planned side"),
        (0.05, ""),
    ],
)
def test_an_axis_that_did_not_come_as_planned_is_told_with_what_was_seen(tmp_path, times, says):
    path, _ = run(tmp_path, spoil=turning_short(times))
    found = [(r.run_index, r.data["fault"], r.data["message"]) for r in records(path, "fault")]
    assert found == ([(2, "not_settled", says)] if says else [])
    for fault in records(path, "fault"):
        assert {axis: s["outcome"] for axis, s in fault.data["evidence"].items()} == {
            "pitch": "settled", "roll": "settled",
        }  # fmt: skip


@pytest.mark.parametrize(("bands", "says"), [(1.5, "pitch left its band while it was measured"), (0.5, "")])
def test_an_axis_that_left_its_band_is_told_with_what_was_seen(tmp_path, bands, says):
    def creep(_bench, head, reader):
        fetch = reader.fetch

        def fetch_and_creep():
            readings = fetch()
            if reader.starts == 2:
                head._from = {**head._to, "pitch": head._to["pitch"] - bands * PROCEDURE.settle.band_deg}
                head._to = dict(head._from)
            return readings

        reader.fetch = fetch_and_creep

    path, _ = run(tmp_path, spoil=creep)
    found = [(r.run_index, r.data["message"], list(r.data["evidence"])) for r in records(path, "fault")]
    assert found == ([(1, says, ["pitch", "roll"])] if says else [])


@pytest.mark.parametrize(("timeout_s", "most_s"), [(700.0, 700.0), (100.0, 600.0)])
def test_a_move_may_take_as_long_as_settling_and_ten_minutes_at_least(tmp_path, timeout_s, most_s):
    def stuck(_bench, head, _reader):
        read, stop, stopped = head.read, head.stop, []

        def never_still():
            moving = len(head.sent) == 3 and True not in stopped
            return {axis: replace(state, moving=state.moving or moving) for axis, state in read().items()}

        def stop_it():
            stopped.append(len(head.sent) == 3)
            stop()

        head.read, head.stop = never_still, stop_it

    path, _ = run(tmp_path, attitude(settle={"dwell_s": 1.0, "timeout_s": timeout_s}), spoil=stuck)
    (fault,) = records(path, "fault")
    assert fault.data["message"].startswith(f"moving took longer than {most_s:g} s")


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


def test_warnings_know_the_whole_plot(tmp_path, warning):
    procedure = whole_plot([[-60, 0], [-50, 10]])
    path = pressure.new_run(tmp_path, procedure)
    outcome, _, message = pressure.run_session(path, pressure.PressureBench(), procedure=procedure)
    assert outcome is Outcome.COMPLETE, message
    assert [number for _, number, _ in warning] == [1, 1, 2, 2]


# --- whole plots ----------------------------------------------------------------------------------------------


def test_a_reading_that_lost_its_whole_plot_is_durable_together_with_the_loss(tmp_path, monkeypatch):
    append, appended = RunWriter.append, []

    def noted(self, record, *, commit=True):
        appended.append((record.kind, record.status, commit))
        append(self, record, commit=commit)

    monkeypatch.setattr(RunWriter, "append", noted)
    procedure, bench = whole_plot(), pressure.PressureBench()
    path = pressure.new_run(tmp_path, procedure)
    moved = []

    def on_progress(news):
        if news.state == "recording" and news.done == 1 and not moved:
            moved.append(True)
            bench.cold_box.offset = 1.0
        elif news.state == "preparing":
            bench.cold_box.offset = 0.0

    outcome, _, message = pressure.run_session(path, bench, procedure=procedure, on_progress=on_progress)
    assert outcome is Outcome.COMPLETE, message
    (rejected,) = records(path, "observation", "rejected")
    assert rejected.run_index == 1
    assert "cold_box" in rejected.data["lost"]
    at = appended.index(("observation", "rejected", False))
    assert appended[at + 1] == ("event", "whole-plot-lost", True)
