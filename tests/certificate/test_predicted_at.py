"""The response at any settings, with its uncertainty: JCGM 100, H.3, a thermometer calibrated against temperature."""

from __future__ import annotations

import json

import pytest
from command import rig
from flow_bench import run_of

from rig.procedures.errors import DataError
from rig.procedures.evaluate.points import points

# JCGM 100:2008, Table H.6: reading and correction, both in degC
H3 = """t_degC,b_degC
21.521,-0.171
22.012,-0.169
22.512,-0.166
23.003,-0.159
23.507,-0.164
23.999,-0.165
24.513,-0.156
25.002,-0.157
25.503,-0.159
26.010,-0.161
26.511,-0.160
"""
FIT = ("--response", "b_degC", "--formula", "1 + I(t_degC - 20)")


@pytest.fixture
def table(tmp_path):
    path = tmp_path / "h3.csv"
    path.write_text(H3)
    return path


def test_the_guides_example_has_its_correction_and_uncertainty(table):
    told = json.loads(rig("fit", table, *FIT, "--at", "t_degC=30", "--json").stdout)
    (one,) = told["predictions"]
    assert one["value"] == pytest.approx(-0.1494, abs=5e-5), "H.3.4"
    assert one["standard_uncertainty"] == pytest.approx(0.0041, abs=5e-5), "H.3.4"
    assert one["df"] == pytest.approx(9.0)
    assert one["outside"] == ["t_degC"], "measured up to 26.5 degC"
    assert told["correlation"][0][1] == pytest.approx(-0.930, abs=5e-4), "H.3.3"


def test_it_is_printed_with_correlations_and_what_is_outside(table):
    told = rig("fit", table, *FIT, "--at", "t_degC=30", "--at", "t_degC=24").stdout
    assert "-0.1494" in told
    assert "0.0041" in told
    assert "-0.930" in told
    assert "t_degC = 30 is outside what was measured: the model is taken to hold there" in told
    assert "t_degC = 24 is outside" not in told


def test_a_run_of_sensors_is_predicted_too(tmp_path):
    told = json.loads(rig("fit", run_of(tmp_path, "run"), "--at", "flow_kg_per_min=2.2", "--json").stdout)
    (one,) = told["predictions"]
    assert one["value"] == pytest.approx(50.0 + 180.0 * 2.2 - 3.0 * 2.2**2, abs=1.0)
    assert 0.0 < one["standard_uncertainty"] < 1.0, "a lag that is not in the model scatters by 2.6 Hz"


@pytest.mark.parametrize(
    ("at", "says"),
    [
        ("t_K=300", "--at has t_K, and the model is of t_degC: give a value of each, no others"),
        ("t_degC", "'t_degC' is not a quantity and its value"),
        ("t_degC=inf", "'t_degC=inf' is not a quantity and its value"),
    ],
)
def test_a_point_that_is_none_is_refused(table, at, says):
    told = rig("fit", table, *FIT, "--at", at)
    assert told.returncode != 0
    assert says in told.stderr


def test_points_have_several_quantities():
    assert points(["a=1,b=2", "a = 3, b=4"]) == [{"a": 1.0, "b": 2.0}, {"a": 3.0, "b": 4.0}]
    with pytest.raises(DataError, match="'b' is not a quantity"):
        points(["a=1,b"])
