"""Policies: what a procedure wants done about each class of fault, in every state, and what the run file says of it."""

from __future__ import annotations

import csv
import itertools
import json
from dataclasses import replace

import ideal_pressure_bench as pressure
import pytest
from command import rig
from ideal_bench import CONFIG, PROCEDURE, new_run, run_session
from ideal_pressure_bench import EACH, IN_ALL, PressureBench

from rig.bench.bench_file import check_options
from rig.bench.config import parse_bench, parse_procedure
from rig.drivers.errors import BadReply, InstrumentError, NoReply, Unreachable
from rig.drivers.roles import ChamberState, Identity
from rig.engine.actions import BenchActions
from rig.engine.axes import Axes, HeadMover
from rig.engine.guard import Guard
from rig.engine.session import Outcome
from rig.errors import ConfigurationError
from rig.examples import example
from rig.instruments.opening import open_bench
from rig.procedures.attitude.settings import PitchRollProcedure
from rig.procedures.plan.fault_policies import HeadFaults, Step, step_at
from rig.procedures.present.words import incomplete
from rig.procedures.pressure.settings import WholePlotFaults
from rig.run_file.read.reader import RunReader
from rig.simulated.dry_run import DryBench
from rig.tables.table_of_run import run_table
from rig.verbs.page import story

POINTS = 18


def records(path, kind):
    with RunReader.open(path) as reader:
        reader.verify()
        return list(reader.records(kind))


def decisions(path):
    return [(r.data["fault"], r.status) for r in records(path, "fault") if "fault" in r.data]


def events(path, status):
    return [r for r in records(path, "event") if r.status == status]


def accepted(path):
    return [r for r in records(path, "observation") if r.status == "accepted"]


def with_faults(procedure=PROCEDURE, **faults):
    """The procedure with another `[faults]` table, checked as a file's is."""
    return type(procedure).model_validate({**procedure.model_dump(exclude_unset=True), "faults": faults})


def complete_and_from_the_planned_sides(path, procedure=PROCEDURE):
    seen = sorted(accepted(path), key=lambda r: r.run_index)
    assert [r.run_index for r in seen] == list(range(POINTS))
    for record, point in zip(seen, procedure.expand().points, strict=True):
        assert tuple(record.data["approach"][axis][0] for axis in ("pitch", "roll")) == point.sides


# --- the table ------------------------------------------------------------------------------------------------


def test_a_policy_of_one_word_is_the_last_step_after_the_retries_as_it_always_was():
    old = WholePlotFaults(retries=1, not_settled="skip", no_reply="hold", instrument_error="abort", soak="hold")
    assert old.plan("not_settled") == (Step("retry", 1), Step("skip", 0))
    assert old.plan("soak") == (Step("hold", 0),), "temperatures that do not settle have had their time"
    for follows in ("bad_reply", "unreachable"):
        assert old.plan(follows) == (Step("retry", 1), Step("hold", 0)), "these had one policy once"
    assert old.plan("supply_failure")[-1] == Step("abort", 0)


def test_steps_are_taken_one_after_the_other():
    plan = HeadFaults(no_reply=["retry 2", "re-home", "skip"]).plan("no_reply")
    assert [step_at(plan, n) for n in range(1, 6)] == [
        ("retry", 1), ("retry", 2), ("re-home", 1), ("skip", 1), ("skip", 1),
    ]  # fmt: skip
    assert step_at(HeadFaults(no_reply=["retry 1"]).plan("no_reply"), 2) == ("abort", 1), "nothing else ends it"


def test_by_default_a_cable_that_was_loose_for_minutes_is_waited_for_with_growing_pauses():
    faults = HeadFaults()
    pauses = [faults.pause(n) for n in range(1, 12)]
    assert pauses == sorted(pauses)
    assert pauses[-1] == faults.pause_max_s
    for fault in ("no_reply", "unreachable"):
        assert sum(pauses[: faults.plan(fault)[0].times]) > 300
    assert sum(pauses[: faults.plan("no_reply")[0].times]) < 600, "a whole plot may still go on"


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ('no_reply = "sleep"', "'sleep' is no step of a policy"),
        ('no_reply = ["skip", "retry"]', "'skip' ends a policy: it stands last"),
        ('no_reply = ["retry 0", "skip"]', "how often is a whole number from 1 to 100"),
        ('overload = ["re-soak"]', "re-soak makes no sense here; known: retry, re-home, skip, hold, abort"),
        ('overload = "accept"', "accept makes no sense here"),
        ('environment = "skip"', "environment: skip makes no sense here; known: retry, hold, abort"),
        ('no_replys = "skip"', "did you mean no_reply?"),
    ],
)
def test_a_policy_that_makes_no_sense_is_explained(line, says):
    text = f'kind = "pitch-roll"\nname = "n"\n[design]\ntype = "T4"\n[faults]\n{line}\n'
    with pytest.raises(ConfigurationError) as caught:
        parse_procedure(text, "procedure.toml")
    assert says in str(caught.value)


# --- instruments that fail for a while, anywhere --------------------------------------------------------------


def failing_in(state, seconds, error, methods, times=1):
    """Has instruments of the ideal bench fail for so long, from the first call in a state of the sequencer on."""
    news_state = [""]
    began: list[float] = []

    def on_progress(news):
        news_state[0] = news.state

    def spoil(_bench, head, reader):
        reader.noise_V = 1e-6  # equal readings after lost ones are doubted

        def unless_failing(method):
            def call(*arguments):
                if news_state[0] == state and len(began) < times and (not began or head.world.now() > began[-1] + 1e4):
                    began.append(head.world.now())
                if began and head.world.now() < began[-1] + seconds:
                    raise error
                return method(*arguments)

            return call

        for name, method in methods:
            instrument = {"head": head, "reader": reader}[name]
            setattr(instrument, method, unless_failing(getattr(instrument, method)))

    return {"on_progress": on_progress, "spoil": spoil}


HEAD = [("head", m) for m in ("identify", "read", "stop", "move", "prepare", "home", "make_safe")]
READER = [("reader", m) for m in ("identify", "prepare", "start", "fetch")]


@pytest.mark.parametrize(
    ("state", "error"),
    [
        ("checking", Unreachable("head: no such device")),
        ("preparing", NoReply("no reply")),
        ("moving", Unreachable("head: no such device")),
        ("settling", BadReply("garbled")),
        ("recording", NoReply("no reply")),
        ("parking", Unreachable("head: no such device")),
    ],
)
def test_a_head_that_is_gone_for_a_minute_costs_a_minute_wherever_the_night_is(tmp_path, state, error):
    path = new_run(tmp_path)
    outcome, _, _, message = run_session(path, **failing_in(state, 50.0, error, HEAD))
    assert outcome is Outcome.COMPLETE, message
    complete_and_from_the_planned_sides(path)
    assert {action for _, action in decisions(path)} == {"retry"}
    assert records(path, "fault")[0].data["where"] == state


def test_a_scanner_unplugged_for_five_minutes_costs_no_point_and_the_night_says_so(tmp_path):
    path = new_run(tmp_path)
    options = failing_in("measuring", 300.0, Unreachable("dvm at /dev/rig/scanner cannot be opened"), READER)
    outcome, state, _, message = run_session(path, **options)
    assert outcome is Outcome.COMPLETE, message
    complete_and_from_the_planned_sides(path)
    faults = records(path, "fault")
    assert {(r.data["fault"], r.status) for r in faults} == {("unreachable", "retry")}
    assert [r.data["failure"] for r in faults] == list(range(1, len(faults) + 1))
    assert [r.attempt for r in faults] == list(range(1, len(faults) + 1))
    (recovered,) = events(path, "recovered")
    assert recovered.data["failures"] == {"unreachable": len(faults)}
    assert state.decisions == {"unreachable: retry": len(faults)}
    words = "\n".join(line.what for line in story(path))
    assert f"unreachable at point 0, failure {len(faults)}" in words
    assert "went well in the end" in words


def test_a_scanner_that_stays_dead_ends_the_night_safe_since_it_can_do_no_harm(tmp_path):
    path = new_run(tmp_path)
    methods = [*READER, ("reader", "make_safe")]
    outcome, _, head, message = run_session(path, **failing_in("measuring", 1e6, NoReply("dvm is silent"), methods))
    assert outcome is Outcome.FAULT, message
    assert "dvm is silent" in message
    assert "safe after" in message
    assert head.safe == 1
    (safe,) = events(path, "safe")
    assert safe.data["silent"] == ["dvm: dvm is silent"]
    assert [a for _, a in decisions(path)] == ["retry"] * 8 + ["abort"]
    assert run_session(path)[0] is Outcome.COMPLETE


def test_after_an_error_the_state_is_read_before_anything_is_commanded(tmp_path):
    path, calls = new_run(tmp_path), []

    def spoil(_bench, head, reader):
        for name in ("read", "move", "prepare", "home"):
            method = getattr(head, name)
            setattr(head, name, lambda *a, _m=method, _n=name: (calls.append(_n), _m(*a))[1])
        fetch, fails = reader.fetch, iter([True, False, True])

        def fetch_or_not():
            if next(fails, False):
                calls.append("error")
                raise NoReply("dvm is silent")
            return fetch()

        reader.fetch = fetch_or_not

    assert run_session(path, spoil=spoil)[0] is Outcome.COMPLETE
    errors = [i for i, name in enumerate(calls) if name == "error"]
    assert len(errors) == 2
    for i in errors:
        assert calls[i + 1] == "read"
    assert len(events(path, "read-back")) == 2


# --- heads ----------------------------------------------------------------------------------------------------


def faulty_drive(times):
    """The head complains while it is sent to its fifth angle, until it is prepared; its zeros can be forgotten."""

    def spoil(bench, head, _reader):
        head.fault, head.searches, left = "", 0, itertools.count()
        read, move, prepare, home = head.read, head.move, head.prepare, head.home

        def read_with_fault():
            return {axis: s._replace(fault=head.fault, enabled=not head.fault) for axis, s in read().items()}

        def move_and_fail(targets):
            move(targets)
            if len(head.sent) >= 5 and next(left) < times:
                head.stop()
                head.fault = "following error (error 8611h)"

        def cleared():
            head.fault = ""
            prepare()

        def searched():
            head.searches += not head.homed
            home()

        def forget():
            head.homed = False

        head.read, head.move, head.prepare, head.home = read_with_fault, move_and_fail, cleared, searched
        # on the guard before it as well: since Python 3.12 a role is told without asking `__getattr__`
        head.forget_zeros = bench.instruments["head"].forget_zeros = forget

    return spoil


def test_a_drive_fault_is_cleared_the_zeros_are_found_again_and_the_night_goes_on(tmp_path):
    path = new_run(tmp_path)
    outcome, _, head, message = run_session(path, spoil=faulty_drive(1))
    assert outcome is Outcome.COMPLETE, message
    assert decisions(path) == [("drive_fault", "re-home")]
    assert head.searches == 1
    assert len(events(path, "homed")) == 1
    complete_and_from_the_planned_sides(path)


def test_a_drive_that_fails_again_and_again_ends_the_night_safe(tmp_path):
    path = new_run(tmp_path)
    outcome, _, _, message = run_session(path, spoil=faulty_drive(10_000))
    assert outcome is Outcome.FAULT
    assert "following error (error 8611h)" in message
    assert [action for _, action in decisions(path)] == ["re-home"] * 2 + ["abort"], "at the point and while homing"


def test_a_head_that_was_without_power_for_a_moment_finds_its_zeros_and_goes_on(tmp_path):
    path, cut = new_run(tmp_path), []

    def on_progress(news):
        if news.done == 5 and not cut:
            cut.append(True)
            heads[0].homed = False

    heads = []
    outcome, _, _, message = run_session(path, on_progress=on_progress, spoil=lambda _b, head, _r: heads.append(head))
    assert outcome is Outcome.COMPLETE, message
    assert [fault for fault, _ in decisions(path)] == ["not_homed"]
    complete_and_from_the_planned_sides(path)


def test_a_home_search_that_fails_is_tried_again(tmp_path):
    path = new_run(tmp_path)

    def spoil(_bench, head, _reader):
        head.homed, home, calls = False, head.home, itertools.count()
        head.home = lambda: next(calls) and home()

    outcome, _, _, message = run_session(path, spoil=spoil)
    assert outcome is Outcome.COMPLETE, message
    assert decisions(path) == [("not_homed", "re-home")]


@pytest.mark.parametrize("driver", ["newport-esp301", "cia402-pair"])
def test_zeros_that_are_not_trusted_any_more_are_all_found_again(driver):
    text = (example("attitude-lab") / "bench.toml").read_text()
    if driver == "cia402-pair":
        text = text.replace("newport-esp301", driver).replace('"/dev/rig/head"', '"can:socketcan/can0"')
    dry = DryBench(parse_bench(text, "bench.toml"), {})
    bench = open_bench(dry.config, check_options(dry.config, "bench"), dry.world, dry.wires)
    do = BenchActions(bench, Axes([HeadMover(bench.head)]), Guard({}), dry.world, dry.world.sleep)
    bench.head.prepare()
    assert do.home(1.0)
    assert not do.home(1.0)
    bench.head.move({"pitch": 7.0})
    dry.world.sleep(10.0)
    assert do.home(1.0, again=True)
    assert all(state.homed and abs(state.position_deg) < 0.01 for state in bench.head.read().values())
    assert not do.home(1.0)
    bench.close()
    dry.close()


# --- skips, holds ---------------------------------------------------------------------------------------------


def overloaded_at(where):
    def spoil(_bench, head, reader):
        fetch = reader.fetch

        def fetch_or_overload():
            readings = dict(fetch())
            if (head.position("pitch"), head.position("roll")) in where:
                readings["1"] = [9.9e37] * 4
            return readings

        reader.fetch = fetch_or_overload

    return spoil


def test_a_skipped_point_is_visible_wherever_the_data_are_shown(tmp_path):
    path = new_run(tmp_path)
    outcome, state, *_ = run_session(path, spoil=overloaded_at({(0.0, 0.0)}))
    assert outcome is Outcome.COMPLETE
    assert sorted(state.skipped) == [4, 13]
    words = incomplete(run_table(path).provenance)
    assert "16 of 18 points; 2 skipped: point 4 (pitch 0 deg, roll 0 deg): x_V out of range at point 4" in words
    assert "the design is not balanced: replications 1, 2 lack points" in words
    shown = json.loads(rig("status", path, "--json").stdout)
    assert shown["decisions"] == {"overload: retry": 8, "overload: skip": 4}
    assert "overload: skip 4x" in rig("status", path).stdout
    exported = tmp_path / "all.csv"
    assert rig("export", path, "--out", exported, "--all").returncode == 0
    rows = list(csv.DictReader((tmp_path / "all.faults.csv").read_text().splitlines()))
    assert [r["decision"] for r in rows if r["kind"] == "fault"] == [s for _, s in decisions(path)]
    assert [r["decision"] for r in rows if r["kind"] == "skip"] == ["later", "later", "final", "final"]


def test_points_put_off_one_after_the_other_mean_that_something_else_is_wrong(tmp_path):
    path = new_run(tmp_path)
    everywhere = set(itertools.product((-30.0, 0.0, 30.0), (-90.0, 0.0, 90.0)))
    procedure = with_faults(skips_in_a_row=4, retries=0)
    outcome, _, _, _ = run_session(path, procedure=procedure, spoil=overloaded_at(everywhere))
    assert outcome is Outcome.FAULT
    assert [a for _, a in decisions(path)] == ["skip"] * 3 + ["abort"]
    assert run_session(path, procedure=procedure)[0] is Outcome.COMPLETE


def test_noise_may_be_a_fault(tmp_path):
    measure = {**PROCEDURE.measure.model_dump(), "max_sd_V": 1e-3, "repeats": 1}
    procedure = with_faults(noisy=["retry 1", "skip"]).model_copy(
        update={"measure": type(PROCEDURE.measure).model_validate(measure)}
    )
    path = new_run(tmp_path)

    def noisy_for_a_while(_bench, _head, reader):
        start, calls = reader.start, itertools.count()

        def start_noisy(count):
            reader.noise_V = 0.01 if next(calls) < 3 else 0.0
            return start(count)

        reader.start = start_noisy

    outcome, *_ = run_session(path, procedure=procedure, spoil=noisy_for_a_while)
    assert outcome is Outcome.COMPLETE
    assert decisions(path) == [("noisy", "retry")]
    assert all(not r.data["flags"] for r in accepted(path))


def test_a_hold_that_nobody_releases_ends_parked_and_can_be_resumed(tmp_path):
    path = new_run(tmp_path)
    procedure = with_faults(overload="hold", retries=0)
    procedure = procedure.model_copy(update={"recovery": procedure.recovery.model_copy(update={"hold_max_s": 3.0})})

    def once(_bench, _head, reader):
        reader.overloads = {5}

    outcome, _, head, message = run_session(path, procedure=procedure, spoil=once)
    assert outcome is Outcome.FAULT
    assert "nobody released it; parked" in message
    assert head.sent[-1] == {"roll": 0.0}
    assert events(path, "safe")
    assert run_session(path, procedure=procedure)[0] is Outcome.COMPLETE
    complete_and_from_the_planned_sides(path)


def asking(path, *steps):
    """Posts requests as the news come: (condition, verb)."""
    left = list(steps)

    def on_progress(news):
        if left and left[0][0](news):
            verb = left.pop(0)[1]
            content = {"id": f"{verb}{len(left)}", "session": 1, "verb": verb}
            path.with_suffix(".request").write_text(json.dumps(content))

    return on_progress


class Enclosure:
    """A chamber that stands where it is set, unless it is disturbed."""

    def __init__(self):
        self.setpoint, self.offset, self.alarms, self.sent = 23.0, 0.0, (), []

    def identify(self):
        return Identity("ideal", "box", "E1", "1")

    def prepare(self):
        pass

    def close(self):
        pass

    def limits(self):
        return 5.0, 60.0

    def make_safe(self):
        self.set_temperature(23.0)

    def set_temperature(self, degC):
        self.setpoint = degC
        self.sent.append(degC)

    def stop(self):
        pass

    def read(self):
        return ChamberState(self.setpoint, self.setpoint + self.offset, 0.0, True, self.alarms)


def in_an_enclosure(monkeypatch, procedure=PROCEDURE, **environment):
    box = Enclosure()
    instruments = {**CONFIG.instruments, "box": CONFIG.instruments["head"]}
    monkeypatch.setattr("ideal_bench.CONFIG", CONFIG.model_copy(update={"instruments": instruments}))
    bench_class = __import__("ideal_bench").Bench
    monkeypatch.setattr("ideal_bench.Bench", lambda c, i, *others: bench_class(c, {**i, "box": box}, *others))
    settings = {"setpoint_degC": 25.0, "dwell_s": 60.0, "timeout_s": 600.0, **environment}
    values = {**procedure.model_dump(exclude_unset=True), "environment": settings}
    return box, PitchRollProcedure.model_validate(values)


def test_the_point_in_hand_is_not_lost_where_a_hold_ends_in_a_new_preparation(tmp_path, monkeypatch):
    box, procedure = in_an_enclosure(monkeypatch)
    path, ticks = new_run(tmp_path), itertools.count()
    monkeypatch.setattr("rig.sims.world.World.stopwatch", lambda _self: float(next(ticks)))  # requests are seen at once

    def disturbed(news):
        box.offset = 5.0 if news.state == "holding" else 0.0
        return news.state == "holding" and "held" in news.message

    steps = [(lambda n: n.done == 5 and n.state == "moving", "hold"), (disturbed, "release")]
    ask = asking(path, *steps)

    def on_progress(news):
        disturbed(news)
        ask(news)

    outcome, _, _, message = run_session(path, procedure=procedure, on_progress=on_progress)
    assert outcome is Outcome.COMPLETE, message
    complete_and_from_the_planned_sides(path)
    assert len(events(path, "prepared")) == 2


@pytest.mark.parametrize(
    ("policy", "action", "flagged"), [(["accept"], None, True), (["retry", "abort"], "retry", False)]
)
def test_an_environment_that_left_its_tolerance_is_flagged_or_settled_again(
    tmp_path, monkeypatch, policy, action, flagged
):
    box, procedure = in_an_enclosure(monkeypatch, with_faults(temperature_left=policy))
    path, disturbed = new_run(tmp_path), []

    def on_progress(news):
        if news.done == 5 and news.state == "measuring" and not disturbed:
            disturbed.append(True)
            box.offset = 2.0
        elif news.state == "preparing" or news.done == 6:
            box.offset = 0.0

    outcome, _, _, message = run_session(path, procedure=procedure, on_progress=on_progress)
    assert outcome is Outcome.COMPLETE, message
    complete_and_from_the_planned_sides(path)
    assert decisions(path) == ([("temperature_left", action)] if action else [])
    flags = {r.run_index: r.data["flags"] for r in accepted(path) if r.data["flags"]}
    assert flags == ({5: ["temperature"]} if flagged else {})
    assert len(events(path, "prepared")) == (1 if flagged else 2)


def test_zeros_found_again_leave_an_environment_alone_that_stands(tmp_path, monkeypatch):
    box, procedure = in_an_enclosure(monkeypatch)
    path, heads = new_run(tmp_path), []

    def on_progress(news):
        if news.done == 5 and not heads[0].sent.count({}):
            heads[0].homed, heads[0].sent = False, [*heads[0].sent, {}]

    outcome, *_ = run_session(
        path, procedure=procedure, on_progress=on_progress, spoil=lambda _b, h, _r: heads.append(h)
    )
    assert outcome is Outcome.COMPLETE
    assert box.sent == [25.0, 23.0], "once for the run, once for the safe state"
    complete_and_from_the_planned_sides(path)


def test_axes_that_cannot_be_parked_do_not_undo_a_complete_run(tmp_path):
    path = new_run(tmp_path)

    def stuck(_bench, head, _reader):
        move = head.move

        def not_at_the_end(targets):
            if len(accepted(path)) == POINTS:
                raise InstrumentError("head", 7, "table locked")
            move(targets)

        head.move = not_at_the_end

    outcome, state, _, message = run_session(path, spoil=stuck)
    assert outcome is Outcome.COMPLETE
    assert "not parked" in message
    assert "table locked" in message
    assert state.ended == "complete"
    assert decisions(path)[-1] == ("drive_fault", "leave")


# --- whole plots ----------------------------------------------------------------------------------------------


def run_pressure(path, bench, **faults):
    on_progress = faults.pop("on_progress", lambda _: None)
    procedure = with_faults(pressure.PROCEDURE, **faults) if faults else pressure.PROCEDURE
    return pressure.run_session(path, bench, procedure=procedure, on_progress=on_progress)


@pytest.mark.parametrize(
    ("state", "instrument"),
    [
        ("checking", "cold_box"),
        ("preparing", "cold_box"),
        ("preparing", "dvm"),
        ("moving", "supply"),
        ("measuring", "dvm"),
        ("recording", "cold_box"),
        ("parking", "supply"),
    ],
)
def test_an_instrument_gone_for_a_minute_costs_no_whole_plot(tmp_path, state, instrument):
    path, bench, now = pressure.new_run(tmp_path), PressureBench(), [""]
    began: list[float] = []
    broken = getattr(bench, instrument)
    for name in ("read", "start", "set_temperature", "set_pressure", "identify"):
        if hasattr(broken, name):
            method = getattr(broken, name)

            def call(*arguments, _method=method):
                if now[0] == state and not began:
                    began.append(broken.world.now())
                if began and broken.world.now() < began[0] + 50.0:
                    raise Unreachable(f"{instrument}: no such device")
                return _method(*arguments)

            setattr(broken, name, call)

    outcome, run, message = run_pressure(path, bench, on_progress=lambda news: now.__setitem__(0, news.state))
    assert outcome is Outcome.COMPLETE, message
    assert sorted(r.run_index for r in accepted(path)) == list(range(IN_ALL))
    assert not run.lost
    assert {action for _, action in decisions(path)} <= {"retry"}


@pytest.mark.parametrize(("instrument", "lost"), [("cold_box", [2]), ("supply", [])])
def test_a_whole_plot_whose_chamber_was_not_seen_for_too_long_is_measured_again(tmp_path, instrument, lost):
    """Reading a chamber before going on does not hide that nobody could look at it."""
    path, bench, began = pressure.new_run(tmp_path), PressureBench(), []
    broken = getattr(bench, instrument)
    read = broken.read

    def silent_for_long():
        if began and broken.world.now() < began[0] + 900.0:
            raise Unreachable(f"{instrument}: no such device")
        return read()

    def on_progress(news):
        if news.done == 7 and not began:
            began.append(broken.world.now())

    broken.read = silent_for_long
    outcome, run, message = run_pressure(path, bench, on_progress=on_progress, unreachable=["retry 12", "abort"])
    assert outcome is Outcome.COMPLETE, message
    assert list(run.lost) == lost
    assert not lost or "left alone for" in run.lost[2]


def test_an_instrument_that_was_swapped_while_it_was_gone_is_refused(tmp_path):
    path = new_run(tmp_path)
    gone = failing_in("settling", 10.0, Unreachable("head: no such device"), HEAD)

    def spoil(bench, head, reader):
        gone["spoil"](bench, head, reader)
        identify = head.identify
        head.identify = lambda: replace(identify(), serial="H2" if decisions(path) else "H1")

    outcome, _, _, message = run_session(path, spoil=spoil, on_progress=gone["on_progress"])
    assert outcome is Outcome.FAULT
    assert "head is another instrument than before" in message
    assert "--accept head" in message


def test_gas_that_comes_back_after_a_while_costs_nothing_else(tmp_path):
    path, bench = pressure.new_run(tmp_path), PressureBench()
    read, began = bench.supply.read, []

    def without_gas():
        state, now = read(), bench.supply.world.now()
        if bench.supply.setpoint == 5.0 and not began:
            began.append(now)
        lost = began and now < began[0] + 100.0
        return replace(state, faults=("supply pressure lost",)) if lost else state

    bench.supply.read = without_gas
    outcome, run, message = run_pressure(path, bench)
    assert outcome is Outcome.COMPLETE, message
    assert set(decisions(path)) == {("supply_failure", "retry")}
    assert not run.lost


def test_a_pressure_that_does_not_settle_may_cost_its_whole_plot(tmp_path):
    path, bench = pressure.new_run(tmp_path), PressureBench()
    read, news_of = bench.supply.read, []

    def stuck_once():
        state, news = read(), news_of[-1]
        if bench.supply.setpoint == 1.0 and news.done > EACH and "re-soak" not in {n.message[9:16] for n in news_of}:
            return replace(state, in_limits=False)
        return state

    bench.supply.read = stuck_once
    outcome, run, message = run_pressure(path, bench, not_settled=["re-soak", "abort"], on_progress=news_of.append)
    assert outcome is Outcome.COMPLETE, message
    assert decisions(path) == [("not_settled", "re-soak")]
    assert list(run.lost) == [2]
    last = {r.run_index: r.whole_plot for r in accepted(path)}
    assert [last[i] for i in range(IN_ALL)] == [1] * EACH + [3] * EACH + [4] * EACH


@pytest.mark.parametrize(("in_a_row", "faults"), [(2, set()), (3, {1})])
def test_a_soak_of_hours_may_lose_a_reply_now_and_then(tmp_path, in_a_row, faults):
    soak = {**pressure.PROCEDURE.soak.model_dump(), "dwell_s": 1000.0}
    slow = pressure.PROCEDURE.model_copy(update={"soak": type(pressure.PROCEDURE.soak).model_validate(soak)})
    path, bench = pressure.new_run(tmp_path, slow), PressureBench()
    read, lost = bench.hot_box.read, []

    def lossy():
        now = bench.hot_box.world.now()
        if len(lost) < 12 * in_a_row and now > 800.0 * (len(lost) // in_a_row + 1):
            lost.append(now)
            raise NoReply("hot_box does not answer")
        return read()

    bench.hot_box.read = lossy
    outcome, _, message = pressure.run_session(path, bench, procedure=slow)
    assert outcome is Outcome.COMPLETE, message
    assert {r.data["failure"] for r in records(path, "fault")} == faults
    assert len(lost) >= 12
    for whole_plot in events(path, "whole-plot"):
        for evidence in whole_plot.data["settling"].values():
            inside = [t for t, v in evidence["samples"] if abs(v - evidence["samples"][-1][1]) <= 0.5]
            assert evidence["seconds"] - inside[0] >= 1000.0 + 10.0 * evidence.get("missed", 0) - 10.0


def test_whole_plots_lost_are_decided_about_and_bounded(tmp_path):
    path, bench = pressure.new_run(tmp_path), PressureBench()

    def on_progress(news):
        bench.cold_box.offset = 1.0 if news.state in ("measuring", "recording") and news.done == 7 else 0.0

    outcome, *_ = run_pressure(path, bench, on_progress=on_progress)
    assert outcome is Outcome.FAULT
    lost = [("temperature_left", a) for a in ("re-soak", "re-soak", "abort")]
    assert decisions(path) == lost


@pytest.mark.parametrize("seed", range(4))
def test_whatever_fails_no_point_is_lost_or_doubled(tmp_path, seed):
    """Every call of every instrument may fail, at random; the night ends complete with every point once."""
    import random  # noqa: PLC0415

    draw = random.Random(seed)
    path = new_run(tmp_path)

    def spoil(_bench, head, reader):
        def sometimes(method):
            def call(*arguments):
                if draw.random() < 0.004:
                    raise draw.choice([NoReply("silent"), BadReply("garbled"), Unreachable("gone")])
                return method(*arguments)

            return call

        for name, method in (*HEAD, *READER):
            instrument = {"head": head, "reader": reader}[name]
            setattr(instrument, method, sometimes(getattr(instrument, method)))

    outcome, _, _, message = run_session(path, spoil=spoil)
    assert outcome is Outcome.COMPLETE, f"seed {seed}: {message}"
    complete_and_from_the_planned_sides(path)
