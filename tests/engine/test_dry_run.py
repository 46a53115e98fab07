"""A dry run goes through every byte of every protocol, the same way every time, in any process."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from dry import LAB, SHORT, dry, fingerprint, write_short

from rig.engine.session import Outcome, Signals
from rig.run_file.read.reader import RunReader
from rig.runs.controller import resume_run, start_run
from rig.runs.plans import load_plan
from rig.tables.table_of_run import run_table


def test_the_same_seed_gives_the_same_bytes_and_observations_in_another_process_too(tmp_path):
    here = fingerprint(tmp_path / "a")
    assert int(here["transfers"]) > 1000
    assert fingerprint(tmp_path / "b") == here
    script = str(Path(__file__).parents[1] / "support" / "dry.py")
    done = subprocess.run([sys.executable, script, str(tmp_path / "c")], capture_output=True, text=True, check=True)
    assert json.loads(done.stdout) == here


def test_another_seed_gives_other_noise_and_the_same_bytes_outward(tmp_path):
    world = tmp_path / "world.toml"
    world.write_text((LAB / "world.toml").read_text().replace("seed = 20260115", "seed = 2"))
    one, other = run_table(dry(tmp_path / "a")), run_table(dry(tmp_path / "b", world=world))
    assert (one.columns["pitch_deg"] == other.columns["pitch_deg"]).all()
    difference = one.columns["x_V"] - other.columns["x_V"]
    assert 0 < np.abs(difference).max() < 200e-6


def test_a_dry_run_measures_the_world_it_was_given(tmp_path):
    """A sensor without any effect reads offset plus sensitivity times gravity along its axis."""
    world = tmp_path / "world.toml"
    world.write_text(
        "[sensors.x]\noffset_V = 0.5\nsensitivity_V_per_g = 2\nconing_deg = 0\nnoise_V = 0\n"
        "[lab]\ndaily_amplitude_degC = 0\n"
    )
    table = run_table(dry(tmp_path, world=world))
    gravity_along_x = np.sin(np.radians(table.columns["pitch_deg"]))
    np.testing.assert_allclose(table.columns["x_V"], 0.5 + 2 * gravity_along_x, atol=30e-6)


def test_a_dry_run_is_marked_simulated_and_no_real_instrument_is_named(tmp_path):
    with RunReader.open(dry(tmp_path)) as reader:
        assert reader.genesis().data["simulated"] is True
        serials = {r.status: r.data["serial"] for r in reader.records("identity")}
    assert set(serials) == {"head", "scanner", "enclosure"}


@pytest.mark.parametrize("order", ["random", "up-and-down"])
def test_other_orders_run_too(tmp_path, order):
    path = dry(tmp_path, text=SHORT + f'[order]\ntype = "{order}"\n')
    expected = 30 * (2 if order == "up-and-down" else 1)
    assert len(run_table(path)) == expected


def test_a_power_cut_after_the_last_point_leaves_a_run_that_can_be_finished(tmp_path):
    """All is observed, and the axes have lost their zeros: nothing is worth homing them for."""
    plan = load_plan(write_short(tmp_path), LAB / "bench.toml", dry=True, world=LAB / "world.toml")
    signals, paths = Signals(), []

    def cut(news):
        signals.interrupt = "SIGTERM" if news.done == len(plan.run_list) else ""

    broken = start_run(plan, tmp_path, signals=signals, announce=paths.append, on_progress=cut)
    assert broken.outcome is Outcome.INTERRUPTED
    resumed = resume_run(paths[0], signals=Signals(), on_progress=lambda _: None)
    assert resumed.outcome is Outcome.COMPLETE, resumed.message
    assert len(run_table(paths[0])) == len(plan.run_list)
