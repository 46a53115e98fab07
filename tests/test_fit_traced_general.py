"""`rig fit RUN --traced` of any laboratory: what a trace finds is in the calibration, or left out with a word."""

from __future__ import annotations

import json

import pytest
from command import rig
from general_lab import PROCEDURE, WORLD, run_dry

LEVELS = PROCEDURE.replace("[0, 1, 2, 5]", "[0, 1, 2, 3, 4, 5, 6, 7]")
HIDDEN = WORLD.replace("noise = 1e-5", 'hidden = "0.0004*force_kN^2 + 0.0003*force_side"\nnoise = 1e-5')


def test_a_square_is_in_the_calibration_and_a_backlash_is_left_out_with_a_word(tmp_path):
    run, _ = run_dry(tmp_path, LEVELS, world=HIDDEN)
    done = rig("fit", run, "--traced", "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    found = {name: one["estimate"] for name, one in told["coefficients"].items()}
    assert found["force_kN^2"] == pytest.approx(0.0004, rel=0.02)
    assert found["1"] == pytest.approx(0.1, abs=3e-5)
    assert told["sigma_E"] < 6e-5  # three readings of 20 ms: 4e-5; the backlash alone is 30e-5
    for notes in (told["notes"], told["calibration"]["notes"]):
        assert any("second-order:force_kN is in the calibration" in note for note in notes)
        assert any(note.startswith("direction:") and "left out of the calibration" in note for note in notes)


def test_it_is_for_run_files(tmp_path):
    (tmp_path / "t.csv").write_text("x,y\n" + "".join(f"{i},{2 * i}\n" for i in range(9)))
    done = rig("fit", tmp_path / "t.csv", "--response", "y", "--formula", "1 + x", "--traced")
    assert done.returncode == 2
    assert "--traced is for the sensors of a run file" in " ".join(done.stderr.split())
