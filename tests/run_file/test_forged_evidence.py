"""Forgeries of which every hash is right and every mean is that of its readings, and that contradict the same file."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import dry
import dry_pressure
import pytest

from proving.forger import Opened, forge
from rig.run_file.verify.verification import verify_file

Change = Callable[[Opened], object]


@pytest.fixture(scope="module")
def attitude(tmp_path_factory) -> Path:
    """A run with a fault and a retry."""
    folder = tmp_path_factory.mktemp("attitude")
    world = folder / "world.toml"
    fault = '\n[[faults]]\nkind = "no-reply"\non = "scanner"\nexchange = 90\n'
    world.write_text((dry.LAB / "world.toml").read_text() + fault)
    return dry.dry(folder, world=world)


@pytest.fixture(scope="module")
def pressure(tmp_path_factory) -> Path:
    """A run with a whole plot that was lost and measured again."""
    return dry_pressure.dry(tmp_path_factory.mktemp("pressure"), kill_at=7)


def body(kind: str, status: str | None = None, **values: object) -> Change:
    """Other values in the body of the first record of a kind and status."""
    return lambda run: next(run.all(kind, status))["body"].update(values)


def without(*statuses: str) -> Change:
    return lambda run: run.without(lambda r: r["status"] in statuses)


def every(change: Callable[[dict[str, Any]], object]) -> Change:
    """A change of the body of every accepted observation."""
    return lambda run: [change(r["body"]) for r in run.all("observation", "accepted")]


def at(index: int, change: Callable[[dict[str, Any]], object]) -> Change:
    return lambda run: change(run.observation(index)["body"])


def read(group: str, name: str, values: Iterable[float]) -> Callable[[dict[str, Any]], None]:
    """Other readings of a column, with their mean and sd."""
    readings = [*values]

    def change(observation: dict[str, Any]) -> None:
        count = len(observation[group][name]["readings"])
        these = (readings * count)[:count]
        sd = statistics.stdev(these) if count > 1 else 0.0
        observation[group][name] = {"mean": statistics.fmean(these), "sd": sd, "readings": these}

    return change


def inserted(kind: str, status: str | None, values: dict[str, object] | None = None, place: int = 20) -> Change:
    """A record that never was."""

    def change(run: Opened) -> None:
        before = run.records[place]
        run.records.insert(
            place + 1,
            {
                **before,
                "kind": kind,
                "status": status,
                "body": values or {},
                "run_index": None,
                "attempt": None,
            },
        )

    return change


def moved_on(place: int, seconds: float, *, sessions: bool = True) -> Change:
    """Everything from a record on is later."""

    def change(run: Opened) -> None:
        for record in run.records[place:]:
            record["elapsed_s"] += seconds
            record["utc_s"] += seconds
            if "measured_s" in record["body"]:
                record["body"]["measured_s"] = [moment + seconds for moment in record["body"]["measured_s"]]
            if record["kind"] == "session" and sessions:
                record["body"]["elapsed_s"] += seconds
                record["body"]["clock_s"] += seconds

    return change


def quick(run: Opened) -> None:
    """All observations within a few seconds."""
    first = next(run.all("observation", "accepted"))["elapsed_s"]
    for record in run.records:
        if record["elapsed_s"] >= first:
            late = record["elapsed_s"] - first
            record["elapsed_s"] -= 0.99 * late
            record["utc_s"] -= 0.99 * late
            if "measured_s" in record["body"]:
                record["body"]["measured_s"] = [record["elapsed_s"] - 0.02, record["elapsed_s"] - 0.01]


def safe_too_early(run: Opened) -> None:
    safe = next(run.all("event", "safe"))
    place = run.records.index(run.observation(10))
    here = run.records[place]
    run.records.insert(place, {**safe, "elapsed_s": here["elapsed_s"], "utc_s": here["utc_s"]})


def doubted(**values: float) -> Change:
    return body("event", "whole-plot-lost", **values)


def pressure_left(run: Opened) -> None:
    *_, safe = run.all("event", "safe")
    safe["body"]["found"]["supply"]["controlling"] = True


def quick_soak(run: Opened) -> None:
    place = run.records.index(next(run.all("event", "whole-plot")))
    took_s = run.records[place]["elapsed_s"] - run.records[place - 1]["elapsed_s"]
    moved_on(place, 10.0 - took_s)(run)


def no_gap(run: Opened) -> None:
    [*run.all("session")][1]["body"]["gap_s"] = 0.0


ATTITUDE: dict[str, tuple[Change, str]] = {
    "asset": (body("identity", "head", asset="HD-9999"), "asset of head is HD-9999, the bench file says HD-0417"),
    "due": (body("identity", "head", due="2099-01-01"), "due of head is 2099-01-01, the bench file says 2027-03-31"),
    "no date": (body("identity", "head", due="next year"), "next year is no date"),
    "nobody": (body("identity", "head", maker="", model=""), "it does not say who head is"),
    "no environment": (every(lambda o: o.update(environment={})), "does not say at what temperature enclosure was"),
    "settling of no chamber": (
        lambda run: next(run.all("event", "environment-settled"))["body"].clear(),
        "it does not say how enclosure settled",
    ),
    "environment not settled": (without("environment-settled"), "nothing says that its environment had settled"),
    "not homed": (without("homed"), "pitch and roll had not been homed"),
    "preparing": (without("preparing"), "nothing says that preparing began"),
    "all too quick": (quick, "after the record before it, and settling took"),
    "no time to read": (
        every(lambda o: o.update(measured_s=[o["measured_s"][1]] * 2)),
        "it was read within 0.00 s, and its meters take",
    ),
    "no time at all": (every(lambda o: o.pop("measured_s")), "its body has no measured_s"),
    "hours unexplained": (moved_on(30, 72000.0), "20.0 h passed since the record before it"),
    "all readings alike": (every(read("outputs", "x_V", [1.5])), "x_V repeats its reading of the observation before"),
    "frozen": (at(5, lambda o: o.update(flags=["frozen"])), "is marked as frozen, and the procedure does not accept"),
    "marked twice": (at(5, lambda o: o.update(flags=["noisy", "noisy"])), "it is marked twice"),
    "beyond its range": (at(5, read("outputs", "x_V", [50.0, 50.00001])), "x_V read more than its instrument can show"),
    "too cold": (every(read("temperatures", "sensor_temperature_degC", [-500.0])), "read less than absolute zero"),
    "unknown record": (inserted("banana", "x"), "it is a banana x, which no controller of its version"),
    "unknown event": (inserted("event", "banana"), "banana, which no controller of its version"),
    "unknown decision": (inserted("fault", "banana", {"message": "hm"}), "its decision is banana"),
    "fault without its pause": (
        lambda run: next(run.all("fault"))["body"].pop("pause_s"),
        "its body has no pause_s, which every controller writes",
    ),
    "empty warning": (inserted("event", "warning"), "its body has no cause, message, output"),
    "release": (inserted("release", None), "nothing was held that it could release"),
    "safe too early": (safe_too_early, "it was made after its session had brought the bench to its safe state"),
    "end": (lambda run: run.records[-1].update(status="stopped"), "a run ends as complete, not as stopped"),
    "end without counts": (lambda run: run.records[-1]["body"].pop("skipped"), "its body has no skipped"),
    "attempts": (
        lambda run: [r.update(attempt=None) for r in run.all("observation")],
        "it does not say which attempt at its point it is",
    ),
    "a settling that is none": (
        every(lambda o: o["settling"]["pitch"].update(samples=[[0.0, 500.0], o["settling"]["pitch"]["samples"][-1]])),
        "pitch was within 0.0005 of",
    ),
    "a settling without end": (
        every(lambda o: o["settling"]["pitch"].update(seconds=1e6)),
        "pitch settled within 1e+06 s, and its last sample is of",
    ),
    "from nowhere": (
        at(5, lambda o: o["approach"]["pitch"].__setitem__(1, -500.0 * o["approach"]["pitch"][0])),
        "where the limits of the bench let nothing go",
    ),
    "negative gap": (body("session", gap_s=-5.0), "it began after a gap of -5 s"),
}
PRESSURE: dict[str, tuple[Change, str]] = {
    "doubt without a number": (doubted(doubted_s=0.0), "how many readings are in doubt and not since when, or"),
    "less in doubt than left out": (
        doubted(doubted_s=1.0, doubted=0),
        "0 readings are said to be in doubt since 1.000",
    ),
    "in doubt for ever": (doubted(doubted_s=0.0, doubted=1, kept=0), "when its session did not look at them"),
    "another reason": (doubted(reason="nothing"), "it tells another reason for which the whole plot was lost"),
    "marked for temperature": (at(5, lambda o: o.update(flags=["temperature"])), "and the procedure asks for none"),
    "stray reference": (
        at(5, lambda o: _stray(o["references"]["pressure_psia"])),
        "once, too far off its setpoint",
    ),
    "short soak": (
        lambda run: [s.update(seconds=1.0) for s in next(run.all("event", "whole-plot"))["body"]["settling"].values()],
        "sensor_chamber settled within 1 s, less than its dwell",
    ),
    "soak of nothing": (body("event", "whole-plot", settling={}), "it does not say how sensor_chamber settled"),
    "quick soak": (quick_soak, "s had passed since it can have begun"),
    "left under pressure": (pressure_left, "supply still controlled pressure, and it is not named as unsafe"),
    "no gap": (no_gap, "it began after a gap of 0 s, and 120 s had passed"),
    "end": (lambda run: run.records[-1]["body"].pop("lost"), "its body has no lost, which every controller writes"),
}


def _stray(channel: dict[str, Any]) -> None:
    """One readback further off than the band, not so far that the mean is."""
    readings = channel["readings"]
    readings[0] += 0.003
    channel |= {"mean": statistics.fmean(readings), "sd": statistics.stdev(readings)}


def _told(path: Path) -> list[str]:
    return [str(finding) for finding in verify_file(path).findings]


def test_the_runs_themselves_make_sense_and_leave_nothing_unsaid(attitude, pressure):
    for path in (attitude, pressure):
        found = verify_file(path)
        assert (found.findings, found.notes) == ((), ())


@pytest.mark.parametrize("what", ATTITUDE)
def test_what_contradicts_the_same_file_makes_no_sense(attitude, tmp_path, what):
    change, says = ATTITUDE[what]
    told = _told(forge(attitude, tmp_path / "forged.sqlite", change))
    assert any(says in words for words in told), told


@pytest.mark.parametrize("what", PRESSURE)
def test_what_contradicts_the_same_file_makes_no_sense_with_whole_plots(pressure, tmp_path, what):
    change, says = PRESSURE[what]
    told = _told(forge(pressure, tmp_path / "forged.sqlite", change))
    assert any(says in words for words in told), told


def test_a_chamber_that_was_off_or_set_otherwise_is_noted(attitude, tmp_path):
    def off(observation: dict[str, Any]) -> None:
        observation["environment"]["enclosure"]["running"] = False

    found = verify_file(forge(attitude, tmp_path / "forged.sqlite", every(off)))
    assert any("enclosure was not controlling at 30 observation(s)" in note for note in found.notes)


@pytest.mark.parametrize("what", ["another version", "an early one"])
def test_a_session_that_claims_another_version_is_noted(attitude, tmp_path, what):
    def claim(run: Opened) -> None:
        session = next(run.all("session"))["body"]
        if what == "another version":
            session["software"]["calibration-rig"] = "9.9.9"
        else:
            del session["utc_step_s"]

    found = verify_file(forge(attitude, tmp_path / "forged.sqlite", claim))
    assert any("its records were not held against all that this version writes" in note for note in found.notes)
    assert any(("9.9.9" in note) == (what == "another version") for note in found.notes)


def test_a_run_list_that_only_another_version_would_make_is_noted(attitude, tmp_path):
    def claim(run: Opened) -> None:
        run.records[0]["body"]["software"]["calibration-rig"] = "9.9.9"
        run.documents["procedure.toml"] = run.documents["procedure.toml"].replace("45", "50")

    found = verify_file(forge(attitude, tmp_path / "forged.sqlite", claim))
    assert any("says that version 9.9.9 of rig began it" in note for note in found.notes)
