"""`rig trace RUN1 RUN2 RUN3`: what comes back is of the bench, what does not is of its run."""

from __future__ import annotations

import json

import pytest
from command import rig
from general_lab import PROCEDURE, WORLD, run_dry

CURVE = 4e-4
"""V/kN2, of the cell."""
PLAN = PROCEDURE.replace("[0, 1, 2, 5]", "[0, 1, 2, 3, 4, 5]").replace("replications = 2", "replications = 4")
DRIFT = " + 0.0012*elapsed_h"
"""V, up to 0.4 mV over a run."""


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Three days on one bench: the curve on each, a drift on the second alone."""
    found = []
    for day, hidden in enumerate(("", DRIFT, ""), start=1):
        folder = tmp_path_factory.mktemp(f"day{day}")
        world = WORLD.replace("seed = 3", f"seed = {day}\nepoch = 2030-01-0{day}T00:00:00Z")
        world = world.replace("noise = 1e-5", f'hidden = "{CURVE}*force_kN^2{hidden}"\nnoise = 1e-5')
        found.append(run_dry(folder, PLAN, world=world)[0])
    return found


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0)])
def test_a_curve_comes_back_and_a_drift_of_one_day_does_not(runs, order):
    done = rig("trace", *(runs[i] for i in order), "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert list(told["runs"]) == [str(one) for one in runs]  # in order of time
    curve, drift = told["returning"]
    named = [str(one) for one in runs]
    assert (curve["effect"], curve["found_in"]) == ("second-order:force_kN", named)
    assert curve["said"] == {named[1]: "shown", named[2]: "shown"}
    assert "second-order:force_kN is in runs 1, 2 and 3: it is of the bench or of the sensors" in curve["sentence"]
    assert drift["found_in"] == [named[1]]
    assert drift["said"] == {named[0]: "absent", named[2]: "absent"}
    assert drift["effect"].startswith("drift:")


def test_what_it_prints_names_every_run_and_where_each_effect_is_of(runs):
    done = rig("trace", *runs)
    assert done.returncode == 0, done.stderr
    text = " ".join(done.stdout.split())
    assert "second-order:force_kN is in runs 1, 2 and 3: it is of the bench or of the sensors." in text
    assert "is of run 2: runs 1 and 3 would show it, and do not." in text
    assert all(one.name[-9:] in "".join(done.stdout.split()) for one in runs)


def test_what_cannot_be_held_against_one_another_is_refused(runs, tmp_path):
    assert "is the traced run itself" in rig("trace", runs[0], runs[0]).stderr
    done = rig("trace", runs[0], runs[1], "--report", tmp_path / "page.html")
    assert done.returncode == 2
    assert "--report and the form of a table are for one file" in done.stderr
    table = tmp_path / "table.csv"
    table.write_text("x,y\n1,2\n")
    assert "is not a run file" in rig("trace", runs[0], table).stderr
