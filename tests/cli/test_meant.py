"""A name that is nearly one of the bench or the run is told with that one: in register, procedure and bench file."""

from __future__ import annotations

from datetime import date
from pathlib import Path

import pytest

from rig.errors import ConfigurationError
from rig.procedures.present.meant import nearest
from rig.runs.plans import load_plan
from rig.verbs.plan.foreseen import stops

LAB = Path(__file__).parents[2] / "examples" / "flow-lab"


def changed(folder: Path, file: str, before: str, after: str) -> tuple[Path, Path]:
    for one in LAB.glob("*.toml"):
        text = one.read_text()
        if one.name == file:
            assert before in text
            text = text.replace(before, after)
        (folder / one.name).write_text(text)
    return folder / "procedure.toml", folder / "bench.toml"


@pytest.mark.parametrize(
    ("file", "before", "after", "near"),
    [
        ("procedure.toml", "[factors.valve_V]", "[factors.valv_V]", "valve_V"),
        ("procedure.toml", "[factors.chamber_degC]", "[factors.chamer_degC]", "chamber_degC"),
        ("procedure.toml", '"1 + flow_kg_per_min +', '"1 + flow_kg_per_mn +', "flow_kg_per_min"),
        ("procedure.toml", 'abscissa = "flow_kg_per_min"', 'abscissa = "flow_kg_per_mn"', "flow_kg_per_min"),
        ("bench.toml", 'of = "valve_V"', 'of = "valv_V"', "valve_V"),
        ("bench.toml", 'valve_V = "valve"', 'valve_V = "vlave"', "valve"),
        ("bench.toml", 'reader = "counter_1"', 'reader = "countr_1"', "counter_1"),
        ("bench.toml", 'asset = "REF-01"', 'asset = "REF-1"', "REF-01"),
    ],
)
def test_a_misspelled_name_is_told_with_the_one_that_was_meant(tmp_path, file, before, after, near):
    with pytest.raises(ConfigurationError, match=rf"did you mean {near}\?"):
        load_plan(*changed(tmp_path, file, before, after))


@pytest.mark.parametrize(
    ("before", "after", "near"),
    [
        ("flow_kg_per_min", "flow_kg_per_mn", "flow_kg_per_min"),
        ("Hz", "HZ", "Hz"),
        ("chamber_degC", "chamer_degC", "chamber_degC"),
    ],
)
def test_a_misspelled_quantity_of_the_register_is_told_by_the_plan(tmp_path, before, after, near):
    """The plan said that the register has no error of the flow, not that it has one of nearly the same name."""
    plan = load_plan(*changed(tmp_path, "equipment.toml", f'quantity = "{before}"', f'quantity = "{after}"'))
    told = " ".join(stops(plan, date(2026, 6, 1)))
    assert f"gives no {after}" in told
    assert f"did you mean {near}?" in told


def test_nothing_is_meant_by_a_name_unlike_all_others():
    assert nearest("humidity", ["valve_V", "flow_kg_per_min"]) == ""
