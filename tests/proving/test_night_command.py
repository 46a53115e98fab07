"""`rig night` as somebody types it."""

from __future__ import annotations

import json

import pytest
from command import rig


def test_a_campaign_ends_with_a_line_for_each_laboratory():
    done = rig("night", "--seeds", 2, "--first", 40, "--lab", "attitude", "--jobs", 1)
    assert done.returncode == 0, done.stderr
    first, second = done.stdout.splitlines()
    assert first.startswith("attitude: 2 nights, ")
    assert first.endswith("0 nights in which something did not hold")
    assert "coefficients less the truth" in second


def test_json_is_json_and_nothing_else():
    done = rig("night", "--seeds", 1, "--first", 41, "--lab", "attitude", "--jobs", 1, "--json")
    summary = json.loads(done.stdout)["attitude"]
    assert (summary["nights"], summary["violations"], summary["holds"], summary["found"]) == (1, 0, True, [])
    assert summary["bias"]["coefficients"] == 6


def test_a_planted_bug_is_told_with_the_command_that_replays_its_night():
    done = rig("night", "--lab", "attitude", "--first", 0, "--seeds", 3, "--bug", "double-write", "--jobs", 1)
    assert done.returncode == 0
    assert "verifies" in done.stderr
    assert "replay: rig night --lab attitude --seed 0 --bug double-write" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--bug", "vented"), "there is no such bug; there are"),
        (("--seed", 3), "say of which laboratory with --lab"),
        (("--keep", "kept"), "say which with --seed and --lab"),
    ],
)
def test_what_makes_no_sense_is_refused(tmp_path, arguments, said):
    done = rig("night", *arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert said in " ".join(done.stderr.split())
    assert not list(tmp_path.iterdir())
