"""Sets of hidden causes that strangers write: seal, judge's list, classes of answers (proving/strangers)."""

from __future__ import annotations

import json
from hashlib import sha256
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from strangers_tables import table

from proving.frame import main
from proving.strangers.judge import Judged, judge_of
from proving.strangers.runs import scored
from proving.strangers.scoring import CLASSES, alarm, class_of, found, said_of
from proving.strangers.sets import digest_of, load, opened, sealed
from proving.strangers.shares import wilson
from proving.strangers.traced import options_of, traced
from rig.errors import UsageError

ONE_SIDED_V = 7.53192638e-4
"""What its author's code adds to x_V for |sin(pitch)| = 1."""

TABLE = '''"""A stranger's set, small."""
from types import SimpleNamespace

import numpy as np

from . import general

KINDS = {"general": general}


def table(kind, effects, seed, size, noise="white"):
    rng = np.random.default_rng([seed, len(effects)])
    n = 60
    x, room = np.tile(np.linspace(0, 10, 12), 5), rng.normal(20, 1, n)
    x = rng.permutation(x)
    hidden = np.zeros(n)
    for name in effects:
        shape = KINDS[kind].EFFECTS[name](x, room)
        basis = np.column_stack([np.ones(n), x])
        left = shape - basis @ np.linalg.lstsq(basis, shape, rcond=None)[0]
        hidden = hidden + size * shape / np.sqrt(np.mean(left**2))
    y = 3 + 2 * x + hidden + KINDS[kind].NOISES[noise](rng, n)
    lines = ["x_mm,room_degC,y_mV", *(f"{a:.6g},{b:.6g},{c:.10g}" for a, b, c in zip(x, room, y))]
    options = ["--response", "y_mV", "--formula", "1 + x_mm"]
    return SimpleNamespace(csv="\\n".join(lines) + "\\n", options=options, size=size, hidden=hidden)
'''
GENERAL = """import numpy as np

EFFECTS = {
    "bend": lambda x, room: x**2,
    "comb": lambda x, room: (np.floor(room * 40) % 2) * 1.0,
}
PAIRS = [["bend", "comb"]]
ABOUT = {"bend": "The beam gives way.\\nOver x.", "comb": "A comb over the third digit of the room's temperature."}
NOISES = {
    "white": lambda rng, n: rng.standard_normal(n),
    "heavy": lambda rng, n: rng.standard_t(3, n) / np.sqrt(3),
}
"""


@pytest.fixture
def folder(tmp_path):
    place = tmp_path / "small"
    place.mkdir()
    (place / "__init__.py").write_text(TABLE)
    (place / "general.py").write_text(GENERAL)
    seal = digest_of(place)
    (place / "SEAL.txt").write_text(f"{seal}\n")
    lists = {
        "bend": {"right": ["second-order:x_mm"]},
        "comb": {"right": []},
    }
    (place / "judged.json").write_text(json.dumps({"seal": seal, "kinds": {"general": lists}}))
    return place


def told(capsys, *words):
    assert main(["strangers", *map(str, words), "--jobs", "1", "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_a_set_is_traced_scored_and_counted_and_when_it_was_opened_is_kept(folder, capsys):
    # at size 2 a cube is more probable than the square in one of two laboratories
    rows = told(capsys, "effects", "--set", folder, "--seeds", 2, "--sizes", 4)["rows"]
    assert rows["general: bend, size 4"]["seed 1"].startswith("right. y_mV explained: second-order:x_mm")
    assert rows["general: bend, size 4"]["hidden"] == "bend: The beam gives way. Over x."
    assert rows["all in a catalogue"]["right"] == {"count": 2, "of": 2, "percent_95": [34.2, 100.0]}
    assert rows["all"]["hidden causes named or among the aliases"]["of"] == 2 + 2 + 4
    assert sum(rows["all"][name]["count"] for name in CLASSES) == 6
    assert rows["none in a catalogue"]["right"]["count"] == 0
    kept = json.loads((folder / "OPENED.txt").read_text())
    assert rows["the set"] == {"seal": digest_of(folder), "opened": kept["opened"]}
    assert opened(load(folder)) == kept["opened"], "the first time counts"


def test_nulls_are_counted_by_noise(folder, capsys):
    nulls = told(capsys, "nulls", "--set", folder, "--seeds", 1)["rows"]
    assert nulls["heavy"]["false alarms"]["of"] == 1
    assert nulls["all"]["false alarms"]["of"] == 2


def test_a_changed_file_breaks_the_seal_and_nothing_is_traced(folder, capsys):
    (folder / "general.py").write_text(GENERAL.replace("x**2", "x**3"))
    with pytest.raises(UsageError, match="the seal is broken"):
        load(folder)
    assert main(["strangers", "effects", "--set", str(folder)]) == 2
    assert not (folder / "OPENED.txt").exists()


@pytest.mark.parametrize("broken", [False, True])
def test_a_seal_may_have_a_line_a_file(folder, broken):
    lines = [f"{sha256(path.read_bytes()).hexdigest()}  {path.name}" for path in sorted(folder.glob("*.py"))]
    (folder / "SEAL.txt").write_text("\n".join(lines[broken:]) + "\n")
    if broken:
        with pytest.raises(UsageError, match=r"__init__\.py changed after sealing"):
            sealed(folder)
    else:
        assert sealed(folder) == digest_of(folder)


def test_without_a_seal_or_a_list_for_it_a_set_is_not_traced(folder):
    stranger = load(folder)
    (folder / "judged.json").write_text(json.dumps({"seal": "0" * 64, "kinds": {}}))
    with pytest.raises(UsageError, match="for a set with the seal 0000"):
        judge_of(stranger)
    (folder / "judged.json").unlink()
    with pytest.raises(UsageError, match="there is no judge's list"):
        judge_of(stranger)
    (folder / "SEAL.txt").unlink()
    with pytest.raises(UsageError, match=r"there is no SEAL\.txt"):
        sealed(folder)


def test_an_effect_that_is_not_judged_is_missed_and_another_set_is_not_the_one_opened(folder):
    stranger = load(folder)
    (folder / "judged.json").write_text(json.dumps({"seal": stranger.seal, "kinds": {"general": {}}}))
    with pytest.raises(UsageError, match="general lacks bend, comb"):
        judge_of(stranger)
    (folder / "OPENED.txt").write_text(json.dumps({"opened": "2026-01-01T00:00:00Z", "seal": "0" * 64}))
    with pytest.raises(UsageError, match="another seal that was opened"):
        opened(stranger)


def effect(name, doubtful=None, aliases=(), stratum="between-point"):
    return {"effect": name, "doubtful": doubtful, "aliases": list(aliases), "stratum": stratum}


def sensor(*effects, unnamed=(), before=2.0, after=1.0):
    left = [{"where": where, "stratum": stratum} for where, stratum in unnamed]
    error = {"sigma_E": before, "cv_rms": None}, {"sigma_E": after, "cv_rms": None}
    return {"verdict": "-", "effects": list(effects), "unnamed": left, "before": error[0], "after": error[1]}


PADS = Judged(("pads",), ("cross-*",))
UNKNOWN = Judged((), ())
OWN = (("between replications: the parameters drift", "replication"),)
SOMEWHERE = (("over pitch", "between-point"),)


@pytest.mark.parametrize(
    ("hidden", "sensors", "expected"),
    [
        ([PADS], [sensor(effect("pads"))], "right"),
        ([PADS], [sensor(effect("pads"), unnamed=SOMEWHERE)], "right"),
        ([PADS], [sensor(effect("cross-axis"))], "right"),
        ([PADS], [sensor(effect("pads", "why"))], "right, doubtful or aliased"),
        ([PADS], [sensor(effect("gear", aliases=["pads"]))], "right, doubtful or aliased"),
        ([PADS, UNKNOWN], [sensor(effect("pads"), effect("gear", "why"))], "right, doubtful or aliased"),
        ([PADS], [sensor(effect("pads", "why"), effect("gear", "why"))], "doubtful only"),
        ([UNKNOWN], [sensor(effect("gear", "why"))], "doubtful only"),
        ([UNKNOWN], [sensor(unnamed=SOMEWHERE)], "unnamed only"),
        ([UNKNOWN], [sensor(effect("gear"), unnamed=SOMEWHERE)], "wrong with a mark"),
        ([UNKNOWN], [sensor(effect("gear"), effect("creep", "why"))], "wrong with a mark"),
        ([UNKNOWN], [sensor(effect("gear"))], "WRONG WITHOUT A MARK"),
        ([UNKNOWN], [sensor(effect("gear"), unnamed=(("a wander", "noise"),))], "WRONG WITHOUT A MARK"),
        ([UNKNOWN], [sensor(effect("gear")), sensor(unnamed=SOMEWHERE)], "WRONG WITHOUT A MARK"),
        ([UNKNOWN], [sensor(effect("gear"), unnamed=OWN)], "WRONG WITHOUT A MARK"),
        ([UNKNOWN], [sensor(unnamed=OWN)], "noise only"),
        ([PADS], [sensor(effect("pads"), effect("gear"))], "WRONG WITHOUT A MARK"),
        ([PADS], [sensor(effect("gear", aliases=["creep"]))], "WRONG WITHOUT A MARK"),
        ([UNKNOWN], [sensor(effect("outliers", stratum="noise"))], "noise only"),
        ([UNKNOWN], [sensor(unnamed=(("a wander", "noise"),))], "noise only"),
        ([Judged(("outliers",), ())], [sensor(effect("outliers", stratum="noise"))], "right"),
        ([UNKNOWN], [sensor(), sensor()], "silent"),
    ],
)
def test_every_answer_has_its_class(hidden, sensors, expected):
    said = said_of({"sensors": dict(enumerate(sensors))})
    assert class_of(said, hidden) == expected


def test_what_was_found_what_alarms_and_whether_the_error_rose():
    said = said_of({"sensors": {"x": sensor(effect("gear", aliases=["pads"]), before=1.0, after=1.1), "y": sensor()}})
    assert found(said, [PADS, UNKNOWN]) == [True, False]
    assert [one.rose for one in said] == [True, False]
    assert alarm(said)
    assert not alarm(said_of({"sensors": {"x": sensor(effect("autocorrelation", stratum="noise"))}}))


def test_a_table_that_the_trace_refuses_is_refused_and_no_crash():
    options = ["--response", "y_mV", "--formula", "1 + x_mm"]
    made = SimpleNamespace(csv="x_mm,y_mV\n1,1\n2,2\n", options=options, size=1.0, hidden=np.zeros(2))
    told = scored(made, [UNKNOWN])
    assert (told["class"], told["found"]) == ("refused", [False])
    assert told["line"].startswith("DataError")
    assert scored(SimpleNamespace(csv="", options=["--response"], size=1.0), [])["class"] == "crash"


def test_options_are_those_of_the_command_line():
    words = ["--response", "y", "--group", "a", "--group", "b", "--whole-plot", "w", "--wrap", "360"]
    assert options_of(words) == {"response": "y", "group": ["a", "b"], "whole_plot": "w", "wrap": 360.0}
    with pytest.raises(ValueError, match="pairs of --name and a value"):
        options_of(["--response"])


def test_wilsons_interval_is_that_of_the_books():
    # Newcombe (1998), table I, the score method without correction.
    cases = {
        (81, 263): (0.2553, 0.3662),
        (15, 148): (0.0624, 0.1605),
        (0, 20): (0.0, 0.1611),
        (1, 29): (0.0061, 0.1718),
    }
    for counts, ends in cases.items():
        assert wilson(*counts) == pytest.approx(ends, abs=1e-4)


def test_the_sets_of_this_folder_are_as_they_were_sealed():
    for place in Path(digest_of.__code__.co_filename).parent.glob("*/SEAL.txt"):
        stranger = load(place.parent)
        assert judge_of(stranger).lists
        if (place.parent / "OPENED.txt").is_file():  # one that no trace has seen yet has none, and gets none here
            assert opened(stranger)


def test_replications_that_differ_hide_nothing_where_no_point_is_visited_twice():
    """The offsets of replications counted as errors of readings: a clear name was not said, and came out 35 % small."""
    sensors = traced(table("one_sided"), left_out=False)["sensors"]
    (found,) = sensors["x_V"]["effects"]
    assert (found["effect"], found["aliases"], found["doubtful"]) == ("sensor-asymmetry", [], None)
    assert found["coefficients"][0] == pytest.approx(ONE_SIDED_V, abs=4 * found["stderr"][0])
    assert not any(sensors[other]["effects"] or sensors[other]["unnamed"] for other in ("y_V", "z_V"))
