"""One declared model: what a whole-plot procedure plans is what fit, trace and acceptance use."""

from __future__ import annotations

import json

import pytest
from command import rig
from dry_pressure import LAB, SHORT, dry

from proving.truth.whole_plot import Bench, Run, simulate
from rig.bench.config import parse_procedure
from rig.tables import write_csv

ONE_TEMPERATURE = (
    SHORT.replace("[[10, 20], [20, 10], [20, 30], [30, 20], [15, 15]]", "[[20, 20], [20, 20]]")
    .replace("pressures_psia = [0.12, 0.5, 1.0, 2.5]", "pressures_psia = [0.12, 1.0, 2.5]")
    .replace("repeated_psia = [0.5]", "repeated_psia = []")
)
DECLARED = 'formula = "1 + P + T_sensor + T_SSE"'
BENCH = ("--bench", LAB / "bench.toml")


@pytest.mark.parametrize("model", ["", 'formula = "full"', DECLARED])
@pytest.mark.parametrize("command", [("plan",), ("run", "--dry")])
def test_a_design_that_cannot_estimate_it_is_refused_before_the_night(tmp_path, model, command):
    procedure = tmp_path / "p.toml"
    procedure.write_text(ONE_TEMPERATURE.replace(DECLARED, model))
    out = ("--out", tmp_path / "runs") if command[0] == "run" else ()
    done = rig(command[0], procedure, *BENCH, *command[1:], *out)
    assert done.returncode == 78
    assert "cannot estimate the declared model" in done.stderr
    assert "T_sensor" in done.stderr
    assert "[model] formula" in done.stderr
    assert not (tmp_path / "runs").exists()


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    text = ONE_TEMPERATURE.replace(DECLARED, 'formula = "1 + P"') + "[acceptance]\nreading_error_pct = 1000\n"
    folder = tmp_path_factory.mktemp("one")
    return dry(folder, text=text)


def fitted(*arguments):
    done = rig(*arguments, "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_fit_trace_and_acceptance_use_the_model_of_the_run_file(run):
    found = fitted("fit", run)
    assert found["data"]["model"]["source"] == "procedure"
    assert set(found["sensors"]["bridge_1_mV"]["coefficients"]) == {"1", "P"}
    assert fitted("trace", run)["sensors"]["bridge_1_mV"]["declared"] == "1 + P"
    from rig.runs.accepted import judge  # noqa: PLC0415
    from rig.runs.plans import load_plan  # noqa: PLC0415

    verdicts = judge(load_plan(run.parent / "short.toml", LAB / "bench.toml").procedure, run)
    assert {v.inside for v in verdicts} == {True}


def test_formula_overrides_and_says_so(run):
    found = fitted("fit", run, "--formula", "1 + P + P^2")
    assert set(found["sensors"]["bridge_1_mV"]["coefficients"]) == {"1", "P", "P^2"}
    said = "model 1 + P + P^2, as --formula says; the run's procedure declares 1 + P"
    assert found["data"]["model"]["sentence"] == said
    assert said in rig("fit", run, "--formula", "1 + P + P^2").stdout


def test_acceptance_that_could_not_be_judged_is_refused(tmp_path):
    procedure = tmp_path / "p.toml"
    text = ONE_TEMPERATURE.replace(DECLARED, 'formula = "1 + P"').replace("[0.12, 1.0, 2.5]", "[0, 0.12, 1.0, 2.5]")
    procedure.write_text(text + "[acceptance]\nreading_error_pct = 5\n")
    done = rig("plan", procedure, *BENCH)
    assert done.returncode == 78
    assert "acceptance.reading_error_pct: in-flight zero + WLS" in done.stderr


def test_earlier_procedures_declare_it_under_expect():
    text = SHORT.replace("[model]\n" + DECLARED, "")
    assert parse_procedure(text + '[expect]\nmodel = "1 + P"\n', "p").declared_model == "1 + P"
    assert parse_procedure(text, "p").declared_model == "full"
    with pytest.raises(Exception, match="are two models"):
        parse_procedure(SHORT + '[expect]\nmodel = "1 + P"\n', "p")


def test_a_table_whose_temperatures_follow_each_other_is_fitted_without_the_second_and_says_so(tmp_path):
    """It was refused: many laboratories record one temperature twice, or set both together."""
    data = simulate(Bench(), Run(pairs=((-1.0, -1.0), (0.0, 0.0), (1.0, 1.0), (0.0, 0.0), (-1.0, -1.0), (1.0, 1.0))), 5)
    path = tmp_path / "alike.csv"
    names = ("whole_plot", "order", "elapsed_s", "pressure_psia", "sensor_temperature_degC", "sse_temperature_degC")
    (mV,) = data.outputs.values()
    write_csv({**{name: getattr(data, name) for name in names}, "bridge_1_mV": mV}, path)
    told = fitted("fit", path)
    assert told["data"]["model"]["source"] == "default"
    assert "do not determine terms of T_SSE" in told["data"]["model"]["sentence"]
    (sensor,) = told["sensors"].values()
    assert not any("T_SSE" in term for term in sensor["coefficients"])
    assert "do not determine terms of T_SSE" in rig("trace", path).stdout.replace("\n", " ")
    asked = rig("fit", path, "--formula", "full")
    assert asked.returncode == 2
    assert "cannot tell apart" in asked.stderr
