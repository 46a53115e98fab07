"""The sequencer on ideal instruments: order, approach, recovery, policies."""

from __future__ import annotations

import itertools
import json

import pytest
from ideal_bench import PROCEDURE, new_run, run_session
from transitions import MachineError

from rig.drivers.errors import InstrumentError, NoReply
from rig.engine.session import Outcome, Signals
from rig.engine.states import TRANSITIONS, Moves, State, machine
from rig.errors import ExitCode, NotSafe, StorageError
from rig.run_file.read.reader import RunReader

POINTS = 18


def observations(path):
    with RunReader.open(path) as reader:
        reader.verify()
        return [r for r in reader.records("observation") if r.status == "accepted"]


def records(path, kind):
    with RunReader.open(path) as reader:
        return list(reader.records(kind))


def test_a_run_observes_every_point_once_in_order_from_the_planned_sides(tmp_path):
    path = new_run(tmp_path)
    outcome, state, head, _ = run_session(path)
    assert outcome is Outcome.COMPLETE
    seen = observations(path)
    assert [r.run_index for r in seen] == list(range(POINTS))
    for record, point in zip(seen, PROCEDURE.expand().points, strict=True):
        sides = tuple(record.data["approach"][axis][0] for axis in ("pitch", "roll"))
        assert sides == point.sides
        for axis, setpoint, side in zip(("pitch", "roll"), point.setpoints, point.sides, strict=True):
            assert (setpoint - record.data["approach"][axis][1]) * side >= 2.0 - 1e-9
            assert record.data["readback"][f"{axis}_deg"] == setpoint
    assert head.sent[-1] == {"pitch": 0.0, "roll": 0.0}
    assert head.safe >= 1
    assert state.ended == "complete"


class Killed(BaseException):
    """Stands for SIGKILL: no handler of the sequencer may catch it for good."""


def kill_after(wakeups):
    count = itertools.count()

    def on_progress(_news):
        if next(count) == wakeups:
            raise Killed

    return on_progress


@pytest.mark.parametrize("wakeups", range(0, 400, 7))
def test_killed_anywhere_and_resumed_nothing_is_lost_or_doubled(tmp_path, wakeups):
    path = new_run(tmp_path)
    try:
        run_session(path, on_progress=kill_after(wakeups))
    except Killed:
        outcome, *_ = run_session(path)
        assert outcome is Outcome.COMPLETE
    seen = observations(path)
    assert sorted(r.run_index for r in seen) == list(range(POINTS))
    for record, point in zip(sorted(seen, key=lambda r: r.run_index), PROCEDURE.expand().points, strict=True):
        assert tuple(record.data["approach"][axis][0] for axis in ("pitch", "roll")) == point.sides


def test_after_an_interruption_the_previous_point_is_passed_again(tmp_path):
    path = new_run(tmp_path)
    with pytest.raises(Killed):
        run_session(path, on_progress=kill_after(150))
    last = observations(path)[-1].run_index
    _, _, head, _ = run_session(path)
    points = PROCEDURE.expand().points
    previous = dict(zip(("pitch", "roll"), points[last].setpoints, strict=True))
    assert head.sent[1] == previous
    assert head.sent[0] == {
        axis: previous[axis] - 2.0 * s for axis, s in zip(previous, points[last].sides, strict=True)
    }


def preparations(path):
    return [r.status for r in records(path, "event") if r.status in ("preparing", "prepared")]


def test_a_kill_while_preparing_does_not_count_as_prepared(tmp_path):
    path = new_run(tmp_path)

    def die_while_preparing(news):
        if news.state == "preparing":
            raise Killed

    with pytest.raises(Killed):
        run_session(path, on_progress=die_while_preparing)
    assert run_session(path, gap_s=1.0)[0] is Outcome.COMPLETE
    assert preparations(path)[-2:] == ["preparing", "prepared"]


def test_gaps_of_sessions_that_did_nothing_add_up(tmp_path):
    path = new_run(tmp_path)
    with pytest.raises(Killed):
        run_session(path, on_progress=kill_after(150))
    assert preparations(path) == ["preparing", "prepared"]

    def die_at_once(_news):
        raise Killed

    for _ in range(3):
        with pytest.raises(Killed):
            run_session(path, gap_s=700.0, on_progress=die_at_once)
    assert run_session(path, gap_s=10.0)[0] is Outcome.COMPLETE
    assert preparations(path) == ["preparing", "prepared"] * 2


def test_the_gap_of_a_session_lasts_until_its_record_however_slowly_it_starts(tmp_path):
    path = new_run(tmp_path)
    with pytest.raises(Killed):
        run_session(path, on_progress=kill_after(150))
    run_session(path, gap_s=60.0, spoil=lambda bench, *_: bench.clock.sleep(400.0))
    with RunReader.open(path) as reader:
        pairs = itertools.pairwise(reader.records())
        before, session = next((a, b) for a, b in pairs if b.kind == "session" and b.session == 2)
    assert session.data["gap_s"] == pytest.approx(460.0) == session.elapsed_s - before.elapsed_s


def test_a_hold_while_preparing_prepares_again(tmp_path):
    path = new_run(tmp_path)
    requests = iter(["hold", "release"])

    def ask(news):
        if news.state == "preparing" or (news.state == "holding" and "held" in news.message):
            verb = next(requests, None)
            if verb:
                content = {"id": verb, "session": 1, "verb": verb}
                path.with_suffix(".request").write_text(json.dumps(content))

    def not_homed(_bench, head, _reader):
        head.homed = False

    outcome, *_ = run_session(path, on_progress=ask, spoil=not_homed)
    assert outcome is Outcome.COMPLETE
    assert preparations(path) == ["preparing", "preparing", "prepared"]


def test_a_malformed_request_is_ignored(tmp_path):
    path = new_run(tmp_path)
    path.with_suffix(".request").write_text('{"session": 1, "verb": "stop"}')
    assert run_session(path)[0] is Outcome.COMPLETE


def test_a_log_that_cannot_be_written_does_not_end_the_night(tmp_path):
    path = new_run(tmp_path)

    def full(_news):
        raise OSError(28, "No space left on device")

    assert run_session(path, on_progress=full)[0] is Outcome.COMPLETE


def test_an_instrument_that_is_silent_for_a_while_costs_retries_not_the_night(tmp_path):
    path = new_run(tmp_path)

    def silent_for_ten_seconds(_bench, head, _reader):
        asleep = []

        def unless_asleep(method):
            def call(*arguments):
                if head.world.now() > 40 and not asleep:
                    asleep.append(head.world.now() + 10)
                if asleep and head.world.now() < asleep[0]:
                    raise NoReply("head at nowhere does not answer")
                return method(*arguments)

            return call

        for name in ("read", "stop", "move"):
            setattr(head, name, unless_asleep(getattr(head, name)))

    outcome, *_ = run_session(path, spoil=silent_for_ten_seconds)
    assert outcome is Outcome.COMPLETE
    assert [(r.status, r.data["pause_s"]) for r in records(path, "fault")] == [("retry", 2), ("retry", 4), ("retry", 8)]
    assert len(observations(path)) == POINTS


def test_an_instrument_that_is_silent_while_it_is_set_up_again_is_retried_too(tmp_path):
    path = new_run(tmp_path)
    with pytest.raises(Killed):
        run_session(path, on_progress=kill_after(150))

    def refuses_twice(_bench, _head, reader):
        left = itertools.count()

        def prepare():
            if next(left) < 2:
                raise NoReply("dvm at nowhere does not answer")

        reader.prepare = prepare

    outcome, *_ = run_session(path, spoil=refuses_twice)
    assert outcome is Outcome.COMPLETE
    assert [r.status for r in records(path, "fault")] == ["retry", "retry"]


def test_a_signal_is_heard_while_a_silent_instrument_is_waited_for(tmp_path):
    path = new_run(tmp_path)
    signals = Signals()

    def silent_twice(bench, head, reader):
        failing(1, NoReply("head is silent"))(bench, head, reader)
        stop, calls = head.stop, itertools.count()

        def stop_or_not():
            if next(calls) == 1:  # the first stop after the fault: now a pause follows, and the signal comes in it
                signals.interrupt = "SIGTERM"
                raise NoReply("head is still silent")
            stop()

        head.stop = stop_or_not

    outcome, *_ = run_session(path, signals=signals, spoil=silent_twice)
    assert outcome is Outcome.INTERRUPTED
    assert run_session(path)[0] is Outcome.COMPLETE


def test_a_short_gap_needs_no_new_preparation(tmp_path):
    path = new_run(tmp_path)
    with pytest.raises(Killed):
        run_session(path, on_progress=kill_after(150))
    run_session(path, gap_s=700.0)
    assert preparations(path) == ["preparing", "prepared"]


def test_what_cannot_be_made_safe_is_said_and_has_an_outcome_of_its_own(tmp_path):
    path = new_run(tmp_path)

    def stuck(_bench, head, _reader):
        failing(10_000, NoReply("head is silent"))(_bench, head, _reader)

        def refuse():
            raise NoReply("head does not stop")

        head.make_safe = refuse

    outcome, _, _, message = run_session(path, spoil=stuck)
    assert outcome is Outcome.UNSAFE
    assert "NOT everything could be brought to its safe state: head: head does not stop" in message


def defect(news):
    if news.done == 3:
        raise ZeroDivisionError("a defect of the program")


def test_an_unforeseen_error_after_which_the_bench_is_not_safe_ends_in_5_and_is_recorded(tmp_path):
    path = new_run(tmp_path)

    def stuck(_bench, head, _reader):
        def refuse():
            head.read = refuse
            raise NoReply("head does not stop")

        head.make_safe = refuse

    with pytest.raises(
        NotSafe, match=r"(?s)a defect of the program.*NOT everything.*head: head does not stop"
    ) as caught:
        run_session(path, spoil=stuck, on_progress=defect)
    assert caught.value.exit_code == ExitCode.UNSAFE
    assert isinstance(caught.value.__cause__, ZeroDivisionError)
    (fault,) = records(path, "fault")
    assert fault.status == "abort"
    assert "ZeroDivisionError" in fault.data["message"]
    (safe,) = (r for r in records(path, "event") if r.status == "safe")
    assert safe.data["unsafe"] == ["head: head does not stop"]
    assert run_session(path)[0] is Outcome.COMPLETE


def test_an_unforeseen_error_with_a_safe_bench_is_recorded_too_and_keeps_its_name(tmp_path):
    path = new_run(tmp_path)
    with pytest.raises(ZeroDivisionError):
        run_session(path, on_progress=defect)
    (fault,) = records(path, "fault")
    assert "safe after" in fault.data["message"]
    assert run_session(path)[0] is Outcome.COMPLETE


def test_a_signal_stops_motion_and_leaves_the_run_resumable(tmp_path):
    path = new_run(tmp_path)
    signals = Signals()

    def interrupt(news):
        if news.done == 3:
            signals.interrupt = "SIGTERM"

    outcome, _, head, _ = run_session(path, signals=signals, on_progress=interrupt)
    assert outcome is Outcome.INTERRUPTED
    assert not any(state.moving for state in head.read().values())
    assert [r.status for r in records(path, "event")][-1] == "interrupted"
    assert run_session(path)[0] is Outcome.COMPLETE
    assert len(observations(path)) == POINTS


def failing(times, error):
    left = itertools.count()

    def spoil(_bench, head, _reader):
        read = head.read

        def flaky():
            n = next(left)
            if 40 <= n < 40 + times:
                raise error
            return read()

        head.read = flaky

    return spoil


def test_a_passing_fault_is_retried_and_recorded(tmp_path):
    path = new_run(tmp_path)
    outcome, *_ = run_session(path, spoil=failing(1, NoReply("head at nowhere did not answer")))
    assert outcome is Outcome.COMPLETE
    assert [r.status for r in records(path, "fault")] == ["retry"]
    assert len(observations(path)) == POINTS


@pytest.mark.parametrize("error", [NoReply("head at nowhere is silent"), InstrumentError("head", 3, "following error")])
def test_a_lasting_fault_ends_and_says_why_and_what_cannot_be_read_back_is_not_called_safe(tmp_path, error):
    path = new_run(tmp_path)
    outcome, _, head, message = run_session(path, spoil=failing(10_000, error))
    assert outcome is Outcome.UNSAFE
    assert str(error) in message
    assert head.safe >= 1
    outcome, *_ = run_session(path)
    assert outcome is Outcome.COMPLETE


def test_an_overloaded_point_is_retried_then_skipped_then_tried_again_at_the_end(tmp_path):
    path = new_run(tmp_path)

    def overload_three_times(_bench, _head, reader):
        reader.overloads = {5, 6, 7}

    outcome, state, *_ = run_session(path, spoil=overload_three_times)
    assert outcome is Outcome.COMPLETE
    assert [r.status for r in records(path, "fault")] == ["retry", "retry", "skip"]
    assert not state.skipped
    assert observations(path)[-1].run_index == 4
    rejected = [r for r in records(path, "observation") if r.status == "rejected"]
    assert [r.data["readings"]["x_V"][0] for r in rejected] == [None] * 3


def test_a_point_that_always_overloads_is_skipped_with_its_reason(tmp_path):
    path = new_run(tmp_path)

    def overload_at_zero(_bench, head, reader):
        fetch = reader.fetch

        def fetch_or_overload():
            readings = dict(fetch())
            if head.position("pitch") == 0 and head.position("roll") == 0:
                readings["1"] = [9.9e37] * 4
            return readings

        reader.fetch = fetch_or_overload

    outcome, state, *_ = run_session(path, spoil=overload_at_zero)
    assert outcome is Outcome.COMPLETE
    assert sorted(state.skipped) == [4, 13]
    assert all("x_V out of range" in why for why in state.skipped.values())
    assert len(observations(path)) == POINTS - 2


def test_noisy_readings_are_repeated_then_accepted_with_a_flag(tmp_path):
    path = new_run(tmp_path)
    procedure = PROCEDURE.model_copy(
        update={"measure": PROCEDURE.measure.model_copy(update={"max_sd_V": 1e-3, "repeats": 2})}
    )

    def noisy(_bench, _head, reader):
        reader.noise_V = 0.01

    outcome, *_ = run_session(path, procedure=procedure, spoil=noisy)
    assert outcome is Outcome.COMPLETE
    for record in observations(path):
        assert record.data["flags"] == ["noisy"]
        assert len(record.data["rejected"]) == 2


def test_another_instrument_is_refused_unless_accepted(tmp_path):
    path = new_run(tmp_path)
    with pytest.raises(Killed):
        run_session(path, on_progress=kill_after(150))

    def replaced(_bench, head, _reader):
        head.serial = "H2"

    outcome, _, head, message = run_session(path, spoil=replaced)
    assert outcome is Outcome.FAULT
    assert "head is another instrument than before (was ideal head, H1; is ideal head, H2)" in message
    assert "--accept head" in message
    assert head.sent == []
    outcome, *_ = run_session(path, spoil=replaced, accept=frozenset({"head"}))
    assert outcome is Outcome.COMPLETE
    assert records(path, "identity")[-1].data["replaces"]["serial"] == "H1"


def test_a_limit_passed_by_a_readback_ends_safe(tmp_path):
    path = new_run(tmp_path)

    def slips(_bench, head, _reader):
        head.position = lambda axis: 97.0 if head.world.now() > 30 else 0.0

    outcome, _, head, message = run_session(path, spoil=slips)
    assert outcome is Outcome.FAULT
    assert "pitch is at 97 deg, outside -95 to 95" in message
    assert head.safe >= 1


def test_a_disk_that_refuses_stops_the_run_safe_with_everything_before_it(tmp_path, monkeypatch):
    path = new_run(tmp_path)
    commit = __import__("rig.run_file.write.writer", fromlist=["RunWriter"]).RunWriter.commit
    calls = itertools.count()

    def full(self):
        if next(calls) > 12:
            raise StorageError("cannot write: disk full. Free space, then: rig resume")
        commit(self)

    monkeypatch.setattr("rig.run_file.write.writer.RunWriter.commit", full)
    outcome, _, head, message = run_session(path)
    monkeypatch.undo()
    assert outcome is Outcome.FAULT
    assert "disk full" in message
    assert head.safe >= 1
    assert 0 < len(observations(path)) < POINTS
    assert run_session(path)[0] is Outcome.COMPLETE
    assert len(observations(path)) == POINTS


def test_an_unforeseen_error_leaves_the_bench_safe_before_it_is_raised(tmp_path):
    path = new_run(tmp_path)
    heads = []

    def bug(news):
        if news.state == "measuring":
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        run_session(path, on_progress=bug, spoil=lambda _bench, head, _reader: heads.append(head))
    assert heads[0].safe == 1


def test_the_moves_are_those_of_the_machine_of_transitions():
    names = [t.trigger for t in TRANSITIONS]
    for state in State:
        for name in names:
            moves, other = Moves(), machine()
            moves.state = state
            other.set_state(str(state))
            try:
                other.trigger(name)
            except MachineError:
                with pytest.raises(MachineError):
                    moves.trigger(name)
            else:
                moves.trigger(name)
                assert moves.state == other.state


def test_triggers_that_the_table_does_not_permit_are_refused(tmp_path, monkeypatch):
    path = new_run(tmp_path)
    monkeypatch.setattr("rig.engine.at_point.AtPoint.settling", lambda _self: "finish")
    with pytest.raises(MachineError):
        run_session(path)


def test_an_axis_that_leaves_its_band_while_it_is_measured_is_measured_again(tmp_path):
    path, band = new_run(tmp_path), PROCEDURE.settle.band_deg

    def creep_once(_bench, head, reader):
        fetch = reader.fetch

        def fetch_and_creep():
            readings = fetch()
            if reader.starts == 5:  # by two bands: more than is allowed, less than anybody would see
                head._from = {**head._to, "pitch": head._to["pitch"] + 2 * band}
                head._to = dict(head._from)
            return readings

        reader.fetch = fetch_and_creep

    outcome, *_ = run_session(path, spoil=creep_once)
    assert outcome is Outcome.COMPLETE
    (fault,) = records(path, "fault")
    assert "pitch left its band while it was measured" in json.dumps(fault.data)
    for record in observations(path):
        point = PROCEDURE.expand().points[record.run_index]
        assert record.data["readback"]["pitch_deg"] == pytest.approx(point.setpoints[0], abs=band)


@pytest.mark.parametrize(("short", "faults"), [(0.05, 0), (0.15, 1)])
def test_an_axis_that_came_from_nearer_than_its_overtravel_comes_again(tmp_path, short, faults):
    path, overtravel = new_run(tmp_path), PROCEDURE.approach.overtravel_deg
    pitches = (-30.0, 0.0, 30.0)

    def turn_short_once(_bench, head, reader):
        move, turned = head.move, []

        def move_and_turn_short(targets):
            move(targets)
            target = targets.get("pitch", 0.0)
            if reader.starts >= 3 and target not in pitches and not turned:
                turned.append(target)
                point = min(pitches, key=lambda pitch: abs(pitch - target))
                head._to = {**head._to, "pitch": target + short * (point - target)}

        head.move = move_and_turn_short

    outcome, *_ = run_session(path, spoil=turn_short_once)
    assert outcome is Outcome.COMPLETE
    found = [json.dumps(fault.data) for fault in records(path, "fault")]
    assert len(found) == faults
    assert all("nearer than its overtravel" in fault for fault in found)
    ways = [
        abs(record.data["approach"]["pitch"][1] - PROCEDURE.expand().points[record.run_index].setpoints[0])
        for record in observations(path)
    ]
    assert min(ways) == pytest.approx(overtravel if faults else (1 - short) * overtravel)
