"""Readings of a point: what is too noisy, out of range, hanging, or not read at the pressure that was wanted."""

from __future__ import annotations

from dataclasses import replace

import ideal_bench
import ideal_pressure_bench as pressure
import pytest
from few_points import (
    LEGS,
    MOST_MV,
    PARKED,
    Killed,
    accepted,
    attitude,
    kill_where,
    records,
    run,
    run_whole_plots,
    session_of_whole_plots,
    whole_plot,
)
from ideal_bench import CONFIG, new_run, run_session

from rig.engine.session import Outcome


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
    outcome, message = session_of_whole_plots(path, procedure, bench)
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


def noisy_at(*starts):
    def spoil(_bench, _head, reader):
        start = reader.start

        def start_noisy(count):
            due = start(count)
            reader.noise_V = 0.01 if reader.starts in starts else 0.0
            return due

        reader.start = start_noisy

    return spoil


def test_readings_that_scatter_as_much_as_they_may_are_not_noisy(tmp_path):
    most = 2.0**-10

    def spoil(_bench, _head, reader):
        fetch = reader.fetch
        reader.fetch = lambda: {**fetch(), "1": [0.5 - most, 0.5 - most, 0.5, 0.5 + most, 0.5 + most]}

    path, _ = run(tmp_path, attitude(measure={"readings": 5, "max_sd_V": most, "repeats": 0}), spoil=spoil)
    assert [(r.data["outputs"]["x_V"]["sd"], r.data["flags"]) for r in accepted(path)] == [(most, [])] * 4


def test_a_noisy_point_is_read_again_so_often_and_all_of_it_is_kept(tmp_path):
    procedure = attitude(measure={"readings": 4, "max_sd_V": 1e-3, "repeats": 2})
    path, head = run(tmp_path, procedure, spoil=noisy_at(1, 2, 3, 5, 7, 8))
    kept = [r.data.get("rejected", []) for r in accepted(path)]
    assert [len(again) for again in kept] == [2, 0, 1, 2]
    assert [r.data["flags"] for r in accepted(path)] == [["noisy"], [], [], []]
    for again in (again for point in kept for again in point):
        assert again["noisy"] == "x_V"
        assert again["outputs"]["x_V"]["sd"] == pytest.approx(0.01 * (4 / 3) ** 0.5)
    assert head.sent == [*LEGS, PARKED], "nothing is moved for it"


# --- out of range, hanging ---


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


@pytest.mark.parametrize("accepts", [False, True])
def test_outputs_that_hang_are_told_with_the_point_or_flagged(tmp_path, accepts):
    def spoil(_bench, _head, reader):
        fetch, seen = reader.fetch, []

        def hanging():
            seen.append(fetch())
            return seen[1] if reader.starts in (3, 4) else seen[-1]

        reader.fetch = hanging

    path, _ = run(tmp_path, attitude(faults={"frozen": ["accept"]} if accepts else {}), spoil=spoil)
    words = "x_V at point 2 hangs: the same reading to the last digit, again and again"
    found = [(r.run_index, r.status, r.data["fault"], r.data["message"]) for r in records(path, "fault")]
    assert found == [(2, "retry", "frozen", words)] * (0 if accepts else 2)
    assert [r.data["flags"] for r in accepted(path)] == [[], [], ["frozen"] * accepts, ["frozen"] * accepts]


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


def test_a_sensor_that_stands_still_at_a_setting_that_is_not_left_is_believed_by_the_next_session(tmp_path):
    again = attitude(replications=3, design={"type": "D", "pitch_deg": [-30], "roll_deg": [0]})
    path = new_run(tmp_path, again)

    def coarse(_bench, _head, reader):
        fetch = reader.fetch
        reader.fetch = lambda: {**fetch(), "1": [-0.5] * 4}

    with pytest.raises(Killed):
        run_session(path, procedure=again, spoil=coarse, on_progress=kill_where(lambda news: news.done == 1))
    assert run_session(path, procedure=again, spoil=coarse)[0] is Outcome.COMPLETE
    assert len(accepted(path)) == 3
    assert records(path, "fault") == []


def reading_twice(monkeypatch, unit):
    """The bench reads the same sensor twice, the second time in this unit."""
    fetch = ideal_bench.IdealReader.fetch
    sensors = CONFIG.sensors | {"y": CONFIG.sensors["x"].model_copy(update={"channel": "3", "unit": unit})}
    monkeypatch.setattr(ideal_bench, "CONFIG", CONFIG.model_copy(update={"sensors": sensors}))
    monkeypatch.setattr(ideal_bench.IdealReader, "channels", lambda _self: ("1", "2", "3"))
    monkeypatch.setattr(ideal_bench.IdealReader, "fetch", lambda self: (found := fetch(self)) | {"3": found["1"]})


def test_the_noisiest_of_outputs_in_different_units_is_told_by_their_volts(tmp_path, monkeypatch):
    reading_twice(monkeypatch, "mV")

    def spoil(_bench, _head, reader):
        reader.noise_V, fetch = 2e-3, reader.fetch
        reader.fetch = lambda: (found := fetch()) | {"3": [0.01 * volts for volts in found["1"]]}  # 23 uV: 0.023 mV

    path, _ = run(tmp_path, attitude(measure={"readings": 4, "max_sd_V": 1e-3, "repeats": 1}), spoil=spoil)
    for seen in accepted(path):
        outputs = seen.data["outputs"]
        assert outputs["x_V"]["sd"] < outputs["y_mV"]["sd"]
        assert (seen.data["flags"], [again["noisy"] for again in seen.data["rejected"]]) == (["noisy"], ["x_V"])


def test_several_outputs_at_once_are_all_named(tmp_path, monkeypatch):
    reading_twice(monkeypatch, "V")

    def spoil(bench, head, reader):
        overloaded_at(2)(bench, head, reader)
        fetch, seen = reader.fetch, []

        def hanging():
            seen.append(fetch())
            return seen[2] if reader.starts == 4 else seen[-1]

        reader.fetch = hanging

    path, _ = run(tmp_path, spoil=spoil)
    assert [r.data["message"] for r in records(path, "fault")] == [
        "x_V, y_V out of range at point 1",
        "x_V, y_V at point 2 hangs: the same reading to the last digit, again and again",
    ]


# --- what sensors are calibrated against ----------------------------------------------------------------------


BAND = 0.0625
"""A power of two, so that a readback can stand exactly at a limit."""


def while_measured(bench, bands):
    """While 2.5 psi is measured the supply reads this much off, in bands; the first time only."""
    read, now, left = bench.supply.read, [""], list(bands)

    def read_off():
        state = read()
        if now[0] != "measuring" or state.setpoint_psia != 2.5 or not left:
            return state
        return replace(state, pressure_psia=2.5 + BAND * left.pop(0))

    bench.supply.read = read_off
    return lambda news: now.__setitem__(0, news.state)


SCATTER = [-0.5, 0.5, -0.5, 0.5, -0.5]


@pytest.mark.parametrize(
    ("bands", "worst"),
    [
        ([0.0, 0.0, 0.0, 0.0, 0.0, 0.0], None),
        ([0.0, 0.0, 1.0, 0.0, 0.0, 0.0], None),  # at the band itself
        ([0.0, 0.0, 3.0, 0.0, 0.0, 0.0], 2.6875),
        ([0.0, 0.0, -3.0, 1.0, 0.0, 0.0], 2.3125),
        ([*SCATTER, 4.0], None),  # six standard deviations of a scatter of half a band are 4.4 bands
        ([*SCATTER, 5.0], 2.8125),
        ([0.5, 1.5, 0.5, 1.5, 0.5, 1.5], None),  # a mean at the band itself
        ([1.0, 1.5, 2.0, 2.5, 3.0, 3.5], 2.71875),  # no stray one, but a mean off by more than the band
    ],
)
def test_a_pressure_stood_while_the_sensor_was_read(tmp_path, bands, worst):
    settle = {"dwell_s": 2.0, "band_psia": BAND, "poll_s": 1.0}
    measure = {"readings": 2 * len(bands) - 2}  # at two a second
    procedure = whole_plot(settle=settle, approach={"overtravel_psia": 0.5}, measure=measure)
    bench = pressure.PressureBench()
    path = run_whole_plots(tmp_path, procedure, bench, on_progress=while_measured(bench, bands))
    words = f"pressure read {worst:g} while it was measured, not within 0.0625 of 2.5" if worst else ""
    found = [(r.run_index, r.data["message"], list(r.data["evidence"])) for r in records(path, "fault")]
    assert found == [(0, words, ["pressure"])] * bool(worst)
    seen = accepted(path)[0].data["references"]["pressure_psia"]["readings"]
    assert seen == [2.5 + BAND * (0.0 if worst else b) for b in bands]
