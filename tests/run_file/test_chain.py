"""The hash chain: every record's hash is that of its JSON after its predecessor's, whichever way it is found."""

from __future__ import annotations

import hashlib
import json
import math

import pytest

from rig.run_file import chain
from rig.run_file.chain import GENESIS, Record, encode, followed, link

BODIES = {
    "empty": "{}",
    "plain": '{"a":1.5}',
    "escaped": '{"a":"\\u00b0 \\"x\\" \\\\ \\n"}',
    "control": '{"a":\n\t"\x00\x1f\x7f"}',
    "not ASCII": '{"a":"23 °C"}',
    "both": '{"a":"\\ 23 °C"}',
}
ORDINARY = Record(1, "observation", 10.25, 1.7e9, 4, 2, 1, "accepted", '{"a":"\\\\ \\"b\\" 1.5"}')
WITHOUT: list[dict[str, object]] = [{}, {"whole_plot": None}, {"run_index": None}, {"attempt": None}, {"status": None}]


def by_definition(previous, seq, record):
    """As docs say it: SHA-256 of the hash before and of the record as compact JSON, ASCII only."""
    text = json.dumps([seq, *record], separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(previous + text.encode("ascii")).digest()


def stored(records, previous=GENESIS, first=1):
    """Rows as the writer stores them, each with its hash by definition."""
    rows = []
    for seq, record in enumerate(records, first):
        own = by_definition(previous, seq, record)
        rows.append((seq, *record, previous, own))
        previous = own
    return rows


@pytest.fixture
def spelled(monkeypatch):
    """What was spelled as JSON by the library, after the words of ordinary records are known."""
    link(GENESIS, 1, ORDINARY)
    link(GENESIS, 1, ORDINARY._replace(status=None))
    dumps, done = json.dumps, []
    monkeypatch.setattr(chain.json, "dumps", lambda value, **how: (done.append(value), dumps(value, **how))[1])
    return done


@pytest.fixture
def slowly(monkeypatch):
    """Rows that were looked at by the slower way."""
    holds, done = chain._holds, []
    monkeypatch.setattr(chain, "_holds", lambda row: (done.append(row), holds(row))[1])
    return done


@pytest.mark.parametrize("body", BODIES)
def test_a_hash_is_that_of_the_record_as_json(body):
    for missing in (*WITHOUT, dict.fromkeys(("run_index", "whole_plot", "attempt", "status"))):
        record = ORDINARY._replace(body=BODIES[body], **missing)
        assert link(b"\x01" * 32, 7, record) == by_definition(b"\x01" * 32, 7, record), missing


ODD: list[dict[str, object]] = [
    {"session": True}, {"session": 1.0}, {"session": None}, {"session": "1"}, {"elapsed_s": 10}, {"elapsed_s": None},
    {"utc_s": 5}, {"utc_s": "x"}, {"elapsed_s": 1e300, "utc_s": 1e-300}, {"run_index": False}, {"run_index": 4.0},
    {"whole_plot": True}, {"whole_plot": "2"}, {"attempt": 1.0}, {"attempt": True}, {"kind": None},
    {"kind": 'a "b" °'}, {"kind": 5}, {"status": 5}, {"body": None}, {"body": 5}, {"body": ["{}"]},
]  # fmt: skip


@pytest.mark.parametrize("odd", ODD)
def test_what_a_damaged_file_may_hold_is_hashed_as_json_too(odd):
    record = ORDINARY._replace(**odd)
    assert link(GENESIS, 3, record) == by_definition(GENESIS, 3, record)


@pytest.mark.parametrize("none", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("column", ["elapsed_s", "utc_s", "run_index"])
def test_a_number_that_json_does_not_have_cannot_be_hashed(column, none):
    with pytest.raises(ValueError, match="not JSON compliant"):
        link(GENESIS, 1, ORDINARY._replace(**{column: none}))
    assert followed([(1, *ORDINARY._replace(**{column: none}), GENESIS, bytes(32))], 1, GENESIS) == 0


def test_a_body_is_compact_json_without_nan():
    assert encode({"a": [1, 2.5], "b": {"c": "°"}}) == '{"a":[1,2.5],"b":{"c":"\\u00b0"}}'
    with pytest.raises(ValueError, match="not JSON compliant"):
        encode({"a": math.nan})


@pytest.mark.parametrize(
    ("body", "says"),
    ids=["none", "deep", "list", "cut"],
    argvalues=[
        (None, "no text"),
        ("[" * 100_000, "nested too deeply"),
        ("[]", "JSON, but not an object"),
        ("{", "Expecting"),
    ],
)
def test_a_body_that_is_no_object_is_refused(body, says):
    with pytest.raises(ValueError, match=says):
        _ = ORDINARY._replace(body=body).data


@pytest.mark.parametrize("missing", WITHOUT)
def test_nothing_but_the_words_of_an_ordinary_record_is_spelled_by_the_library(spelled, missing):
    """A hundred thousand of them are hashed while somebody waits."""
    link(GENESIS, 1, ORDINARY._replace(body='{"a":"b"}', **missing))
    assert spelled == []
    link(GENESIS, 1, ORDINARY._replace(body='{"a":"\\\\"}'))
    assert spelled == ['{"a":"\\\\"}']


@pytest.mark.parametrize("first", [1, 12])
def test_rows_that_follow_one_another_are_counted(slowly, first):
    rows = stored([ORDINARY._replace(whole_plot=w, run_index=i) for i, w in enumerate((2, None, 3))], b"\2" * 32, first)
    assert followed(rows, first, b"\2" * 32) == 3
    assert slowly == [], "observations are hashed by the faster way"
    assert followed(rows, first + 1, b"\2" * 32) == 0
    assert followed(rows, first, b"\3" * 32) == 0
    assert followed([rows[0], rows[2]], first, b"\2" * 32) == 1
    assert followed(rows[1:], first + 1, rows[0][-1]) == 2
    assert followed([], first, GENESIS) == 0


@pytest.mark.parametrize("odd", [*WITHOUT, *ODD])
def test_unusual_rows_are_counted_too(odd):
    for body in BODIES.values():
        odd_row = ORDINARY._replace(**{"body": body, **odd})
        assert followed(stored([ORDINARY, odd_row, ORDINARY]), 1, GENESIS) == 3, body


COLUMNS = {
    "session": 2, "kind": "skip", "elapsed_s": 10.5, "utc_s": 1.6e9, "run_index": 5, "whole_plot": 3, "attempt": 2,
    "status": "rejected", "body": '{"a":2}',
}  # fmt: skip


@pytest.mark.parametrize("column", COLUMNS)
def test_a_row_that_was_changed_ends_what_is_counted(column):
    for missing in WITHOUT:
        records = [ORDINARY, ORDINARY._replace(**missing), ORDINARY]
        rows = stored(records)
        changed = records[1]._replace(**{column: COLUMNS[column]})
        rows[1] = (2, *changed, *rows[1][-2:])
        assert followed(rows, 1, GENESIS) == 1, missing


@pytest.mark.parametrize("column", ["session", "run_index", "whole_plot", "attempt"])
def test_a_row_hashed_in_another_spelling_than_json_does_not_count(column):
    """True reads otherwise in Python than in JSON: who hashed it as Python spells it was not this library."""
    record = ORDINARY._replace(**{column: True})
    text = json.dumps([1, *record], separators=(",", ":"))
    assert text.count("true") == 1
    own = hashlib.sha256(GENESIS + text.replace("true", "True").encode()).digest()
    assert followed([(1, *record, GENESIS, own)], 1, GENESIS) == 0
