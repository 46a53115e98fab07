"""Names of columns: where the stem ends and the unit begins."""

from __future__ import annotations

from pathlib import Path

import general_lab as lab
import numpy as np
import pytest
from command import rig

from rig.engine.session import Outcome
from rig.examples import example
from rig.procedures.column_names import split_unit, with_word
from rig.register import Statement
from rig.sims.physics.laboratory import _stem
from rig.tables.table_of_run import run_table
from rig.units.differences import factor
from rig.units.in_tables import unit_in
from rig.units.of_instruments import scale
from rig.units.si import per_term, si_unit

METER = """name = "water bench"
[instruments.pump]
driver = "scpi-source"
address = "socket://192.0.2.30:5025"
maker = "BENCHWORKS"
model = "FC-50"
unit = "m3_per_h"
low = 0
high = 60
set = "FLOW {value}"
decimals = 3
readback = 0.001
setpoint = "FLOW?"
on = "PUMP ON"
off = "PUMP OFF"
output = "PUMP?"
[instruments.bridge]
driver = "scpi-meter"
address = "socket://192.0.2.33:5025"
maker = "BENCHWORKS"
model = "CT-1"
unit = "mV_per_V"
asset = "BR-1"
fetch = "READ?"
reading_s = 0.5
[instruments.master]
driver = "scpi-meter"
address = "socket://192.0.2.34:5025"
maker = "BENCHWORKS"
model = "CT-2"
asset = "CT-2"
unit = "Hz"
fetch = "READ?"
reading_s = 0.5
[sensors.orifice]
reader = "bridge"
unit = "uV_per_V"
[references.flow_m3_per_h]
reader = "master"
formula = "reading / 2"
[factors]
flow_m3_per_h = "pump"
[limits]
flow_m3_per_h = [0, 55]
"""
EQUIPMENT = """name = "a bench"
[equipment.BR-1]
description = "bridge amplifier"
[equipment.BR-1.certificate]
number = "1"
date = 2025-01-31
laboratory = "a laboratory"
[[equipment.BR-1.says]]
quantity = "orifice_uV_per_V"
behaves = "gain"
unit = "%"
standard = 0.01
[equipment.CT-2]
description = "master meter"
[equipment.CT-2.certificate]
number = "2"
date = 2025-01-31
laboratory = "a laboratory"
[[equipment.CT-2.says]]
quantity = "flow_m3_per_h"
behaves = "offset"
unit = "m3/h"
standard = 0.01
"""
PROCEDURE = """kind = "general"
name = "orifice"
seed = 1
replications = 2
[factors.flow_m3_per_h]
levels = [0, 10, 20, 40]
order = "up-down"
[settle]
dwell_s = 5
[measure]
readings = 3
[model]
formula = "1 + flow_m3_per_h + flow_m3_per_h^2"
"""
WORLD = """seed = 3
[references.flow_m3_per_h]
formula = "2 * flow_m3_per_h"
noise = 1e-6
[sensors.orifice]
formula = "0.001 + 0.02*flow_m3_per_h + 1e-6*flow_m3_per_h^2 + 0.0001*flow_side"
noise = 1e-7
"""


@pytest.mark.parametrize(
    ("name", "stem", "unit"),
    [
        ("force_kN", "force", "kN"),
        ("flow_m3_per_h", "flow", "m3_per_h"),
        ("cell_mV_per_V", "cell", "mV_per_V"),
        ("cold_water_flow_L_per_min", "cold_water_flow", "L_per_min"),
        ("steps_per_h", "steps_per", "h"),
        ("sse_temperature_degC", "sse_temperature", "degC"),
        ("y", "", "y"),
    ],
)
def test_a_unit_may_have_per(name, stem, unit):
    assert split_unit(name) == (stem, unit)
    if stem:
        assert with_word(name, "set") == f"{stem}_set_{unit}"
        assert _stem(name) == stem


@pytest.mark.parametrize(
    ("name", "unit"),
    [("flow_m3_per_h", "m3/h"), ("flow_L_per_min", "L/min"), ("cell_mV_per_V", "mV/V"), ("area_m2", "m2")],
)
def test_the_unit_in_a_name_of_others(name, unit):
    assert unit_in(name) == unit


def test_a_laboratory_with_such_a_factor_is_run_fitted_and_exported(tmp_path, monkeypatch):
    """The load cell's laboratory, its force called a flow in m3/h."""
    monkeypatch.chdir(tmp_path)
    for name in ("bench", "procedure", "world"):
        text = (example("load-cell-lab") / f"{name}.toml").read_text().replace("force_kN", "flow_m3_per_h")
        text = text.replace("replications = 3", "replications = 1")
        Path(f"{name}.toml").write_text("".join(line for line in text.splitlines(True) if not line.startswith("asset")))
    done = rig("run", "procedure.toml", "-b", "bench.toml", "--dry", "--world", "world.toml", "-o", "runs")
    assert done.returncode == 0, done.stderr
    (run,) = Path("runs").glob("*.sqlite")
    assert rig("export", str(run), "--out", "t.csv").returncode == 0
    header = Path("t.csv").read_text().splitlines()[0].split(",")
    assert {"flow_m3_per_h", "flow_side", "cell_V"} <= set(header)
    asked = rig("status", str(run)).stdout
    assert "complete" in asked
    said = rig("fit", str(run), "--json")
    assert "flow_m3_per_h^2" in said.stdout, said.stderr
    seen = rig("fit", "t.csv").stdout
    assert "m3/h" in seen


@pytest.mark.parametrize(
    ("of", "to", "value"),
    [
        ("mV_per_V", "uV_per_V", 1e3),
        ("V_per_V", "mV_per_V", 1e3),
        ("L_per_min", "L_per_h", 60.0),
        ("m3_per_h", "mm3_per_h", None),  # no thousandth of it
        ("mm2", "um2", None),
        ("mV_per_V", "mV", None),
    ],
)
def test_prefixes_of_quotients(of, to, value):
    found = scale(of, to)
    assert found is None if value is None else found == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize(
    ("quantity", "unit", "own"),
    [
        ("mV_per_V", "mV_per_V", "mV_per_V"),
        ("mV/V", "uV_per_V", "mV/V"),
        ("ta_mV_per_V", "mV/V", "mV_per_V"),
        ("V", "mV", "V"),
        ("torque_kNm", "Nm", "kNm"),
    ],
)
def test_a_quantity_of_a_register_is_a_column_or_a_unit(quantity, unit, own):
    said = Statement(quantity=quantity, unit=unit, standard=1e-5)
    assert (said.quantity_unit, said.of_unit) == (own, "_" not in quantity or quantity == "mV_per_V")


def test_registers_and_certificates_know_such_units():
    assert factor("m_per_s2", "mGal") == pytest.approx(1e5)
    assert si_unit("m3_per_h").text == r"\metre\tothe{3}\hour\tothe{-1}"
    term = per_term("mV_per_V per unit of flow_m3_per_h")
    assert si_unit(term).text == r"\milli\volt\volt\tothe{-1}\hour\metre\tothe{-3}"


def test_a_run_of_a_flow_in_cubic_metres_per_hour(tmp_path):
    path, result = lab.run_dry(tmp_path, PROCEDURE, METER, WORLD)
    assert result.outcome is Outcome.COMPLETE, result.message
    table = run_table(path)
    assert {"flow_m3_per_h", "flow_set_m3_per_h", "flow_side", "orifice_uV_per_V"} <= set(table.columns)
    assert set(table.columns["flow_set_m3_per_h"]) == {0.0, 10.0, 20.0, 40.0}
    at = np.flatnonzero(table.columns["flow_set_m3_per_h"] == 20.0)
    side = table.columns["flow_side"][at]
    assert table.columns["orifice_uV_per_V"][at] == pytest.approx(1000 * (0.4014 + 0.0001 * side), abs=0.01)

    calibration, csv, out = tmp_path / "c.json", tmp_path / "run.csv", tmp_path / "out.csv"
    assert rig("fit", path, "--out", calibration).returncode == 0
    assert rig("export", path, "--out", csv).returncode == 0
    assert rig("infer", calibration, csv, "--out", out).returncode == 0
    assert "flow_m3_per_h_lo95" in out.read_text().splitlines()[0]
    register = tmp_path / "equipment.toml"
    register.write_text(EQUIPMENT)
    budget = rig("budget", path, "--equipment", register, "--at", "flow_m3_per_h=20", "--full")
    assert budget.returncode == 0, budget.stderr
    assert "orifice output at flow 20 m3/h" in budget.stdout


def test_a_flow_per_hour_is_one_per_minute():
    """kg_per_h did "not convert to kg_per_min", while g_per_min did."""
    assert scale("kg_per_h", "kg_per_min") == pytest.approx(1 / 60)
    assert scale("m3_per_s", "m3_per_h") == pytest.approx(3600)
    assert scale("h", "min") == pytest.approx(60)
    assert scale("min", "m") is None
    assert scale("kg_per_h", "m3_per_h") is None
