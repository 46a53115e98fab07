"""Changes by a person in any laboratory: causes that no setting separates, told apart half-way through a run."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from command import rig
from general_lab import PROCEDURE, run_dry

from rig.examples import example
from rig.fitter.effects.own import own_effects
from rig.fitter.errors import FitError
from rig.procedures.general.effects import MANUAL_CHANGES, OTHER_METER
from rig.procedures.general.effects.own import GRAMMAR

ROOT, LOAD_CELL = Path(__file__).parents[2], example("load-cell-lab")

MORE = PROCEDURE.replace("[0, 1, 2, 5]", "[0, 1, 2, 3, 4, 5, 6, 7]")
OWN = """[[effect]]
name = "readout-square"
cause = "the meter squares what it reads"
scope = "sensor"
stratum = "row"
unit = "V per kN^2"
columns = ["force_kN^2"]
separate_by = "another meter"
usual_size = "1e-4 of reading"
by_hand = { change = "meter-swapped", say = "read the cell with another meter", does = "resizes" }
"""
WORLD = """seed = 3
[sensors.cell]
formula = "0.1 + 0.5*force_kN"
hidden = "0.0004*force_kN^2*(1 - 0*meter_swapped)"
noise = 1e-5
[person]
sets_s = 20
"""


def test_the_example_of_the_load_cell_parts_cell_and_readout_by_a_step_of_a_person(tmp_path, monkeypatch):
    text = (ROOT / "docs" / "how_to" / "confirm.md").read_text().split("in the example of the load cell\n")[1]
    (tmp_path / "effects.toml").write_text(text.split("```toml\n")[1].split("```")[0])
    monkeypatch.setenv("RIG_EFFECTS", str(tmp_path / "effects.toml"))
    hidden = text.split("With `")[1].split("`")[0]
    bench, procedure, world = ((LOAD_CELL / f"{name}.toml").read_text() for name in ("bench", "procedure", "world"))
    world = "\n".join(hidden if line.startswith("hidden") else line for line in world.splitlines())
    first, _ = run_dry(tmp_path / "first", procedure, bench, world)
    listed = rig("confirm", first, "--list").stdout
    assert "no run of this bench separates them" in " ".join(listed.split())
    done = rig("confirm", first, "--dry", "--take", 4, "--json", "--out", tmp_path)
    told = json.loads(done.stdout)
    assert [step["change"] for step in told["proposals"][3]["by_hand"]] == ["meter-swapped"]
    (effect,) = told["effects"]
    assert {member["effect"] for member in effect["members"]} == {"readout-cube", "third-order:force_kN"}
    assert (effect["verdict"], effect["holds"]) == ("replaced", ["readout-cube"]), done.stderr


def test_the_meter_is_exchanged_half_way_and_tells_that_the_square_is_the_cells(tmp_path, monkeypatch):
    own = tmp_path / "effects.toml"
    own.write_text(OWN)
    monkeypatch.setenv("RIG_EFFECTS", str(own))
    first, _ = run_dry(tmp_path / "first", MORE, world=WORLD)
    done = rig("confirm", first, "--dry", "--json", "--out", tmp_path)
    told = json.loads(done.stdout)
    best = told["proposals"][0]
    assert [step["change"] for step in best["by_hand"]] == ["meter-swapped"]
    assert best["person_hours"] == 0.5
    (effect,) = told["effects"]
    assert {"readout-square", "second-order:force_kN"} <= {member["effect"] for member in effect["members"]}
    assert effect["holds"] == ["second-order:force_kN"], done.stderr
    assert done.returncode == 0


def test_an_own_effect_says_what_a_change_by_a_person_does_to_it():
    (effect,) = own_effects(OWN, [GRAMMAR]).effects
    assert effect.influence("meter-swapped") == "resizes"
    assert effect.influence("remount") is None
    (change,) = (own.change for own in effect.by_hand)
    assert (change.say, change.anew) == ("read the cell with another meter", True)
    for wrong in ('{ change = "x", say = "y", does = "vanishes" }', '"close the door"', '{ change = "x", say = "y" }'):
        bad = OWN[: OWN.index("by_hand")] + f"by_hand = {wrong}\n"
        with pytest.raises(FitError, match="readout-square: by_hand is a table with change, say, does"):
            own_effects(bad, [GRAMMAR])


def test_kinds_with_an_entry_have_it_and_a_range_is_the_meters():
    from rig.procedures.general.effects import TABLE_CATALOGUE, _effect  # noqa: PLC0415

    kinds = {kind.name: kind for kind in TABLE_CATALOGUE} | {
        kind.beside.name: kind.beside for kind in TABLE_CATALOGUE if kind.beside is not None
    }
    assert MANUAL_CHANGES.keys() <= kinds.keys()
    effect = _effect(kinds["range-step"], ("input_V",), "y_V")
    assert effect.influence(OTHER_METER.word) == "resizes"
    assert _effect(kinds["third-order"], ("input_V",), "y_V").by_hand == ()
