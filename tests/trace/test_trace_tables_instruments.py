"""What instruments do to a measurement is found in tables by the field's names, and nothing where nothing is."""

from __future__ import annotations

import numpy as np
import pytest

from proving.statistics.laboratories import named
from proving.truth.instruments import CAUSES
from proving.truth.table import Lab, options, simulate
from rig.fitter.trace.engine import family
from rig.procedures.general.column_roles import Roles, roles_of
from rig.procedures.general.effects.quantities import are_neighbours, is_quantity
from rig.procedures.general.trace import trace_general
from rig.procedures.tables.table import Table


@pytest.fixture(autouse=True)
def _few_draws(monkeypatch):
    """500 draws of the family are enough to tell 3.5 % from nothing, and quick."""
    monkeypatch.setattr(family, "MOST", 500)


@pytest.mark.parametrize("name", CAUSES)
def test_every_cause_is_found_by_its_name_at_one_sigma(name):
    assert named(name, 2, rms=1.0) == [CAUSES[name].named]


def test_nothing_is_found_where_nothing_is_missing():
    """One table in twenty may say something; of ten, two at most is 0.988 probable even then."""
    said = {name: named(name, 5, rms=0.0) for name in CAUSES}
    assert sum(bool(names) for names in said.values()) <= 2, said


def _traced(columns, lab):
    return trace_general(roles_of(Table("simulated", columns, simulated=True, provenance={}), Roles(**options(lab)))[0])


def test_rounding_that_is_as_large_as_the_scatter_is_told():
    """An error of rounding of one sd beside a scatter of one sd: a step of sqrt(12)."""
    lab = Lab(60)
    columns = simulate(lab, 3)
    plain = _traced(columns, lab)
    assert "quantisation" not in [effect.effect for effect in plain.effects]
    coarse = {**columns, "y": np.round(columns["y"] / 3.5) * 3.5}
    said = _traced(coarse, lab)
    (finding,) = [effect for effect in said.effects if effect.effect == "quantisation"]
    assert finding.coefficients == (3.5,)
    assert said.verdict == "nothing to add"


@pytest.mark.parametrize(
    ("name", "quantity", "is_one"),
    [
        ("force_kN", "load", True),
        ("load", "load", True),
        ("input_V", "load", False),
        ("line_psia", "load", True),
        ("current_A", "current", True),
        ("heater_mA", "current", True),
        ("area", "current", False),
        ("source_kohm", "resistance", True),
        ("ohms_V", "resistance", False),
        ("bath_degC", "temperature", True),
    ],
)
def test_quantities_are_known_by_names_and_units(name, quantity, is_one):
    assert is_quantity(name, quantity) is is_one


def test_neighbours_differ_by_a_number_only():
    assert are_neighbours("cell_1_V", "cell_2_V")
    assert not are_neighbours("supply_V", "cell_2_V")
    assert not are_neighbours("cell_1_V", "cell_1_V")
