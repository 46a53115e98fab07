"""An effect of the side of approach that the declared model lacks counts in full in a budget of whole plots, too."""

from __future__ import annotations

from pathlib import Path

import pytest
from command import rig

from rig.verbs.budget.result import budget

LAB = Path(__file__).parents[2] / "examples" / "flow-lab"
SIDE = 0.4


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("sides")
    for name in ("bench.toml", "equipment.toml"):
        (folder / name).write_text((LAB / name).read_text())
    procedure = (LAB / "procedure.toml").read_text().replace("[10, 25, 40]", "[10, 40]").replace("= 3\n\n", "= 2\n\n")
    (folder / "procedure.toml").write_text(procedure.replace("[1, 2.5, 4, 5.5, 7, 8.5, 10]", "[1, 4, 7, 8.5, 10]"))
    world = (LAB / "world.toml").read_text()
    for hidden in ("0.02", "0.016"):
        world = world.replace(f'"{hidden}*flow_kg_per_min*(chamber_degC - 25)"', f'"{SIDE}*valve_side"')
    (folder / "world.toml").write_text(world)
    done = rig("run", "procedure.toml", "--bench", "bench.toml", "--dry", "--world", "world.toml", cwd=folder)
    assert done.returncode == 0, done.stderr
    (found,) = folder.glob("runs/*.sqlite")
    return found


def test_an_output_holds_on_both_sides_without_the_effect_in_the_model(run):
    """It had half of the traced one's uncertainty: the output of the falling side was outside."""
    at = [{"flow_kg_per_min": 3.0, "chamber_degC": 25.0}]
    every = [budget(run, at=at, traced=traced).found.budgets for traced in (False, True)]
    declared, traced = (next(one for one in made if one.name.startswith("sensor_1 output")) for made in every)
    half_way = 50 + 180 * 3 - 3 * 9
    for side in (-SIDE, SIDE):
        assert abs(declared.value - half_way - side) < declared.expanded_uncertainty
    assert declared.standard_uncertainty >= 0.99 * traced.standard_uncertainty
