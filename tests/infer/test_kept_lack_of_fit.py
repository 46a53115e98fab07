"""What `rig fit --traced` keeps says whether lack of fit is left, and its intervals hold it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command import rig
from test_signs import table_of

from proving.truth.attitude import Bench, Plan, Sensor, simulate
from rig.procedures.attitude.evaluate import trace_attitude_table
from rig.procedures.attitude.fitted import fit_attitude_table
from rig.procedures.attitude.infer import AttitudeCalibration
from rig.procedures.tables.table import Table

BENCH = Bench(sensors=(Sensor("x"),))
KNEE = -0.002
SMALL = Plan(np.linspace(-30.0, 30.0, 13), np.linspace(-180.0, 180.0, 7), replications=4)


def table(knee: float = 0.0, cubic: float = 0.0) -> Table:
    """A run of one sensor whose sensitivity changes by this part above the output's upper third, or with a cube."""
    bench = replace(BENCH, sensors=(replace(BENCH.sensors[0], cubic=cubic),))
    data, _ = simulate(bench, SMALL, 5)
    v = data.outputs["x_V"]
    return table_of(replace(data, outputs={"x_V": v + knee * np.maximum(v - np.quantile(v, 0.66), 0.0)}))


@pytest.fixture(scope="module")
def kinked() -> Table:
    return table(knee=KNEE)


@pytest.fixture(scope="module")
def result(kinked: Table) -> dict:
    return fit_attitude_table(kinked, traced=True)


def test_what_is_kept_says_that_lack_of_fit_is_left(result: dict, tmp_path: Path) -> None:
    kept = result["kept"]["x_V"]
    left = kept["lack_of_fit"]
    assert left["T_bias"] > left["F_bias_95"]
    assert left["sentence"].startswith("lack of fit is left in x_V (")
    assert f"S by up to {left['model_error']['S_V']:.2g} V/g" in left["sentence"]
    read = AttitudeCalibration.from_dict(json.loads(json.dumps(result["calibration"])))
    assert read.misfits["x_V"].sentence("x_V") == left["sentence"]
    assert any(left["sentence"] in note for note in read.notes)  # what `rig infer` says


def test_intervals_hold_the_model_error_that_is_left(result: dict) -> None:
    row = result["kept"]["x_V"]["parameters"]["S_V"]
    true = fit_attitude_table(table())["sensors"]["x_V"]["parameters"]["S_V"]["estimate"]
    low, high = row["interval95"]
    assert low < true < high
    inner = row["interval95_of_scatter"]
    assert inner[0] - low == pytest.approx(row["model_error"]) == pytest.approx(high - inner[1])


def test_trace_and_fit_print_the_same_standard_errors(kinked: Table, result: dict) -> None:
    """Every term of an effect has a coefficient of its own, and the parameters pay for it."""
    (outcome,) = (one for one in trace_attitude_table(kinked).outcomes if one.sensor == "x_V")
    after = {one.name: one.after for one in outcome.parameters}
    kept = result["kept"]["x_V"]["parameters"]["S_V"]
    assert after["S_V"].value == pytest.approx(kept["estimate"], abs=kept["stderr"])
    assert after["S_V"].stderr == pytest.approx(kept["stderr"], rel=0.05)


def test_the_terminal_says_it_where_something_is_lacking_and_only_there(kinked: Table, tmp_path: Path) -> None:
    for name, one in (("kinked", kinked), ("cubic", table(cubic=2e-4))):
        columns = list(one.columns)
        rows = np.column_stack([one.columns[c] for c in columns])
        text = "\n".join([",".join(columns), *(",".join(repr(float(v)) for v in row) for row in rows)])
        (tmp_path / f"{name}.csv").write_text(text + "\n")
    said = rig("fit", tmp_path / "kinked.csv", "--traced", "--out", tmp_path / "kinked.json").stdout
    assert "lack of fit is left in x_V" in said
    assert "x_V: something is still lacking with the effects that are kept; see rig trace" in said
    said = rig("fit", tmp_path / "cubic.csv", "--traced", "--out", tmp_path / "cubic.json").stdout
    assert "kept with sensor-third-order" in said
    assert "no significant lack of fit is left in x_V" in said
    assert "see rig trace" not in said.partition("kept with")[2]
