"""Controller and simulated bench in two processes: real serial ports, sockets and signals, wall-clock bounded."""

from __future__ import annotations

import json
import signal
from pathlib import Path

import pytest
from command import rig as command
from dry import LAB

from proving.chaos.checker import check
from proving.crashes import kills
from proving.crashes.kills import judge, rig, wait_for

SPEED = 400

PROCEDURE = """
kind = "pitch-roll"
name = "live"
replications = {replications}
[design]
type = "T6"
[settle]
dwell_s = 2
[measure]
readings = 4
"""


@pytest.fixture(scope="module")
def live(tmp_path_factory):
    """The example bench served for at most three minutes; yields its LIVE.toml."""
    bench = tmp_path_factory.mktemp("bench") / "LIVE.toml"
    arguments = (LAB / "bench.toml", "--world", LAB / "world.toml", "--speed", SPEED, "--live", bench, "--for", 180)
    server = rig("sim", *arguments, "--tape", bench.with_name("bench.tape"))
    wait_for(bench.exists, server)
    yield bench
    server.send_signal(signal.SIGTERM)
    server.communicate(timeout=10)
    assert not bench.exists()


def started(tmp_path, live, *, replications=8):
    procedure = tmp_path / "live-procedure.toml"
    procedure.write_text(PROCEDURE.format(replications=replications))
    process = rig("run", procedure, "--bench", live, "--out", tmp_path)
    return process, Path(process.stdout.readline().strip())


@pytest.fixture(autouse=True)
def no_process_left_behind(monkeypatch):
    """Whatever a test started ends with it, pipes closed."""
    begun = []

    def remembered(*arguments):
        begun.append(kills.rig(*arguments))
        return begun[-1]

    monkeypatch.setitem(globals(), "rig", remembered)
    yield
    for process in begun:
        if process.poll() is None:
            process.kill()
        process.communicate()


def news(path):
    try:
        return json.loads(path.with_suffix(".live").read_text())
    except (OSError, ValueError):
        return {"done": 0, "state": ""}


def test_killed_while_the_instruments_live_on(tmp_path, live):
    process, path = started(tmp_path, live, replications=4)
    wait_for(lambda: news(path)["done"] >= 4, process)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    resumed = command("resume", path)
    assert resumed.returncode == 0, resumed.stderr
    tally = judge(path)
    assert (tally.points, tally.lost, tally.duplicated, tally.wrong_side) == (24, 0, 0, 0)
    verdict = check(path, live.with_name("bench.tape"))
    assert verdict.clean, verdict.findings
    assert verdict.counts["readings"] == 24 * 4 * 4


def test_hold_release_and_stop_reach_a_running_controller(tmp_path, live):
    process, path = started(tmp_path, live)
    wait_for(lambda: news(path)["done"] >= 2, process)
    holds = [rig("hold", path), rig("hold", path)]
    for process_of_a_person in holds:
        assert process_of_a_person.wait(20) == 0, process_of_a_person.communicate()
    wait_for(lambda: news(path)["state"] == "holding", process)
    status = json.loads(command("status", path, "--json").stdout)
    assert status["running"]
    assert status["simulated"]
    assert status["state"] == "holding"
    held_at = news(path)["done"]
    assert command("release", path).returncode == 0
    wait_for(lambda: news(path)["done"] > held_at, process)
    assert command("stop", path).returncode == 0
    assert process.wait(20) == 4
    process.communicate()
    assert json.loads(command("status", path, "--json").stdout)["state"] == "stopped"
    assert command("hold", path).returncode == 2
    assert command("resume", path).returncode == 0
    assert judge(path).lost == 0


def test_a_second_controller_is_refused_and_a_signal_leaves_the_run_resumable(tmp_path, live):
    process, path = started(tmp_path, live)
    wait_for(lambda: news(path)["done"] >= 1, process)
    second = command("resume", path)
    assert second.returncode == 2
    assert "in use by another controller" in second.stderr
    other = command("run", tmp_path / "live-procedure.toml", "--bench", live, "--out", tmp_path / "other")
    assert other.returncode == 2
    assert "in use by another controller" in other.stderr
    assert not list(tmp_path.glob("other/*.sqlite"))
    process.send_signal(signal.SIGTERM)
    assert process.wait(20) == 75
    process.communicate()
    assert command("status", path).returncode == 0
