"""Names of columns: where the stem ends and the unit begins."""

from __future__ import annotations

from pathlib import Path

import pytest
from command import rig

from procedures.column_names import split_unit, with_word
from rig.examples import example
from rig.tables.of_others.units import unit_in
from sims.physics.laboratory import _stem


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
