"""Whole plots on ideal instruments: soak, order inside them, and what an interruption costs."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from ideal_pressure_bench import EACH, IN_ALL, PROCEDURE, PressureBench, new_run, run_session

from rig.drivers.errors import NoReply
from rig.engine.session import Outcome, Signals
from rig.run_file.read.reader import RunReader


class Killed(BaseException):
    """Stands for SIGKILL: nothing of ours runs after it."""


def records(path, kind=None):
    with RunReader.open(path) as reader:
        reader.verify()
        return list(reader.records(kind))


def accepted(path):
    return [r for r in records(path, "observation") if r.status == "accepted"]


def events(path, status):
    return [r for r in records(path, "event") if r.status == status]


def killed_at(done, path, bench, **options):
    """A session that is killed as soon as `done` points are done; the bench keeps what it was last told."""

    def on_progress(news):
        if news.done >= done:
            raise Killed

    # An unforeseen exception makes the bench safe, which a SIGKILL does not.
    make_safe = [(b, b.make_safe) for b in (bench.cold_box, bench.hot_box, bench.supply)]
    for instrument, _ in make_safe:
        instrument.make_safe = lambda: None
    with pytest.raises(Killed):
        run_session(path, bench, on_progress=on_progress, **options)
    for instrument, method in make_safe:
        instrument.make_safe = method


def test_every_point_is_observed_once_inside_its_own_whole_plot(tmp_path):
    path, bench = new_run(tmp_path), PressureBench()
    outcome, state, message = run_session(path, bench)
    assert outcome is Outcome.COMPLETE, message
    seen = accepted(path)
    assert [r.run_index for r in seen] == list(range(IN_ALL))
    assert [r.whole_plot for r in seen] == [1] * EACH + [2] * EACH + [3] * EACH, "identity, not temperature"
    assert state.whole_plots == 3
    assert not state.lost


def test_a_soak_ends_when_chamber_and_thermometer_have_both_settled(tmp_path):
    path, bench = new_run(tmp_path), PressureBench()
    run_session(path, bench)
    soaks = events(path, "whole-plot")
    assert [s.data["setpoints_degC"] for s in soaks] == [
        {"cold_box": p.setpoints[1], "hot_box": p.setpoints[2]} for p in PROCEDURE.expand().points[::EACH]
    ]
    for soak in soaks:
        assert set(soak.data["settling"]) == {"cold_box", "hot_box", "sensor_temperature_degC"}
        for evidence in soak.data["settling"].values():
            assert evidence["outcome"] == "settled"
            last = [value for t, value in evidence["samples"] if t >= evidence["seconds"] - 60]
            assert max(last) - min(last) < 0.5


def test_a_pressure_that_follows_itself_is_set_anew_and_the_reference_is_recorded(tmp_path):
    path, bench = new_run(tmp_path), PressureBench()
    run_session(path, bench)
    points = PROCEDURE.expand().points
    again = [
        b.index
        for a, b in itertools.pairwise(points)
        if a.whole_plot == b.whole_plot and a.setpoints[0] == b.setpoints[0]
    ]
    assert again, "this seed has such a pair"
    assert 2.55 in bench.supply.sent
    for record in accepted(path):
        target = points[record.run_index].setpoints[0]
        assert record.data["references"]["pressure_psia"]["mean"] == pytest.approx(target, abs=1e-9)
        assert record.data["outputs"]["bridge_mV"]["mean"] == pytest.approx(2 * target, abs=1e-9)


def test_after_a_short_gap_the_whole_plot_goes_on_through_its_previous_pressure(tmp_path):
    path, bench = new_run(tmp_path), PressureBench()
    killed_at(7, path, bench)
    before = len(bench.cold_box.sent)
    sent = len(bench.supply.sent)
    outcome, state, message = run_session(path, bench, gap_s=120.0)
    assert outcome is Outcome.COMPLETE, message
    assert [r.whole_plot for r in accepted(path)] == [1] * EACH + [2] * EACH + [3] * EACH
    assert not state.lost
    points = PROCEDURE.expand().points
    second = [p.setpoints[0] for p in points[6:8]]
    assert [p for p in bench.supply.sent[sent:] if p in second][:2] == second
    assert len(bench.cold_box.sent) == before + 2, "the third soak's and the final safe state's; none for the second"


@pytest.mark.parametrize(
    ("spoil", "options", "why"),
    [
        (lambda bench: None, {"gap_s": 1200.0}, "continue_gap_s"),
        (lambda bench: None, {"certain": False}, "restarted"),
        (PressureBench.power_cut, {}, "no power"),
        (lambda bench: bench.cold_box.command(20.0), {}, "set to 20 degC"),
        (lambda bench: setattr(bench.hot_box, "on", False), {}, "not controlling"),
        (lambda bench: setattr(bench.hot_box, "offset", 0.8), {}, "hot_box is at"),
    ],
)
def test_a_whole_plot_that_may_have_changed_is_measured_again_under_a_new_identity(tmp_path, spoil, options, why):
    path, bench = new_run(tmp_path), PressureBench()
    killed_at(8, path, bench)
    spoil(bench)

    def mend(_news):
        if events(path, "whole-plot-lost"):
            bench.hot_box.offset = 0.0

    outcome, state, message = run_session(path, bench, on_progress=mend, **options)
    assert outcome is Outcome.COMPLETE, message
    (lost,) = events(path, "whole-plot-lost")
    assert why in lost.data["reason"]
    assert lost.data["kept"] == 3
    assert list(state.lost) == [2]
    seen = accepted(path)
    assert [r.run_index for r in seen if r.whole_plot == 2] == [5, 6, 7], "what was read stays, in its own whole plot"
    assert [r.run_index for r in seen if r.whole_plot == 3] == [5, 6, 7, 8, 9]
    assert [r.run_index for r in seen if r.whole_plot == 4] == [10, 11, 12, 13, 14]


def test_a_kill_while_soaking_costs_nothing_but_the_soak(tmp_path):
    path, bench = new_run(tmp_path), PressureBench()
    soaking = []

    class _Kill(Killed):
        pass

    def on_progress(news):
        if news.state == "preparing" and news.done == EACH:
            soaking.append(f"{news.message}: {news.detail}")
            if len(soaking) == 5:
                raise _Kill

    with pytest.raises(_Kill):
        run_session(path, bench, on_progress=on_progress)
    assert soaking[-1].startswith("soaking for whole plot 2 of 3: cold_box")
    outcome, state, _ = run_session(path, bench)
    assert outcome is Outcome.COMPLETE
    assert not state.lost
    assert [r.whole_plot for r in accepted(path)] == [1] * EACH + [2] * EACH + [3] * EACH


def test_a_chamber_that_drifts_while_pressures_are_set_costs_the_whole_plot_not_its_readings(tmp_path):
    path, bench = new_run(tmp_path), PressureBench()

    def on_progress(news):
        bench.cold_box.offset = 1.0 if news.done == 8 and not events(path, "whole-plot-lost") else 0.0

    outcome, state, message = run_session(path, bench, on_progress=on_progress)
    assert outcome is Outcome.COMPLETE, message
    assert list(state.lost) == [2]
    rejected = [r for r in records(path, "observation") if r.status == "rejected"]
    assert len(rejected) == 1
    assert "cold_box is at" in rejected[0].data["lost"]
    assert [r.run_index for r in accepted(path) if r.whole_plot == 2] == [5, 6, 7]


def test_a_whole_plot_that_is_lost_again_and_again_is_a_fault_that_names_the_way_forward(tmp_path):
    path, bench = new_run(tmp_path), PressureBench()

    def on_progress(news):
        bench.cold_box.offset = 1.0 if news.state in ("measuring", "recording") and news.done == 7 else 0.0

    outcome, state, message = run_session(path, bench, on_progress=on_progress)
    assert outcome is Outcome.FAULT
    assert "lost 3 times in this session" in message
    assert "then resume" in message
    assert bench.supply.safe == 1
    outcome, state, message = run_session(path, bench)
    assert outcome is Outcome.COMPLETE, message
    assert len(state.lost) == 3


def test_a_pressure_that_does_not_settle_is_put_off_and_tried_again_in_its_own_whole_plot(tmp_path):
    path, bench = new_run(tmp_path), PressureBench()
    read = bench.supply.read

    def unsettled_at_first():
        state = read()
        return replace(state, in_limits=bench.supply.setpoint != 1.0 or bench.supply.sent.count(1.0) > 9)

    bench.supply.read = unsettled_at_first
    outcome, _, message = run_session(path, bench)
    assert outcome is Outcome.COMPLETE, message
    order = [r.run_index for r in accepted(path)]
    late = next(p.index for p in PROCEDURE.expand().points if p.setpoints[0] == 1.0)
    assert order.index(late) == EACH - 1, "last of its whole plot"
    assert sorted(order) == list(range(IN_ALL))
    assert {r.whole_plot for r in accepted(path)} == {1, 2, 3}


def test_a_stray_readback_while_the_sensors_are_read_does_not_become_their_reference(tmp_path):
    path, bench = new_run(tmp_path), PressureBench()
    read, start, strayed, due = bench.supply.read, bench.dvm.start, [], []

    def counted(count):
        if count > 1 and not strayed:  # a sweep of a point; soaks read one sweep
            due.append(True)
        return start(count)

    def strays_once():
        state = read()
        if due and not strayed:
            strayed.append(state.pressure_psia)
            return replace(state, pressure_psia=state.pressure_psia + 0.05)
        return state

    bench.dvm.start, bench.supply.read = counted, strays_once
    outcome, _, message = run_session(path, bench)
    assert outcome is Outcome.COMPLETE, message
    assert len(strayed) == 1
    (fault,) = records(path, "fault")
    assert "not within 0.002 of" in fault.data["message"], fault.data
    for record in accepted(path):
        reference, setpoint = record.data["references"]["pressure_psia"], PROCEDURE.expand().points[record.run_index]
        assert reference["readings"] == pytest.approx([setpoint.setpoints[0]] * len(reference["readings"]), abs=1e-9)


def test_a_reference_that_is_noisy_is_no_stray_one(tmp_path):
    """Of forty readbacks with half the band for standard deviation two are outside it; their mean is not."""
    rng = np.random.default_rng(11)
    procedure = PROCEDURE.model_copy(update={"measure": PROCEDURE.measure.model_copy(update={"readings": 40})})
    path, bench = new_run(tmp_path, procedure), PressureBench()
    read = bench.supply.read

    def noisy():
        state = read()
        return replace(state, pressure_psia=state.pressure_psia + rng.normal(0.0, 0.001))

    bench.supply.read = noisy
    outcome, _, message = run_session(path, bench, procedure=procedure)
    assert outcome is Outcome.COMPLETE, message
    assert not [r for r in records(path, "fault") if "while it was measured" in r.data["message"]]
    assert max(r.data["references"]["pressure_psia"]["sd"] for r in accepted(path)) > 0.0008


@pytest.mark.parametrize(("policy", "outcome"), [("abort", Outcome.FAULT), ("hold", Outcome.FAULT)])
def test_a_soak_that_never_settles_ends_in_the_safe_state_and_says_which_chamber(tmp_path, policy, outcome):
    procedure = PROCEDURE.model_copy(
        update={
            "soak": PROCEDURE.soak.model_copy(update={"timeout_s": 7200.0}),
            "faults": PROCEDURE.faults.model_copy(update={"soak": policy}),
            "recovery": PROCEDURE.recovery.model_copy(update={"hold_max_s": 3.0}),
        }
    )
    path, bench = new_run(tmp_path, procedure), PressureBench()
    bench.hot_box.offset = 2.0
    found, _, message = run_session(path, bench, procedure=procedure)
    assert found is outcome
    assert bench.supply.safe
    if policy == "abort":
        assert "the soak failed: hot_box timed-out after 72" in message
    else:
        assert [r.kind for r in records(path) if r.kind == "hold"]
        assert "nobody released it" in message


def test_an_open_thermometer_ends_a_soak_at_once(tmp_path):
    path, bench = new_run(tmp_path), PressureBench()
    bench.dvm.open_thermometer = True
    outcome, state, message = run_session(path, bench)
    assert outcome is Outcome.FAULT
    assert "sensor_temperature_degC reads open or out of range" in message
    assert state.elapsed_s < 120


def test_a_chamber_alarm_ends_the_session_safe_and_the_resumed_run_measures_the_whole_plot_again(tmp_path):
    path, bench = new_run(tmp_path), PressureBench()

    def on_progress(news):
        bench.hot_box.alarms = ("high",) if news.done == 6 else ()

    outcome, _, message = run_session(path, bench, on_progress=on_progress)
    assert outcome is Outcome.FAULT
    assert "hot_box reports an alarm: high" in message
    bench.hot_box.alarms = ()
    outcome, state, message = run_session(path, bench)
    assert outcome is Outcome.COMPLETE, message
    assert list(state.lost) == [2]


def test_a_signal_leaves_the_chambers_holding_and_a_short_gap_costs_nothing(tmp_path):
    path, bench = new_run(tmp_path), PressureBench()
    signals = Signals()

    def interrupt(news):
        if news.done == 6:
            signals.interrupt = "SIGTERM"

    outcome, _, _ = run_session(path, bench, signals=signals, on_progress=interrupt)
    assert outcome is Outcome.INTERRUPTED
    assert not bench.cold_box.safe, "the chambers go on holding"
    outcome, state, _ = run_session(path, bench, gap_s=30.0)
    assert outcome is Outcome.COMPLETE
    assert not state.lost


def at(news_when, act):
    """A progress callback that acts once, as soon as a condition on the news holds."""
    acted = []

    def on_progress(news):
        if news_when(news) and not acted:
            acted.append(act())

    return on_progress


def test_a_power_cut_is_noticed_while_the_controller_lives(tmp_path):
    path, bench = new_run(tmp_path), PressureBench()

    def cut():
        bench.power_cut()
        bench.cold_box.on = bench.hot_box.on = True  # these take up where they were, and cannot tell

    outcome, state, message = run_session(path, bench, on_progress=at(lambda n: n.done == 7, cut))
    assert outcome is Outcome.COMPLETE, message
    assert "had no power meanwhile" in state.lost[2]
    assert [r.run_index for r in accepted(path) if r.whole_plot == 3] == [5, 6, 7, 8, 9]


@pytest.mark.parametrize(
    ("disturb", "words"),
    [
        (lambda bench: setattr(bench.hot_box, "on", False), "hot_box is not controlling any more"),
        (lambda bench: bench.hot_box.command(30.0), "hot_box is set to 30 degC, not to"),
    ],
)
def test_a_chamber_that_somebody_changes_during_a_soak_is_noticed_at_once(tmp_path, disturb, words):
    path, bench = new_run(tmp_path), PressureBench()
    soaking = at(lambda n: n.state == "preparing" and n.done == EACH and "hot_box" in n.detail, lambda: disturb(bench))
    outcome, state, message = run_session(path, bench, on_progress=soaking)
    assert outcome is Outcome.FAULT
    assert words in message
    assert state.elapsed_s < 4000


def test_an_instrument_that_fails_in_a_soak_has_its_retries(tmp_path):
    path, bench = new_run(tmp_path), PressureBench()
    read, failing = bench.hot_box.read, [3]  # two lost replies in a row are borne

    def sometimes():
        if failing[0] and bench.hot_box.sent and bench.hot_box.value() > 5.0:
            failing[0] -= 1
            raise NoReply("hot_box did not answer")
        return read()

    bench.hot_box.read = sometimes
    outcome, _, message = run_session(path, bench)
    assert outcome is Outcome.COMPLETE, message
    retries = [r for r in records(path, "fault") if r.status == "retry"]
    assert retries
    assert all("did not answer" in r.data["message"] for r in retries)


def test_temperatures_that_stand_are_left_before_a_whole_plot_is_measured_again(tmp_path):
    path, bench = new_run(tmp_path), PressureBench()
    killed_at(8, path, bench)
    sent = len(bench.cold_box.sent)
    outcome, state, _ = run_session(path, bench, gap_s=1200.0)
    assert outcome is Outcome.COMPLETE
    assert list(state.lost) == [2]
    away, back = bench.cold_box.sent[sent : sent + 2]
    assert away == back + PROCEDURE.soak.renew_degC
    assert [r.data["planned"] for r in events(path, "temperatures-left")] == [1, 2, 2, 3]


def test_leaving_that_was_cut_short_is_done_again(tmp_path):
    path, bench = new_run(tmp_path), PressureBench()
    killed_at(8, path, bench)

    class _Kill(Killed):
        pass

    def on_progress(news):
        if "leaving temperatures" in news.message:
            raise _Kill

    for instrument in (bench.cold_box, bench.hot_box, bench.supply):
        instrument.make_safe = lambda: None
    with pytest.raises(_Kill):
        run_session(path, bench, gap_s=1200.0, on_progress=on_progress)
    for instrument in (bench.cold_box, bench.hot_box, bench.supply):
        del instrument.make_safe
    for instrument in (bench.cold_box, bench.hot_box):
        instrument.command(instrument.setpoint - PROCEDURE.soak.renew_degC)
    outcome, _, _ = run_session(path, bench)
    assert outcome is Outcome.COMPLETE
    assert len(events(path, "renewing")) == 2


def test_a_loss_that_was_found_and_not_finished_still_is_a_loss(tmp_path):
    """The rejected reading and the loss are one commit: no kill comes between them."""
    path, bench = new_run(tmp_path), PressureBench()

    def on_progress(news):
        bench.cold_box.offset = 1.0 if news.done == 8 and not events(path, "whole-plot-lost") else 0.0

    run_session(path, bench, on_progress=on_progress)
    everything = records(path)
    rejected = next(i for i, r in enumerate(everything) if r.status == "rejected")
    assert everything[rejected + 1].status == "whole-plot-lost"
    assert everything[rejected + 1].elapsed_s == everything[rejected].elapsed_s
