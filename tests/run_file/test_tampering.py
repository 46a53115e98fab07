"""Forgeries of which every hash is right: the clumsy make no sense, the others show against a head noted elsewhere."""

from __future__ import annotations

import json
import math
import os
import pwd
from collections.abc import Callable
from pathlib import Path
from typing import Any

import dry
import dry_pressure
import pytest
from command import rig
from small_run import write_small

from proving.forger import Opened, forge
from rig.errors import UsageError
from rig.run_file.read.reader import RunReader
from rig.run_file.verify.verification import verify_file
from rig.tables.table_of_run import run_table
from rig.who import Operator, operator

_FAULTS = """
[[faults]]
kind = "no-reply"
on = "scanner"
exchange = 90

[[faults]]
kind = "clock-step"
at_s = 200.0
amount_s = 7200.0
"""


@pytest.fixture(scope="module")
def attitude(tmp_path_factory) -> Path:
    """A run with a fault, a retry and a clock that was set."""
    folder = tmp_path_factory.mktemp("attitude")
    world = folder / "world.toml"
    world.write_text((dry.LAB / "world.toml").read_text() + _FAULTS)
    return dry.dry(folder, world=world)


@pytest.fixture(scope="module")
def pressure(tmp_path_factory) -> Path:
    """A run with a whole plot that was lost and measured again."""
    return dry_pressure.dry(tmp_path_factory.mktemp("pressure"), kill_at=7)


def _scaled(channel: dict[str, Any], by: float) -> None:
    """Readings, mean and sd of a channel multiplied, all of them consistent with one another."""
    readings = [r * by for r in channel["readings"]]
    mean = math.fsum(readings) / len(readings)
    sd = math.sqrt(math.fsum((r - mean) ** 2 for r in readings) / (len(readings) - 1))
    channel |= {"readings": readings, "mean": mean, "sd": sd}


def _outputs(run: Opened) -> None:
    for record in run.all("observation"):
        for channel in record["body"]["outputs"].values():
            _scaled(channel, 1.001)


def _real(run: Opened) -> None:
    run.records[0]["body"] |= {"simulated": False}


def _real_not_dry(run: Opened) -> None:
    run.records[0]["body"] |= {"simulated": False, "dry": False}


def _real_throughout(run: Opened) -> None:
    _real_not_dry(run)
    del run.documents["world.toml"]
    for record in run.all("session"):
        record["body"] |= {"simulated": False, "boot": "5f0c"}


def _simulated_unsaid(run: Opened) -> None:
    for record in list(run.all("session"))[1:]:
        del record["body"]["simulated"]


def _no_faults(run: Opened) -> None:
    run.without(lambda r: r["kind"] == "fault" or r["status"] in ("recovered", "read-back"))


def _no_loss(run: Opened) -> None:
    run.without(lambda r: r["status"] == "whole-plot-lost")


def _date(run: Opened) -> None:
    run.observation(5)["utc_s"] += 30 * 86400.0


def _unmarked_step(run: Opened) -> None:
    run.without(lambda r: r["status"] == "clock-set")


def _later(run: Opened) -> None:
    run.observation(5)["body"]["measured_s"][1] += 3600.0


def _order(run: Opened) -> None:
    run.observation(6)["elapsed_s"] -= 3600.0


def _mean(run: Opened) -> None:
    run.observation(5)["body"]["outputs"]["x_V"]["mean"] *= 1.001


def _sd(run: Opened) -> None:
    run.observation(5)["body"]["outputs"]["x_V"]["sd"] /= 10


def _left_out(run: Opened) -> None:
    channel = run.observation(5)["body"]["outputs"]["x_V"]
    channel["readings"].pop()
    _scaled(channel, 1.0)


def _readback(run: Opened) -> None:
    run.observation(5)["body"]["readback"]["pitch_deg"] += 5.0


def _settled(run: Opened) -> None:
    run.observation(5)["body"]["settling"]["pitch"]["samples"][-1][1] += 5.0


def _side(run: Opened) -> None:
    approach = run.observation(5)["body"]["approach"]["pitch"]
    approach[0] = -approach[0]


def _doubled(run: Opened) -> None:
    run.observation(6)["body"] = run.observation(5)["body"]


def _copied(run: Opened) -> None:
    run.observation(20)["body"]["outputs"] = run.observation(5)["body"]["outputs"]


def _twice(run: Opened) -> None:
    at = run.records.index(run.observation(5))
    run.records.insert(at, {**run.records[at], "whole_plot": 1})


def _setpoint(run: Opened) -> None:
    run.points[5]["pitch_deg"] += 5.0


def _plan(run: Opened) -> None:
    """The procedure too: the run list is the one that it makes."""
    run.documents["procedure.toml"] = run.documents["procedure.toml"].replace("45", "50")
    for point in run.points:
        point["pitch_deg"] = {45.0: 50.0, -45.0: -50.0}.get(point["pitch_deg"], point["pitch_deg"])


def _no_procedure(run: Opened) -> None:
    del run.documents["procedure.toml"]


def _fewer(run: Opened) -> None:
    run.without(lambda r: r["kind"] == "observation" and r["run_index"] == 5)


def _unsafe(run: Opened) -> None:
    run.without(lambda r: r["status"] == "safe")


def _environment(run: Opened) -> None:
    next(run.all("event", "environment-settled"))["body"]["enclosure"]["outcome"] = "timed-out"


def _instrument(run: Opened) -> None:
    run.without(lambda r: r["kind"] == "identity" and r["status"] == "scanner")


def _reference(run: Opened) -> None:
    for record in run.all("observation"):
        _scaled(record["body"]["references"]["pressure_psia"], 1.01)


def _chamber(run: Opened) -> None:
    run.observation(5)["body"]["environment"]["sse_chamber"]["temperature_degC"] += 5.0


def _soak(run: Opened) -> None:
    next(run.all("event", "whole-plot"))["body"]["setpoints_degC"]["sse_chamber"] += 5.0


def _not_left(run: Opened) -> None:
    run.without(lambda r: r["status"] == "temperatures-left")


def _another_plot(run: Opened) -> None:
    run.observation(20)["whole_plot"] = 1


def _gap(run: Opened) -> None:
    """The time for which the bench was left alone, shorter: everything since then earlier."""
    at = run.records.index(list(run.all("session"))[1])
    for record in run.records[at:]:
        record["elapsed_s"] -= 60.0
        record["utc_s"] -= 60.0


ATTITUDE: dict[str, tuple[Callable[[Opened], None], str]] = {
    "SIMULATED removed": (_real, "record 1 (run) makes no sense: it does not say SIMULATED, and it is a dry run"),
    "SIMULATED and dry": (_real_not_dry, "it does not say SIMULATED, and it holds a world.toml, as only dry runs do"),
    "SIMULATED throughout": (_real_throughout, "its date is 2026-01-15 18:00:00, the run's name says"),
    "faults removed": (_no_faults, "it is attempt 2 at the point, and nothing says how attempt 1 ended"),
    "a date": (_date, "(observation of point 5) makes no sense: its date, 2026-02-14"),
    "the clock's step": (_unmarked_step, "is off by 7200 s from that of the record before it, and nothing says"),
    "measured later": (_later, "(observation of point 5) makes no sense: its readings ended at"),
    "out of order": (_order, "(observation of point 6) makes no sense: its time"),
    "a mean": (_mean, "(observation of point 5) makes no sense: mean of x_V is"),
    "an sd": (_sd, "(observation of point 5) makes no sense: sd of x_V is"),
    "a reading left out": (_left_out, "(observation of point 5) makes no sense: x_V has 3 readings, the procedure"),
    "a readback": (_readback, "(observation of point 5) makes no sense: readback of pitch_deg is"),
    "a settling": (_settled, "(observation of point 5) makes no sense: pitch settled at"),
    "a side": (_side, "(observation of point 5) makes no sense: pitch did not come from the side"),
    "an observation doubled": (_doubled, "(observation of point 6) makes no sense: its readings began at"),
    "outputs doubled": (_copied, "(observation of point 20) makes no sense: its outputs are those of the observation"),
    "accepted twice": (_twice, "(observation of point 5) makes no sense: point 5 had an accepted observation already"),
    "a setpoint": (_setpoint, "run list: the run list is not the one that the stored procedure makes"),
    "the plan": (_plan, "makes no sense: readback of pitch_deg is 45, not within"),
    "the procedure removed": (_no_procedure, "record 1 (run) makes no sense: it holds no procedure.toml, with which"),
    "an observation removed": (_fewer, "(end) makes no sense: it counts 30 accepted points, and there are 29"),
    "the safe state": (_unsafe, "(end) makes no sense: nothing says that the bench was brought to its safe state"),
    "the environment": (_environment, "(event) makes no sense: enclosure had not settled at 23 degC: timed-out"),
    "an instrument": (_instrument, "nothing says who scanner is"),
}
PRESSURE: dict[str, tuple[Callable[[Opened], None], str]] = {
    "a reference": (_reference, "makes no sense: pressure_psia read"),
    "a chamber": (_chamber, "(observation of point 5) makes no sense: sse_chamber was at"),
    "a soak": (_soak, "makes no sense: sse_chamber was set to"),
    "no change of temperature": (
        _not_left,
        "(event) makes no sense: nothing says that temperatures were changed for it",
    ),
    "another whole plot": (_another_plot, "(observation of point 20) makes no sense: it is of whole plot 1, where"),
    "a gap": (_gap, "(session) makes no sense: it began"),
    "the loss of a whole plot": (_no_loss, "point 5 had an accepted observation already"),
    "SIMULATED unsaid": (_simulated_unsaid, "(session) makes no sense: it does not say whether its bench is simulated"),
}


def _told(path: Path) -> list[str]:
    return [str(finding) for finding in verify_file(path).findings]


def test_runs_as_they_are_make_sense(attitude, pressure, tmp_path):
    assert not _told(attitude)
    assert not _told(pressure)
    assert not _told(forge(attitude, tmp_path / "same.sqlite", lambda run: None))  # what follows is the change's doing


@pytest.mark.parametrize("what", ATTITUDE)
def test_a_clumsy_forgery_makes_no_sense(attitude, tmp_path, what):
    change, says = ATTITUDE[what]
    told = _told(forge(attitude, tmp_path / "forged.sqlite", change))
    assert any(says in words for words in told), told


@pytest.mark.parametrize("what", PRESSURE)
def test_a_clumsy_forgery_of_whole_plots_makes_no_sense(pressure, tmp_path, what):
    change, says = PRESSURE[what]
    told = _told(forge(pressure, tmp_path / "forged.sqlite", change))
    assert any(says in words for words in told), told


def test_a_forgery_that_is_consistent_shows_against_a_head_and_nowhere_else(attitude, tmp_path):
    noted = verify_file(attitude).head
    forged = forge(attitude, tmp_path / "forged.sqlite", _outputs)
    assert rig("verify", forged).returncode == 0  # docs/how_to/verify.md says so
    done = rig("verify", forged, "--head", noted)
    assert done.returncode == 1
    assert "no record has the hash" in done.stdout
    told = json.loads(rig("verify", attitude, "--head", noted, "--json").stdout)
    assert told["whole"]
    assert "is that of the last record" in told["notes"][0]


def test_a_step_of_the_clock_is_written_down_once(attitude):
    with RunReader.open(attitude) as run:
        steps = [r.data for r in run.records("event") if r.status == "clock-set"]
    assert [step["step_s"] for step in steps] == [7200.0]
    assert steps[0]["message"] == "the machine's clock was set forward by 7200 s"


def test_who_ran_it_and_the_head_are_told(tmp_path):
    log, lab = tmp_path / "log", dry.LAB
    given = ("--bench", lab / "bench.toml", "--dry", "--world", lab / "world.toml", "--out", tmp_path, "--log", log)
    done = rig("run", write_small(tmp_path), *given, "--operator", "Ann O'Day")
    path = Path(done.stdout.strip())
    head = verify_file(path).head
    assert f"head {head}: keep it elsewhere" in done.stderr
    assert log.read_text().splitlines()[-1].endswith(f"; head {head}")
    assert "session 1 began, operator Ann O'Day" in log.read_text()
    told = rig("status", path).stdout
    assert "1 session(s) by Ann O'Day" in told
    assert f"head {head}" in told
    assert run_table(path).provenance["operator"] == "Ann O'Day"
    assert run_table(path).provenance["head"] == head  # which reports print
    assert rig("run", write_small(tmp_path), *given, "--operator", "A\nB").returncode == 2


def test_the_operator_is_who_was_given_else_the_environments_else_the_account(monkeypatch):
    monkeypatch.delenv("RIG_OPERATOR", raising=False)
    assert operator() == Operator(pwd.getpwuid(os.getuid()).pw_name, "login")
    monkeypatch.setenv("RIG_OPERATOR", "night shift")
    assert operator() == Operator("night shift", "RIG_OPERATOR")
    assert operator(" Ann ") == Operator("Ann", "--operator")
    with pytest.raises(UsageError, match="1 to 115 printable"):
        operator("x" * 116)
