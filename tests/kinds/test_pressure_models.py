"""Models of a pressure transducer: the paper's sets of terms, variance inflation, reduction with hierarchy."""

from dataclasses import replace

import numpy as np
import pytest

from proving.truth.pressure import HOMOSCEDASTIC, PRESSURES_PSIA, simulate
from rig.fitter import RankError
from rig.fitter.arithmetic_text import FormulaError
from rig.fitter.formula import Formula
from rig.procedures.pressure.fit import HIERARCHICAL, fit_pressure, named_formula, variance_inflation
from rig.procedures.pressure.fit.models import contains, of_whole_plot

DATA, _ = simulate(HOMOSCEDASTIC, 3)


@pytest.mark.parametrize(
    ("model", "terms"),
    [
        (
            "full",
            {"1", "P", "T_sensor", "T_SSE", "P^2", "T_sensor^2", "T_SSE^2", "P:T_sensor", "P:T_SSE", "T_sensor:T_SSE"},
        ),
        ("II.C", {"1", "P", "T_sensor", "P^2", "P:T_SSE", "T_sensor^2"}),
        ("eq10", {"1", "P", "P^2", "P:T_sensor", "P:T_SSE"}),
        ("1 + P + log(P)", {"1", "P", "log(P)"}),
    ],
)
def test_sets_of_terms(model, terms):
    assert {str(term) for term in named_formula(model).terms} == terms


def test_extra_terms_are_added_once():
    formula = named_formula("II.C", ("I(P^3)", "P + P^3:T_SSE"))
    assert [str(term) for term in formula.terms][-2:] == ["P:T_SSE", "P^3:T_SSE"]
    assert sum(str(term) == "P" for term in formula.terms) == 1
    with pytest.raises(FormulaError):
        named_formula("quadratic model")


def test_columns_may_be_called_by_their_own_names():
    long = named_formula("(pressure_psia + sensor_temperature_degC)^2 + I(pressure_psia^2)", ("sse_temperature_degC",))
    assert long == named_formula("(P + T_sensor)^2 + P^2", ("T_SSE",))
    calibration = fit_pressure(DATA, "bridge_mV", "pressure_psia * sensor_temperature_degC").calibration()
    assert calibration.formula == named_formula("P * T_sensor")


def test_indicators_leave_the_terms_of_eq_10():
    """The full model less what is constant within whole plots is eq. (10) less its constant."""
    left = {term for term in named_formula("full").terms if not of_whole_plot(term)}
    assert left == set(named_formula("eq10").without(Formula.parse("1").terms[0]).terms)


def test_the_design_is_the_papers():
    assert len(DATA) == 220
    assert len(DATA.whole_plots) == 20
    np.testing.assert_array_equal(DATA.pressure_levels[0], np.unique(PRESSURES_PSIA))
    # 14 whole-plot degrees of freedom: exact t denominators for terms in temperature, 196 below
    df = dict(zip(named_formula("full").columns(DATA.table)[0], fit_pressure(DATA, "bridge_mV").reml.df, strict=True))
    assert df["T_sensor^2"] == pytest.approx(14.0, abs=0.02)
    assert df["P:T_SSE"] == pytest.approx(196.0, abs=0.02)


def test_inflation_is_the_diagonal_of_the_inverse_correlations():
    table = {"P": DATA.pressure_psia, "T_sensor": DATA.sensor_temperature_degC, "T_SSE": DATA.sse_temperature_degC}
    coded = {name: (v - v.min()) / np.ptp(v) * 2 - 1 for name, v in table.items()}
    formula = named_formula("full")
    names, columns = formula.without(Formula.parse("1").terms[0]).columns(coded)
    expected = np.diag(np.linalg.inv(np.corrcoef(columns.T)))
    found = variance_inflation(formula, DATA.table)
    assert tuple(found) == names
    np.testing.assert_allclose(list(found.values()), expected, rtol=1e-9)
    assert max(found.values()) < 20
    # in degrees Celsius from 0, the linear term of a temperature that stays near -90 would look 40 times worse
    raw = np.diag(np.linalg.inv(np.corrcoef(formula.without(Formula.parse("1").terms[0]).columns(table)[1].T)))
    assert raw[names.index("T_sensor")] > 40 * found["T_sensor"]


def test_inflation_with_indicators_is_what_the_paper_warns_of():
    with pytest.raises(
        RankError, match=r"indicator for every whole plot .* T_sensor, T_SSE, T_sensor\^2, T_SSE\^2, T_sensor:T"
    ):
        variance_inflation(named_formula("full"), DATA.table, DATA.whole_plot)
    found = variance_inflation(named_formula("eq10"), DATA.table, DATA.whole_plot)
    assert max(found.values()) < 20
    three = {"P": np.tile([0.0, 1.0, 2.0], 5)}
    with pytest.raises(RankError, match=r"P\^3 depends on the columns before it"):
        variance_inflation(Formula.parse("P + P^2 + P^3"), three)


@pytest.mark.parametrize(
    ("high", "low", "yes"),
    [
        ("P:T_SSE", "T_SSE", True),
        ("P^2", "P", True),
        ("P^2:T_SSE", "P:T_SSE", True),
        ("P:T_SSE", "T_sensor", False),
        ("P:T_SSE", "P^2", False),
        ("P", "P", False),
        ("log(P):T_SSE", "P", False),
        ("log(P):T_SSE", "log(P)", True),
    ],
)
def test_hierarchy(high, low, yes):
    terms = [Formula.parse(f"0 + {text}").terms[0] for text in (high, low)]
    assert contains(*terms) is yes


def test_reduction_keeps_what_is_there_and_its_hierarchy():
    big = replace(HOMOSCEDASTIC, offset_per_degC2=5e-5, cross_offset_per_degC2=3e-5)
    kept = {str(t) for t in fit_pressure(simulate(big, 0)[0], "bridge_mV", HIERARCHICAL).formula.terms}
    assert kept == {str(t) for t in named_formula("full").without(Formula.parse("0 + T_SSE^2").terms[0]).terms}
    # P:T_SSE alone calls for T_SSE, whatever its t test says: section II.C's own list is not hierarchical
    fits = [fit_pressure(simulate(HOMOSCEDASTIC, seed)[0], "bridge_mV", HIERARCHICAL).formula for seed in range(5)]
    for formula in fits:
        written = {str(term) for term in formula.terms}
        assert {"P", "P^2", "P:T_SSE", "T_SSE", "P:T_sensor"} <= written
        for term in formula.terms:
            lower = [other for other in named_formula("full").terms if contains(term, other)]
            assert set(lower) <= set(formula.terms)
    assert fits[0] == fit_pressure(simulate(HOMOSCEDASTIC, 0)[0], "bridge_mV", HIERARCHICAL).formula
