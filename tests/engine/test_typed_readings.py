"""Readings that a person types: asked for at each point, checked, taken twice, kept after a kill, verified."""

from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from command import rig
from few_points import Killed, records
from general_lab import (
    BATH,
    BATH_PROCEDURE,
    BATH_WORLD,
    BENCH,
    PROCEDURE,
    SOURCE,
    SOURCE_PROCEDURE,
    SOURCE_WORLD,
    WORLD,
    run_dry,
    written,
)
from test_by_hand import Answers

from rig.bench.config import parse_bench, parse_procedure
from rig.bench.typed import TypedColumn, typed_columns
from rig.engine.by_hand.to_read import ReadByHand
from rig.engine.session import Outcome, Signals
from rig.errors import ConfigurationError
from rig.run_file.events.points import Observed
from rig.run_file.read.reader import RunReader
from rig.run_file.state.state import read_state
from rig.run_file.verify.sense import judged
from rig.runs.controller import resume_run, start_run
from rig.runs.plans import load_plan
from rig.sims.serve import Hands
from rig.tables.table_of_run import run_table
from rig.unattended.happenings import RunFacts, from_record
from rig.unattended.notify.message import compose
from rig.watch.words import state_now

DIAL = """reads = { dial = "bar" }
resolution = { dial = 0.02 }
"""
GAUGE = """[sensors.gauge]
reader = "operator"
channel = "dial"
unit = "bar"
"""


def bench(options: str = DIAL, more: str = GAUGE) -> str:
    return BENCH.replace('driver = "person"\n', f'driver = "person"\n{options}').replace(
        "[factors]", f"{more}[factors]"
    )


def world(gauge: str = "2*force_kN + 0.013", person: str = "") -> str:
    return f'{WORLD}{person}[sensors.gauge]\nformula = "{gauge}"\nnoise = 1e-4\n'


ONE = PROCEDURE.replace("replications = 2", "replications = 1").replace("levels = [0, 1, 2, 5]", "levels = [1, 2]")
ONE = ONE.replace('order = "up-down"\n', "")
ALONE = "comes = false\n"  # no simulated person: requests answer


def defects(path):
    with RunReader.open(path) as reader:
        return list(judged(reader, 100).findings)


def reads(path):
    return [r.event for r in records(path, "by-hand", "read")]


def answered(tmp_path, *requests, procedure=ONE, options=DIAL, hold_max_s=600):
    """A run whose readings and settings are answered by requests; the run file, the answers, and how it ended."""
    text = f"{procedure}[recovery]\nhold_max_s = {hold_max_s}\n"
    files = written(tmp_path, text, bench(options), world(person=ALONE))
    plan = load_plan(files[0], files[1], dry=True, world=files[2])
    said: list[Answers] = []

    def announce(path):
        said.append(Answers(path, *requests))
        said[0].path = path

    progress = lambda news: said[0](news)  # noqa: E731, PLW0108 - known once the run has its name
    result = start_run(plan, tmp_path, announce=announce, on_progress=progress, signals=Signals())
    return said[0].path, said[0], result


SET = {"verb": "done"}


def typed(value):
    return {"verb": "done", "value": value, "who": "A. Reader"}


def test_a_dial_is_read_at_every_point(tmp_path):
    path, result = run_dry(tmp_path, bench=bench(), world=world())
    assert result.outcome is Outcome.COMPLETE
    table = run_table(path)
    truth = 2.0 * table.columns["force_kN"] + 0.013
    assert np.abs(table.columns["gauge_bar"] - truth).max() <= 0.0101
    steps = table.columns["gauge_bar"] / 0.02
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    assert len(reads(path)) == len(truth)
    assert defects(path) == []


def test_a_plan_says_that_somebody_has_to_read(tmp_path):
    files = written(tmp_path, bench=bench(f"{DIAL}twice = true\n"), world=world())
    said = rig("plan", files[0], "--bench", files[1])
    assert said.returncode == 0
    assert "operator reads gauge_bar (dial) at each of 14 points, twice" in said.stdout


def test_what_an_instrument_has_set_stands_while_it_is_read(tmp_path):
    """The point is not approached again after a reading: it would be another state of what has hysteresis."""
    person = f'[instruments.operator]\ndriver = "person"\n{DIAL.replace("bar", "V")}'
    text = SOURCE.replace("[factors]", f"{person}{GAUGE.replace('bar', 'V')}[factors]")
    of = f'{SOURCE_WORLD}[sensors.gauge]\nformula = "2*input_V"\nnoise = 1e-4\n'
    procedure = SOURCE_PROCEDURE.replace("[-5,0,2,5]", '[-5,0,2,5]\norder = "up-down"')
    path, result = run_dry(tmp_path, procedure, text, of)
    assert result.outcome is Outcome.COMPLETE
    assert len(reads(path)) == len(run_table(path)) == 14
    assert len(list(records(path, "event", "as-found"))) == 1
    sides = [next(iter(r.event.approach.values()))[0] for r in records(path) if isinstance(r.event, Observed)]
    planned = run_table(path).columns["input_side"]
    assert [side for side, wanted in zip(sides, planned, strict=True) if wanted] == list(planned[planned != 0])
    assert defects(path) == []


def test_a_soak_does_not_wait_for_a_thermometer_that_a_person_reads(tmp_path):
    person = f'[instruments.operator]\ndriver = "person"\n{DIAL.replace("bar", "degC")}'
    glass = '[temperatures.glass_degC]\nreader = "operator"\nchannel = "dial"\nplace = "bath_degC"\n'
    path, result = run_dry(tmp_path, BATH_PROCEDURE, BATH.replace("[factors]", f"{person}{glass}[factors]"), BATH_WORLD)
    assert result.outcome is Outcome.COMPLETE
    table = run_table(path)
    assert np.abs(table.columns["glass_degC"] - table.columns["bath_degC"]).max() < 0.1
    assert defects(path) == []


@pytest.mark.parametrize("fault", ["unplugged", "overload"])
def test_after_a_fault_what_was_typed_is_kept_until_an_observation_used_it(tmp_path, fault):
    of = f'{world()}[[faults]]\nkind = "{fault}"\non = "dvm"\nat_s = 120\nfor_s = 60\n'
    path, result = run_dry(tmp_path, bench=bench(), world=of)
    assert result.outcome is Outcome.COMPLETE
    assert result.state.decisions
    used = [r for r in records(path) if isinstance(r.event, Observed)]  # an overload is a rejected observation
    assert len(reads(path)) == len(used)
    assert (len(used) > 14) is (fault == "overload")
    assert defects(path) == []


@pytest.mark.parametrize("kind", ["reference", "thermometer"])
def test_references_and_thermometers_are_read_too(tmp_path, kind):
    tables = {
        "reference": '[references.force_kN]\nreader = "operator"\nchannel = "dial"\nformula = "0.5 * reading"\n',
        "thermometer": '[temperatures.room_degC]\nreader = "operator"\nchannel = "dial"\nplace = "lab"\n',
    }
    options = DIAL if kind == "reference" else DIAL.replace("bar", "degC")
    of = f'{WORLD}[references.force_kN]\nformula = "2*force_kN"\n' if kind == "reference" else WORLD
    path, result = run_dry(tmp_path, bench=bench(options, tables[kind]), world=of)
    assert result.outcome is Outcome.COMPLETE
    table = run_table(path)
    if kind == "reference":
        assert np.abs(table.columns["force_kN"] - table.columns["force_set_kN"]).max() < 1e-9
    else:
        assert table.columns["room_degC"] == pytest.approx(np.full(14, 23.0), abs=1.0)
    assert defects(path) == []


def test_the_run_says_what_is_wanted_and_takes_what_is_typed(tmp_path):
    path, said, result = answered(tmp_path, SET, typed("gauge_bar=2.02"), SET, typed("4 bar"))
    assert result.outcome is Outcome.COMPLETE
    wanted = next(held for held in said.held if "read" in held)
    assert "read gauge_bar (dial) in bar at force 2 kN; then `rig done" in wanted
    assert "--value V" in wanted
    assert [(e.typed, e.who, e.unit) for e in reads(path)] == [(2.02, "A. Reader", "bar"), (4.0, "A. Reader", "bar")]
    live = next(one for one in said.live if (one.get("asked") or {}).get("change") == "read")
    with RunReader.open(path) as reader:
        fold = read_state(reader)
    shown = state_now(replace(fold, ended=None), live, True, path)
    assert shown["doing"] == "waits for a person: read gauge_bar (dial) in bar at force 2 kN"
    assert shown["todo"] == f"rig done {path} --value V"
    record = next(iter(records(path, "by-hand", "asked-to-read")))
    happening = from_record(record, after_crash=False)
    assert happening is not None
    message = compose(happening, RunFacts(path, "small", "a stand", "small", False), None)
    assert message.headline.endswith("waits for a person's hand")
    assert f"Read it, then: rig done {path} --value V, where V is the reading in bar" in message.next_step


@pytest.mark.parametrize(
    ("value", "says"),
    [
        (None, "the reading is missing"),
        ("2,02", "with a point as its decimal sign"),
        ("2_0", "is not a number"),
        ("nan", "not a finite number"),
        ("2.02 kPa", "is not a number; it is gauge_bar in bar"),
        ("force_kN=2.02", "names force_kN, and gauge_bar is asked for"),
        ("12", "outside the limits of gauge_bar, -1 to 11"),
    ],
)
def test_what_makes_no_sense_is_refused(value, says):
    limits = "[limits]\ngauge_bar = [-1, 11]\n"
    config = parse_bench(bench().replace("[limits]\n", limits), "bench.toml")
    (column,) = typed_columns(config, load_conduct()).values()
    assert says in str(column.number(value))
    assert column.number(" gauge_bar = 2.02 bar") == 2.02


def load_conduct():
    return parse_procedure(PROCEDURE, "procedure.toml").conduct


def test_a_refused_number_is_asked_for_again(tmp_path):
    path, said, result = answered(tmp_path, SET, typed("2,02"), typed("2.02"), SET, typed("4.02"))
    assert result.outcome is Outcome.COMPLETE
    assert sum("decimal sign" in refused for refused in said.refused) == 1
    assert [e.typed for e in reads(path)] == [2.02, 4.02]


def test_one_that_is_far_from_the_others_at_its_setting_is_confirmed(tmp_path):
    """A slip of digits entered the run file: 4.20 for 2.04."""
    twice = ONE.replace("replications = 1", "replications = 2")
    answers = [SET, typed("2.04"), SET, typed("4.04"), SET, typed("4.20"), typed("2.02"), SET, typed("9"), typed("9")]
    path, said, result = answered(tmp_path, *answers, procedure=twice)
    assert result.outcome is Outcome.COMPLETE
    far = [refused for refused in said.refused if "far off" in refused]
    assert len(far) == 2
    assert "4.2 is far off: gauge_bar was 2.04 at this setting before (1 readings)" in far[0]
    assert [(e.typed, e.confirmed) for e in reads(path)] == [(2.04, False), (4.04, False), (2.02, False), (9.0, True)]
    assert defects(path) == []


@pytest.mark.parametrize(
    ("values", "counts", "noisy"),
    [
        (["2.02", "2.04"], [2.02, 2.04], False),
        (["2.02", "2.20", "2.04"], [2.02, 2.04], False),
        (["2.02", "2.20", "2.50"], [2.02, 2.20, 2.50], True),
    ],
)
def test_twice_and_a_third_time_if_the_two_differ(tmp_path, values, counts, noisy):
    second = [SET, typed("4.04"), typed("4.04")]
    path, said, result = answered(tmp_path, SET, *map(typed, values), *second, options=f"{DIAL}twice = true\n")
    assert result.outcome is Outcome.COMPLETE
    observed = next(r.event for r in records(path) if isinstance(r.event, Observed))
    assert observed.outputs["gauge_bar"]["readings"] == counts
    assert ("noisy" in observed.flags) is noisy
    third = [held for held in said.held if "a third time" in held]
    assert bool(third) is (len(values) == 3)
    assert all("2.02 and 2.2 bar differ" in held for held in third)
    assert [e.number for e in reads(path)] == [*range(1, len(values) + 1), 1, 2]
    assert defects(path) == []


def test_the_limit_of_scatter_of_the_procedure_counts():
    config = parse_bench(bench(f"{DIAL}twice = true\n"), "bench.toml")
    (column,) = typed_columns(config, load_conduct()).values()
    assert not column.complete([2.0, 2.1])
    wider = replace(column, max_sd=0.08)  # two readings 0.1 apart have an sd of 0.071
    assert isinstance(wider, TypedColumn)
    assert wider.complete([2.0, 2.1])
    assert not wider.complete([2.0, 2.2])


@pytest.mark.parametrize("kept", [1, 2])
def test_after_a_kill_only_what_was_not_typed_is_asked_for(tmp_path, kept):
    files = written(tmp_path, PROCEDURE, bench(f"{DIAL}twice = true\n"), world())
    plan = load_plan(files[0], files[1], dry=True, world=files[2])
    paths = []

    def killed(news):
        asked = records(paths[0], "by-hand", "read") if news.state == "holding" else ()
        if len(list(asked)) == 6 + kept:  # within the fourth point, or before its instruments are read
            raise Killed

    with pytest.raises(Killed):
        start_run(plan, tmp_path, announce=paths.append, on_progress=killed, signals=Signals())
    result = resume_run(paths[0], on_progress=lambda _: None, signals=Signals())
    assert result.outcome is Outcome.COMPLETE
    at = [(r.run_index, r.event.number) for r in records(paths[0], "by-hand", "read")]
    assert at == [(index, number) for index in range(14) for number in (1, 2)]
    assert defects(paths[0]) == []


def test_a_reading_that_is_not_what_was_typed_is_found(tmp_path, monkeypatch):
    honest = ReadByHand.hand_over

    def other(self, point):
        found = honest(self, point)
        self._bench.instruments["operator"].take({"dial": [7.0]})
        return found

    monkeypatch.setattr(ReadByHand, "hand_over", other)
    path, _ = run_dry(tmp_path, ONE, bench(), world())
    assert "its readings of gauge_bar are not what was typed (4.02 bar)" in str(defects(path)[0])


def test_nobody_reads_in_time_and_the_run_parks(tmp_path):
    _, _, result = answered(tmp_path, SET, hold_max_s=20)
    assert result.outcome is Outcome.INTERRUPTED
    assert "nobody said within" in result.message
    assert "read gauge_bar (dial) in bar at force 2 kN" in result.message


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ('reads = { dial = "bar" }\n', "dial is in one"),
        (f"{DIAL}twice = 2\n", "twice"),
        (DIAL.replace("0.02", "0"), "greater than 0"),
        (DIAL.replace("bar", "Pa"), "channel dial of operator reads Pa, not bar"),
        ("", "operator has no channel dial or any other: what a person types, `reads` names"),
    ],
)
def test_a_person_who_cannot_read_that_is_refused(tmp_path, options, says):
    with pytest.raises(ConfigurationError, match=says):
        run_dry(tmp_path, bench=bench(options), world=world())


def test_a_bench_of_rig_sim_is_read_by_its_own_person():
    truth = SimpleNamespace(person=SimpleNamespace(comes=True))
    sim = SimpleNamespace(plant=SimpleNamespace(truth=truth), reads=lambda reader, channel: 2.013, steps=0)
    told: list[bytes] = []
    Hands(sim).on_rx(json.dumps({"reader": "operator", "channel": "dial"}).encode() + b"\n", told.append)
    truth.person.comes = False
    Hands(sim).on_rx(json.dumps({"reader": "operator", "channel": "dial"}).encode() + b"\n", told.append)
    assert told == [b"2.013\n", b"nan\n"]
