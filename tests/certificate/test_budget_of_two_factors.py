"""Budgets of models of two factors: one of them is inferred, at stated values of the other."""

from __future__ import annotations

import numpy as np
import pytest

from rig.procedures.errors import DataError
from rig.procedures.general.for_budgets import general_evaluation
from rig.procedures.general.misfit import misfit
from rig.procedures.general.settings import GeneralProcedure
from rig.procedures.tables.table import Table

FORMULA = "1 + force_kN + force_kN^2 + air_degC + air_degC:force_kN"
AT = [{"force_kN": 4.0, "air_degC": 20.0}, {"force_kN": 8.0, "air_degC": 30.0}]


def table(declared, factors=("force_kN", "air_degC")):
    rng = np.random.default_rng(4)
    force, air = (v.ravel() for v in np.meshgrid(np.arange(0.0, 11.0), [15.0, 23.0, 35.0]))
    y = (
        0.1
        + 0.5 * force
        + 0.002 * force**2
        + 0.003 * air
        + 0.001 * air * force
        + 1e-4 * rng.standard_normal(force.size)
    )
    columns = {"force_kN": force, "air_degC": air, "elapsed_s": 60.0 * np.arange(force.size), "cell_V": y}
    about = {"outputs": {"cell_V": "cell"}, "factors": factors, "declared": declared, "kind": "general"}
    return Table("run", columns, simulated=True, provenance={}, **about)


@pytest.mark.parametrize(
    ("declared", "factors"),
    [
        ({"formula": FORMULA, "abscissa": "force_kN"}, ("force_kN", "air_degC")),
        ({"formula": FORMULA}, ("force_kN",)),
    ],
    ids=["declared", "the only factor, beside a recorded temperature"],
)
def test_the_abscissa_is_inferred_at_stated_values_of_the_other(declared, factors):
    found = general_evaluation(table(declared, factors), AT)
    results = dict(zip(found.results.names, found.results.values.tolist(), strict=True))
    sd = dict(zip(found.results.names, np.sqrt(np.diag(found.results.type_a.covariance)).tolist(), strict=True))
    for at in AT:
        where = f"at force {at['force_kN']:g} kN, air {at['air_degC']:g} degC"
        assert results[f"cell inferred force {where}"] == pytest.approx(at["force_kN"], abs=1e-9)
        slope = 0.5 + 0.004 * at["force_kN"] + 0.001 * at["air_degC"]
        curve, reading = sd[f"cell output {where}"], 1e-4
        assert sd[f"cell inferred force {where}"] == pytest.approx(np.hypot(curve, reading) / slope, rel=0.2)
    told = " ".join(found.notes())
    assert (
        "cell_V: force is inferred with air as stated at each point; its error in use is not in the uncertainty" in told
    )
    assert not list(found.hints())


def test_without_an_abscissa_it_says_that_nothing_is_inferred():
    found = general_evaluation(table({"formula": FORMULA}), AT)
    assert not any("inferred" in name for name in found.results.names)
    assert not any("inferred" in note for note in found.notes()), "certificates and calibration files have these"
    told = " ".join(found.hints())
    assert 'nothing is inferred, since its model has force_kN, air_degC: abscissa = "force_kN" in [model] says' in told


def test_an_abscissa_that_is_not_in_the_model_is_refused():
    with pytest.raises(DataError, match=r"abscissa = 'flow_Lpm' is not in its formula"):
        general_evaluation(table({"formula": FORMULA, "abscissa": "flow_Lpm"}), AT)
    procedure = GeneralProcedure.model_validate(
        {
            "kind": "general",
            "name": "two",
            "factors": {"force_kN": {"levels": [0, 1]}, "air_degC": {"levels": [0, 1]}},
            "model": {"formula": "1 + force_kN", "abscissa": "air_degC"},
        }
    )
    said = misfit(procedure.factors, procedure.model, {"cell": "cell_V"}, {})
    assert "model.abscissa = 'air_degC' is not in its formula" in said
