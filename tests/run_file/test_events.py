"""Every event that a controller writes has a class, is stored as it always was, and is told in one sentence."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path

import pytest
from ideal_bench import new_run, run_session

from proving.night.play import play
from proving.night.scenario import LABS, draw
from rig.run_file.bodies import ContentsError
from rig.run_file.chain import Record, encode
from rig.run_file.events.bench import Warned
from rig.run_file.events.event import Event, Unknown
from rig.run_file.read.reader import RunReader
from rig.run_file.state.state import RunState
from rig.tables.faults import faults, write_faults
from rig.unattended import Kind
from rig.unattended.happenings import from_record, one_line
from rig.watch.lines import Lines

STORED = [
    json.loads(line) for line in (Path(__file__).parents[1] / "data" / "bodies-20261123.jsonl").read_text().splitlines()
]
"""Kind, status and body of one record of each shape, as nights wrote them before events had classes."""
NIGHTS = [*((lab, seed) for lab in LABS for seed in (3, 7)), ("attitude", 12)]


def record(kind, status=None, body="{}", **columns):
    return Record(
        1, kind, 60.0, 1.8e9, **({"run_index": 3, "whole_plot": 2, "attempt": 1} | columns), status=status, body=body
    )


def stored_again(one: Record) -> Record:
    event = one.event
    return one._replace(kind=event.kind, status=event.status, body=encode(event.body()))


def classes() -> set[type[Event]]:
    found, open_ = set(), [Event]
    while open_:
        found |= (below := set(open_.pop().__subclasses__()))
        open_ += below
    return found - {Unknown}


@pytest.mark.parametrize("given", STORED, ids=lambda g: f"{g['kind']}-{g['status']}-{len(g['body'])}")
def test_what_was_written_before_is_opened_and_stored_to_the_same_byte(given):
    one = record(given["kind"], given["status"], given["body"])
    assert not isinstance(one.event, Unknown)
    assert stored_again(one) == one
    assert one.sentence()


def test_every_class_was_written_before():
    written = {type(record(g["kind"], g["status"], g["body"]).event) for g in STORED}
    assert written == classes()


@pytest.mark.parametrize(("lab", "seed"), NIGHTS)
def test_what_nights_write_decodes_to_classes_and_encodes_to_the_same_bytes(lab, seed, tmp_path):
    print(f"rig night --lab {lab} --seed {seed}")
    played = play(draw(seed, lab), tmp_path)
    played.bench.close()
    assert played.path is not None
    with RunReader.open(played.path) as reader:
        found = list(reader.records())
    assert [stored_again(one) for one in found] == found
    sorts = Counter(type(one.event) for one in found)
    assert Unknown not in sorts
    assert len(sorts) > 8, sorts


@pytest.mark.parametrize("sort", sorted(classes(), key=lambda c: c.__name__), ids=lambda c: c.__name__)
def test_everybody_tells_an_event_in_its_own_sentence(sort):
    given = next(g for g in STORED if type(record(g["kind"], g["status"], g["body"]).event) is sort)
    one = record(given["kind"], given["status"], given["body"])
    importance, lines = one.event.importance, Lines()
    assert importance.page in ("", "fault", "decision", "session", "warning", "step")
    told = from_record(one, after_crash=False)
    assert (told is None) == (not importance.level)
    if told is not None:
        assert (told.text, told.level, told.kind) == (
            one_line(one.sentence()),
            importance.level,
            Kind(importance.message),
        )
    lines.add(1, one)
    assert [(line["kind"], line["words"]) for line in lines.lines] == (
        [(importance.page, one.sentence())] if importance.page else []
    )
    if isinstance(one.event, Warned):
        assert [line["words"] for line in lines.warnings] == [one.event.message]


def test_the_table_of_faults_has_the_same_sentences(tmp_path):
    path = new_run(tmp_path)
    run_session(path, spoil=lambda _bench, _head, reader: reader.overloads.update({3, 4, 5}))
    rows = faults(path)
    write_faults(rows, tmp_path / "f.csv")
    with RunReader.open(path) as reader:
        told = [one.sentence() for one in reader.records() if one.event.exported]
    assert len(rows) == len(told) > 3
    assert all(sentence in (tmp_path / "f.csv").read_text() for sentence in told)


def test_an_event_of_another_version_is_told_with_what_it_says_itself():
    one = record("event", "lamp-lit", '{"why":"dusk"}')
    assert isinstance(one.event, Unknown)
    assert one.sentence() == "event lamp lit at point 3: dusk"


def test_fields_of_a_later_version_are_passed_over_and_of_an_earlier_one_may_be_missing():
    assert record("hold", body='{"why":"asked for","by":"A. B."}').sentence() == "held at point 3: asked for"
    assert record("hold").sentence() == "held at point 3"
    with pytest.raises(ContentsError, match=r"the record to be written \(skip of point 3\): its body has no reason"):
        _ = record("skip", "later").event


def test_an_identity_that_says_less_is_compared_by_what_it_says():
    state = RunState()
    state.add(record("identity", "head", '{"maker":"Newport"}'))
    assert {name: state.identities["head"][name] for name in ("maker", "model", "serial")} == {
        "maker": "Newport",
        "model": None,
        "serial": None,
    }


def test_a_kind_of_record_that_is_no_text_is_told_too():
    assert record(b"\xff-x", 7).event == Unknown(sort="b'\\xff x' 7", content={})
