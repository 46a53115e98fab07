"""A bounded share of the nights; all of them: `make nights`."""

from __future__ import annotations

import dataclasses
import re
from functools import cache
from types import SimpleNamespace

import pytest

from proving.night.bugs import BUGS
from proving.night.campaign import one_night, replay, unbiased
from proving.night.checks import judge
from proving.night.of_records import misread_identity
from proving.night.play import play
from proving.night.scenario import EVERY_LAB, draw
from rig.engine.chambers import Chambers
from rig.run_file.read.reader import RunReader
from rig.tables.table_of_run import run_table

NIGHTS = {lab: range(8) for lab in EVERY_LAB} | {"attitude": range(24), "bath": range(15)}
"""Those of `FOUND_BY` are among them: each is played once without a bug."""
FOUND_BY = {
    "accept-late-reply": ("attitude", 3),
    "skip-re-approach": ("attitude", 0),
    "double-write": ("attitude", 0),
    "ignore-alarm": ("pressure", 2),
    "vent-on-resume": ("pressure", 0),
    "stale-reading": ("pressure", 0),
    "whole-plot-goes-on": ("pressure", 4),
    "sleep-through": ("attitude", 3),
    "weights-from-any-side": ("load-cell", 0),
    "trust-standards": ("bath", 14),
}
"""A night that finds each planted bug."""

BREAKS = {
    "accept-late-reply": {"truthful"},
    "skip-re-approach": {"approached"},
    "double-write": {"foreseen", "verifies"},  # a point that is accepted twice, or rejected twice
    "ignore-alarm": {"heeded"},
    "vent-on-resume": {"left alone"},
    "stale-reading": {"truthful"},
    "whole-plot-goes-on": {"one stay"},
    "sleep-through": {"unbroken"},
    "weights-from-any-side": {"approached"},
    "trust-standards": {"truthful"},
}
"""What does not hold then, and not just anything: a bug that stops the controller altogether would prove nothing."""


without_bug = cache(one_night)


@pytest.mark.parametrize("lab", EVERY_LAB)
def test_whatever_happens_in_a_night_everything_holds_after_it(lab):
    nights = [without_bug(seed, lab) for seed in NIGHTS[lab]]
    broken = {f"rig night --lab {lab} --seed {n.seed}": n.violations for n in nights if n.violations}
    assert not broken
    assert sum(n.happened for n in nights) > 5 * len(nights)
    bias = unbiased((z for n in nights for z in n.deviations), lab)
    assert bias is not None  # its limits are those of so many quantities, four of their own standard errors
    assert bias.holds, bias


@pytest.mark.parametrize("bug", BUGS)
def test_a_planted_bug_is_found_and_nothing_without_it(bug):
    lab, seed = FOUND_BY[bug]
    print(f"rig night --lab {lab} --seed {seed} --bug {bug}")
    broken = {violation.invariant for violation in one_night(seed, lab, bug=bug).violations}
    assert broken & BREAKS[bug], broken
    assert not without_bug(seed, lab).violations


def test_an_identity_that_arrives_wrong_twice_alike_is_known_by_its_rule_and_no_other_refusal_is():
    night = one_night(4858, "any-bench")
    assert night.violations == ()
    assert [(one.invariant, bool(one.unknowable)) for one in night.unknowable] == [("complete", True)]

    def why(*arrived: str, on: str = "it") -> str:
        said = "it is another instrument than before (was ACME B1, SN11; is ACME B1, SN1). Connect the first one"
        happened = [SimpleNamespace(fault=SimpleNamespace(on=on), what=f"'x' arrives as {one!r}") for one in arrived]
        bench = SimpleNamespace(sim=SimpleNamespace(faults=SimpleNamespace(happened=happened)))
        played = SimpleNamespace(sessions=[SimpleNamespace(message=said)], bench=bench)
        return misread_identity(SimpleNamespace(played=played))

    assert why("ACME,B1,SN11", "ACME,B1,SN11")
    assert not why("ACME,B1,SN11", "12.5", "ACME,B1,SN11"), "not in succession: it was asked once more between"
    assert not why("ACME,B1,SN11", "ACME,B1,SN11", on="another")
    assert not why("12.5", "12.5")
    assert not why()


@pytest.mark.parametrize(("lab", "seed"), [("pressure", 30310), ("attitude", 201136)])
def test_a_disk_that_fails_at_the_very_end_leaves_a_run_that_can_be_finished(lab, seed):
    """Nothing could resume a file in which records follow the end, be it written twice or only not folded."""
    assert not one_night(seed, lab).violations


@pytest.mark.parametrize(
    ("lab", "seed"),
    [
        ("voltmeter", 601551),  # killed between the end of the run and its last step: the live state stayed
        ("voltmeter", 600696),  # a meter that hung before a power cut, and was out of range once, was believed after it
        ("voltmeter", 602109),  # the same, and its input was open before the restart
        ("voltmeter", 600513),  # a digit doubled on its way
        ("bath", 600210),  # the reference thermometer hung at 100 degC, and the bath was at 0
    ],
)
def test_what_nights_of_the_example_laboratories_found_does_not_come_back(lab, seed):
    assert not one_night(seed, lab).violations


def test_an_identity_cut_short_is_no_other_instrument():
    """The run could not be resumed: the scanner was another instrument than before."""
    assert not one_night(213015, "attitude").violations


@pytest.mark.parametrize("believed", [False, True])
def test_a_chamber_that_hangs_while_its_door_is_open_is_not_believed(monkeypatch, tmp_path, believed):
    """Seed 221688 with the run list of another: of its own, its last whole plot no longer meets that hour."""
    if believed:
        monkeypatch.setattr(Chambers, "_unchanged", lambda *_: {})
    night = draw(221688, "pressure")
    procedure = re.sub(r"(?m)^seed = .*$", "seed = 109", night.documents["procedure.toml"])
    night = dataclasses.replace(night, documents={**night.documents, "procedure.toml": procedure})
    played = play(night, tmp_path)
    try:
        assert {violation.invariant for violation in judge(played)} == ({"one stay"} if believed else set())
        if not believed:
            with RunReader.open(played.path) as run:
                lost = [r for r in run.records("event") if r.status == "whole-plot-lost"]
                accepted = [r for r in run.records("observation") if r.status == "accepted"]
            assert (lost[-1].data["kept"], lost[-1].data["doubted"]) == (0, 1)
            doubted = [r for r in accepted if r.whole_plot == lost[-1].whole_plot]
            rows, everything = run_table(played.path), run_table(played.path, everything=True)
            assert len(rows.columns["run_index"]) == len(accepted) - 1
            assert [r.run_index for r in doubted] == [9]
            at = everything.columns["whole_plot"] == lost[-1].whole_plot
            assert not everything.columns["accepted"][at].any()
    finally:
        played.bench.close()


def test_an_alarm_is_heeded_although_the_chamber_could_not_be_read_when_it_came():
    assert not one_night(224320, "attitude").violations


def test_a_meter_that_hangs_at_a_spike_at_the_very_first_point_is_not_believed():
    assert not one_night(201080, "attitude").violations


def test_a_night_replays_exactly(tmp_path):
    folders = [tmp_path / name for name in ("one", "two")]
    for folder in folders:
        folder.mkdir()
    (one, told), (two, retold) = (replay(507, "attitude", folder) for folder in folders)
    assert told == retold
    assert dataclasses.astuple(one) == dataclasses.astuple(two)
    assert any("bench" in line for line in told)


def test_every_seed_is_another_night():
    nights = [draw(seed, "pressure") for seed in range(20)]
    assert len({night.documents["world.toml"] for night in nights}) == 20
    assert len({repr(night.mishaps) for night in nights}) == 20
