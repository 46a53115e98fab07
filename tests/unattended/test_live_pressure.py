"""Whole plots with the twins living on in another process: what a SIGKILL and a power cut cost, in real time."""

from __future__ import annotations

import signal
from collections import Counter
from pathlib import Path

import pytest
from command import rig

from proving.crashes import kills
from rig.examples import example
from rig.run_file.read.reader import RunReader

LAB = example("pressure-lab")
SPEED = 1000
EACH = 5

PROCEDURE = """
kind = "whole-plot"
name = "live"
[design]
type = "list"
temperatures_degC = [[12, 18], [16, 24]]
pressures_psia = [0.12, 0.5, 1.0, 1.5]
repeated_psia = [0.5]
[model]
formula = "1 + P"
[soak]
tolerance_degC = 1.0
sensor_tolerance_degC = 2.0
dwell_s = 120
drift_degC_per_h = 6
[settle]
dwell_s = 5
[measure]
readings = 1
[recovery]
continue_gap_s = {gap}
"""


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """The example bench served for at most 150 s; yields its LIVE.toml and the server."""
    live = tmp_path_factory.mktemp("bench") / "LIVE.toml"
    server = kills.rig(
        "sim", LAB / "bench.toml", "--world", LAB / "world.toml", "--speed", SPEED, "--live", live, "--for", 150
    )
    kills.wait_for(live.exists, server)
    yield live, server
    server.send_signal(signal.SIGTERM)
    server.communicate(timeout=10)


def killed_in_the_middle(tmp_path, live, gap_s):
    """A run that is killed with three of the first whole plot's five points done; its run file."""
    procedure = tmp_path / "live-procedure.toml"
    procedure.write_text(PROCEDURE.format(gap=gap_s))
    process = kills.rig("run", procedure, "--bench", live, "--out", tmp_path, "--kill-at-point", 3)
    said, told = process.communicate(timeout=50)
    assert process.returncode == -signal.SIGKILL, told
    return Path(said.splitlines()[0])


def resumed(path):
    finished = rig("resume", path)
    assert finished.returncode == 0, finished.stderr
    with RunReader.open(path) as reader:
        reader.verify()
        lost = [r.data["reason"] for r in reader.records("event") if r.status == "whole-plot-lost"]
        accepted = [r for r in reader.records("observation") if r.status == "accepted"]
    pairs = Counter((r.whole_plot, r.run_index) for r in accepted)
    assert max(pairs.values()) == 1
    return lost, accepted


def test_after_a_short_gap_the_whole_plot_goes_on(tmp_path, bench):
    live, _ = bench
    lost, accepted = resumed(killed_in_the_middle(tmp_path, live, gap_s=20_000))
    assert not lost
    assert [r.whole_plot for r in accepted] == [1] * EACH + [2] * EACH
    assert {r.session for r in accepted if r.whole_plot == 1} == {1, 2}


def test_after_a_long_gap_it_is_measured_again_under_a_new_identity(tmp_path, bench):
    live, _ = bench
    lost, accepted = resumed(killed_in_the_middle(tmp_path, live, gap_s=60))
    assert len(lost) == 1
    assert "left alone for" in lost[0]
    assert Counter(r.whole_plot for r in accepted)[2] == EACH
    assert 3 <= Counter(r.whole_plot for r in accepted)[1] < EACH


def test_after_a_power_cut_too_however_short(tmp_path, bench):
    live, server = bench
    path = killed_in_the_middle(tmp_path, live, gap_s=20_000)
    server.send_signal(signal.SIGUSR1)
    lost, accepted = resumed(path)
    assert len(lost) == 1
    assert "no power" in lost[0]
    assert Counter(r.whole_plot for r in accepted)[2] == EACH
