"""Every column that a fit or a trace does not use is named, in JSON and on the terminal."""

import json

import numpy as np
import pytest
from command import rig

from proving.truth.pressure import HOMOSCEDASTIC, simulate
from rig.procedures.tables.unused import other_unit
from rig.tables import write_csv


@pytest.fixture(scope="module")
def whole_plots():
    data = simulate(HOMOSCEDASTIC, 3)[0]
    table = {
        "whole_plot": data.whole_plot,
        "order": data.order,
        "elapsed_s": data.elapsed_s,
        "pressure_psia": data.pressure_psia,
        "sensor_temperature_degC": data.sensor_temperature_degC,
        "sse_temperature_degC": data.sse_temperature_degC,
        "bridge_2_mV": data.outputs["bridge_mV"],
    }
    return {name: values[: len(values) // 3] for name, values in table.items()}


def unused(done):
    assert done.returncode == 0, done.stderr
    return {each["column"]: each["why"] for each in json.loads(done.stdout)["unused"]["columns"]}


@pytest.mark.parametrize("command", ["fit", "trace"])
def test_whole_plots(tmp_path, whole_plots, command):
    n = len(whole_plots["order"])
    extra = {"bridge_1_V": whole_plots["bridge_2_mV"] / 1000, "humidity_pct": np.full(n, 40.0)}
    write_csv(whole_plots | extra, tmp_path / "t.csv")
    done = rig(command, "t.csv", "--json", "--formula", "1 + P", cwd=tmp_path)
    assert unused(done) == {
        "bridge_1_V": "outputs are read in mV: convert it and name it bridge_1_mV",
        "humidity_pct": "plays no part",
    }
    assert "bridge_1_V is not used: outputs are read in mV" in done.stderr
    assert "not used: humidity_pct" in done.stderr


@pytest.mark.parametrize("command", ["fit", "trace"])
def test_attitude(tmp_path, command):
    pitch = np.tile(np.arange(-60.0, 61.0, 30.0), 6)
    n, rng = len(pitch), np.random.default_rng(1)
    table = {
        "replicate": np.repeat([0, 1, 2], n // 3),
        "order": np.arange(n),
        "elapsed_s": 60.0 * np.arange(n),
        "pitch_deg": pitch,
        "roll_deg": np.zeros(n),
        "sensor_temperature_degC": np.full(n, 25.0),
        "x_V": 0.1 + 2.5 * np.sin(np.radians(pitch)) + rng.normal(0, 1e-4, n),
        "acc_mV": np.ones(n),
        "mains": np.full(n, 230.0),
    }
    write_csv(table, tmp_path / "t.csv")
    done = rig(command, "t.csv", "--json", cwd=tmp_path)
    assert unused(done) == {
        "acc_mV": "outputs are read in V: convert it and name it acc_V",
        "mains": "plays no part",
    }
    assert "not used: mains" in done.stderr


def test_any_table_fitted(tmp_path):
    (tmp_path / "t.csv").write_text("x,y,who,gappy,t\n1,1,a,1,1\n2,2.1,b,,2\n3,3,c,3,3\n4,3.8,d,4,4\n")
    done = rig("fit", "t.csv", "--response", "y", "--formula", "1 + x", "--json", cwd=tmp_path)
    assert unused(done) == {"who": "plays no part", "t": "plays no part", "gappy": "a value is missing (row 3)"}
    assert "not used: t, who" in done.stderr
    assert "gappy is not used: a value is missing (row 3)" in done.stderr


def test_any_table_traced(tmp_path):
    rng, x = np.random.default_rng(2), np.tile(np.arange(10.0), 4)
    y = 1.0 + 2.0 * x + rng.normal(0, 0.1, 40)
    lines = [
        f"{a},{b},{'' if i == 4 else i % 3},7,{'uv'[i % 2]},{rng.normal():.3f},{rng.normal():.3f}"
        for i, (a, b) in enumerate(zip(x, y.tolist(), strict=True))
    ]
    (tmp_path / "t.csv").write_text("\n".join(["x,y,gappy,level,who,left,seen", *lines]) + "\n")
    options = ("--response", "y", "--formula", "1 + x", "--ignore", "left")
    done = rig("trace", "t.csv", *options, "--json", cwd=tmp_path)
    assert unused(done) == {
        "gappy": "a value is missing (row 6)",
        "level": "does not vary",
        "who": "holds text",
        "left": "named with --ignore",
    }
    assert "gappy is not used" in done.stderr


@pytest.mark.parametrize(
    ("name", "other"),
    [
        ("bridge_1_V", "bridge_1_mV"),
        ("Bridge_1_MV", "bridge_1_mV"),
        ("bridge_1", "bridge_1_mV"),
        ("bridge_2_V", None),
        ("bridge_1_mV", None),
        ("time_s", None),
    ],
)
def test_a_name_that_differs_only_by_its_unit(name, other):
    assert other_unit(name, ["bridge_1_mV"]) == other
