"""A further run that settles nothing for certain is not longer than the run that it follows.

The stranger's valve: causes that look alike on its range, and 22 h were proposed with a probability of 0 %.
"""

from __future__ import annotations

import json
from types import SimpleNamespace

import pytest
from command import rig
from test_set_in import BENCH, PROCEDURE, WORLD

from rig.tables.table_of_run import run_table
from rig.verbs.confirm import choosing
from rig.verbs.confirm.choosing import _worth_its_time, best


def of(hours, told, *, likely=False):
    return SimpleNamespace(hours=hours, cost_h=hours, told=told, likely=likely)


@pytest.mark.parametrize(
    ("proposals", "chosen"),
    [
        ([of(22.0, 23.5), of(8.2, 18.5), of(3.0, 10.0)], 8.2),
        ([of(22.0, 23.5, likely=True), of(8.0, 18.5)], 22.0),
        ([of(22.0, 2.9, likely=True), of(9.0, 2.9, likely=True), of(3.0, 1.0)], 9.0),
        ([of(22.0, 23.5), of(11.0, 18.5)], 11.0),
    ],
    ids=[
        "as long as the first",
        "longer, where it is likely to settle",
        "the cheapest of these",
        "the shortest at all",
    ],
)
def test_a_longer_run_has_to_be_likely_to_settle_everything(proposals, chosen):
    procedure = SimpleNamespace(expand=lambda: ())
    first = SimpleNamespace(confirming=SimpleNamespace(hours=lambda variation, run_list: 8.0), procedure=procedure)
    assert _worth_its_time(first, proposals).hours == chosen


@pytest.mark.parametrize(("likely", "hours"), [(True, 7), (False, 5)])
def test_of_nine_sizes_of_a_design_few_are_simulated_to_find_the_shortest_that_tells_as_much(
    likely, hours, monkeypatch
):
    """Each forecast is 200 simulated runs. What is unlikely to settle everything is not longer than the first run."""
    simulated = []

    def forecast(_, variation):
        size = len(variation.run_list)
        simulated.append(size)
        told = 2.0 if size >= hours else 0.2 * size
        one = of(float(size), told, likely=likely and size >= hours)
        return SimpleNamespace(**vars(one), points=size, settles=lambda _: False)

    monkeypatch.setattr(choosing, "_proposal", forecast)
    monkeypatch.setattr(choosing, "_of_chosen_points", lambda *_: ([], None))
    confirming = SimpleNamespace(hours=lambda variation, run_list: float(len(run_list) or 6))
    first = SimpleNamespace(confirming=confirming, procedure=SimpleNamespace(expand=lambda: ()))
    group = [SimpleNamespace(run_list=range(size)) for size in range(1, 10)]
    assert best(first, group).hours == hours
    assert len(simulated) == len(set(simulated)) <= 5


def test_a_valve_with_causes_that_look_alike_is_not_measured_for_longer_than_before(tmp_path):
    world = WORLD.replace("0.15*flow", "0.06*flow")
    for file, text in (("bench.toml", BENCH), ("procedure.toml", PROCEDURE), ("world.toml", world)):
        (tmp_path / file).write_text(text)
    done = rig("run", "procedure.toml", "--bench", "bench.toml", "--dry", "--world", "world.toml", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    (path,) = tmp_path.glob("**/*.sqlite")
    told = rig("confirm", path, "--list", "--json")
    proposed = json.loads(told.stdout)["proposals"]
    first_h = (run_table(path).columns["elapsed_s"].max() + 60.0) / 3600.0
    assert proposed
    assert not any(one["likely"] for one in proposed), "third and fourth order are alike on this range"
    assert all(one["hours"] <= 1.05 * first_h for one in proposed), [one["hours"] for one in proposed]
    assert proposed[0]["sigmas"]
