"""Every recorded column is a candidate: also one inside arithmetic of the declared formula, and its first order."""

import numpy as np
import pytest

from rig.fitter.trace.engine import family
from rig.procedures.errors import DataError
from rig.procedures.general.column_roles import Roles, parts_played, roles_of
from rig.procedures.general.evaluate import GeneralTraced
from rig.procedures.general.trace import trace_general
from rig.procedures.tables.table import Table


@pytest.fixture(autouse=True)
def _few_draws(monkeypatch):
    """500 draws of the family are enough to tell 3.5 % from nothing, and quick."""
    monkeypatch.setattr(family, "MOST", 500)


def traced(columns, formula, **told):
    table = Table("table.csv", columns, simulated=True, provenance={})
    roles = Roles(response="y", formula=formula, **told)
    data, taken = roles_of(table, roles)
    return GeneralTraced(table, roles, trace_general(data), taken, parts_played(data))


def named(columns, formula, **told):
    found = traced(columns, formula, **told).trace
    return [(e.effect, e.doubtful is None) for e in found.added]


def gas(n=80):
    """Density of a gas in a cell that expands with the temperature: declared is p / T."""
    rng = np.random.default_rng(1)
    p, air = rng.uniform(95.0, 105.0, n), rng.uniform(285.0, 303.0, n)
    y = 1.0 + 35.0 * p / air + 0.05 * (air - 294.0) + 0.005 * rng.standard_normal(n)
    return {"p_kPa": p, "air_K": air, "y": y}


def test_a_column_inside_arithmetic_is_a_candidate():
    assert named(gas(), "1 + I(p_kPa/air_K)") == [("first-order:air_K", True)]


def test_a_column_inside_a_function_is_a_candidate():
    rng = np.random.default_rng(2)
    r, dose = rng.uniform(0.1, 10.0, 60), rng.uniform(1.0, 5.0, 60)
    y = 2.0 * np.log(r) + 0.3 * r * dose + 0.01 * rng.standard_normal(60)
    assert named({"r": r, "dose": dose, "y": y}, "1 + log(r) + I(r*dose)") == []
    assert [name for name, _ in named({"r": r, "dose": dose, "y": y + 0.2 * r}, "1 + log(r) + I(r*dose)")] == [
        "first-order:r"
    ]


@pytest.mark.parametrize("seed", range(3))
def test_a_missing_linear_term_is_named_first_order_and_no_saturation(seed):
    """Pressure drop of a pipe: laminar and turbulent parts, of which only the square is declared."""
    rng = np.random.default_rng(seed)
    q = rng.permutation(np.repeat(np.linspace(0.2, 3.0, 12), 4))
    y = 0.4 + 3.0 * q + 3.4 * q**2 + 0.13 * rng.standard_normal(q.size)
    assert named({"q": q, "y": y}, "1 + q^2") == [("first-order:q", True)]


def test_an_offset_that_follows_the_bath_is_no_response_to_the_current():
    """Four currents in a bath: a thermal EMF of 0.2 uV per kelvin beside a thermometer's voltage."""
    rng = np.random.default_rng(4)
    plot = np.repeat(np.arange(10), 4)
    bath = rng.permutation(np.repeat([0.0, 25.0, 50.0, 75.0, 100.0], 2))[plot]
    current = np.tile([0.0005, 0.001, 0.0014, 0.002], 10)
    y = current * 1e5 * (1.0 + 3.9083e-3 * bath - 5.775e-7 * bath**2) + 2e-4 * bath
    y += 0.0003 * rng.standard_normal(40)
    columns = {"whole_plot": plot, "bath_degC": bath, "current_A": current, "y": y}
    formula = "0 + current_A + current_A:bath_degC + current_A:bath_degC^2"
    (first, _) = named(columns, formula, whole_plot=("whole_plot",))[0]
    assert first == "first-order:bath_degC"


def test_a_first_order_that_is_declared_is_no_candidate():
    data, _ = roles_of(Table("t.csv", gas(), True, {}), Roles(response="y", formula="1 + p_kPa + I(p_kPa/air_K)"))
    names = {c.effect.name for c in trace_general(data).search.judge.candidates}
    assert "first-order:air_K" in names
    assert "first-order:p_kPa" not in names


def test_a_column_of_the_formula_stays_a_candidate_beside_chosen_ones():
    columns = gas() | {"hum": np.random.default_rng(3).uniform(30.0, 60.0, 80)}
    assert named(columns, "1 + I(p_kPa/air_K)", candidates=("hum",)) == [("first-order:air_K", True)]
    unused = traced(columns, "1 + p_kPa", candidates=("hum",)).to_json()["unused"]["columns"]
    assert unused == [{"column": "air_K", "why": "not among --candidates"}]


def test_a_column_that_no_candidate_uses_is_named_as_unused():
    columns = {"x": np.arange(4.0), "room": np.array([1.0, 5.0, 2.0, 2.5]), "y": np.array([0.1, 1.0, 2.1, 2.9])}
    unused = traced(columns, "1 + x").to_json()["unused"]["columns"]
    assert unused == [{"column": "room", "why": "no effect of it could be tested: too few rows, or too large values"}]


def test_a_column_cannot_be_asked_for_and_ignored():
    table = Table("t.csv", gas() | {"hum": np.arange(80.0)}, True, {})
    with pytest.raises(DataError, match="--candidates and --ignore both name hum: leave out one of them"):
        roles_of(table, Roles(response="y", formula="1 + p_kPa", candidates=("hum",), ignore=("hum",)))
