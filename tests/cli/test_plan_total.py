"""`rig plan` with a register promises total uncertainty, and says what more points would no longer buy."""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import date
from pathlib import Path

import pytest
from certificate_lab import REGISTER
from dry import LAB, SHORT, write_short
from dry_pressure import LAB as PRESSURE_LAB
from dry_pressure import SHORT as SHORT_PRESSURE
from general_lab import BENCH, PROCEDURE, written
from test_hard_anything import FIXTURE_PROCEDURE

from rig.bench.config import parse_procedure
from rig.engine.session import Signals
from rig.errors import ConfigurationError
from rig.examples import example
from rig.fitter.split_plot import fit_split_plot
from rig.procedures.general.of_runs import RunModels, fit_run
from rig.procedures.general.planned import expected_run
from rig.procedures.pressure.planned import coded_columns
from rig.procedures.pressure.planned import expected_run as expected_pressures
from rig.register import DOCUMENT
from rig.runs.controller import start_run
from rig.runs.plans import Plan, load_plan
from rig.verbs.budget.result import budget
from rig.verbs.plan.foreseen import expired
from rig.verbs.plan.promised import promised

TODAY = date(2026, 11, 24)


def attitude(folder, replications: int = 2, more: str = "") -> Plan:
    text = SHORT.replace("replications = 2", f"replications = {replications}") + more
    return load_plan(write_short(folder, text), LAB / "bench.toml", dry=True)


def test_a_head_that_dominates_is_named_and_more_points_buy_little(tmp_path):
    plan = attitude(tmp_path)
    coarse = re.sub(
        r"(behaves = \"offset\"\nunit = \"arcsec\"\nexpanded = )1\n", r"\g<1>20\n", plan.documents[DOCUMENT]
    )
    assert coarse != plan.documents[DOCUMENT]
    plan = replace(plan, documents={**plan.documents, DOCUMENT: coarse})
    (level,) = (one for one in promised(plan, TODAY).results if one.name == "inferred pitch at pitch 0 deg, roll 0 deg")
    assert level.dominant == "HD-0417 offset of pitch_deg"
    assert level.share > 0.9
    assert level.repeatability < level.limit <= level.expanded
    assert 1.0 - level.limit / level.expanded < 0.02


def test_more_replications_approach_the_limit(tmp_path):
    few, many = (promised(attitude(tmp_path, n), TODAY).results[0] for n in (2, 12))
    assert many.expanded < few.expanded
    assert many.expanded > 0.98 * few.limit


def test_errors_of_the_voltmeter_are_forecast_where_the_sensitivity_is_expected(tmp_path):
    without = promised(attitude(tmp_path), TODAY)
    assert any("errors of the outputs' meter are not in it" in note for note in without.notes)
    told = promised(attitude(tmp_path, more="[expect]\nsensitivity_V_per_g = 0.1\n"), TODAY)
    assert not any("errors of the outputs' meter" in note for note in told.notes)
    # 50 uV at 0.1 V/g is 0.03 deg
    assert told.results[0].expanded > 10 * without.results[0].expanded


def test_pressures_are_promised_by_their_standard(tmp_path):
    path = tmp_path / "p.toml"
    path.write_text(SHORT_PRESSURE)
    found = promised(load_plan(path, PRESSURE_LAB / "bench.toml", dry=True), TODAY)
    assert {one.unit for one in found.results} == {"psi"}
    assert all(one.expanded > one.limit > 0.0 for one in found.results)


def general(folder, expect: str, procedure: str = PROCEDURE, bench: str = BENCH) -> Plan:
    bench = bench.replace('driver = "person"', 'driver = "person"\nasset = "W-1"')
    (folder / "equipment.toml").write_text(REGISTER)
    files = written(folder, f"{procedure}[expect]\n{expect}", bench.replace("nplc = 1", 'nplc = 1\nasset = "DVM-1"'))
    return load_plan(files[0], files[1], dry=True, world=files[2])


def test_a_general_run_keeps_what_its_plan_promised(tmp_path):
    """The world of the stand is 0.1 V + 0.5 V/kN; the voltmeter has noise of 4e-5 V."""
    plan = general(tmp_path, "sigma = { cell = 4e-5 }\noutput = { cell = '0.1 + 0.5*force_kN' }\n")
    told = promised(plan, TODAY)
    paths: list[Path] = []
    start_run(plan, tmp_path, signals=Signals(), announce=paths.append, on_progress=lambda _: None)
    found = {one.name: one for one in budget(paths[0]).found.budgets}
    assert len(told.results) == 3
    for one in told.results:
        assert one.expanded == pytest.approx(found[one.name].expanded_uncertainty, rel=0.03)
        assert one.dominant == found[one.name].contributions[0].name
        assert one.repeatability < one.limit <= one.expanded
    assert told.notes[0].endswith("cell = 0.1 + 0.5*force_kN with sd 4e-05 ([expect])")


def test_more_replications_of_a_general_run_approach_the_limit(tmp_path):
    expect = "sigma = { cell = 0.01 }\noutput = { cell = '0.1 + 0.5*force_kN' }\n"
    few, many = (
        promised(general(tmp_path, expect, PROCEDURE.replace("replications = 2", f"replications = {n}")), TODAY)
        for n in (2, 40)
    )
    assert all(b.expanded < a.expanded for a, b in zip(few.results, many.results, strict=True))
    assert all(b.expanded < 1.02 * a.limit for a, b in zip(few.results, many.results, strict=True))


@pytest.mark.parametrize(
    ("expect", "says"),
    [
        (
            "sigma = { cell = 2e-5 }\n",
            "no total uncertainty is predicted: [expect] has not both, output and sigma, of a sensor (cell: no output)",
        ),
        ("sigma = { cell = 1 }\noutput = { cell = '1 + force' }\n", "output.cell: force is not a factor (force_kN)"),
        ("sigma = { cell = 1 }\noutput = { cell = '1/(force_kN - 5)' }\n", "it has no value at a setting of the plan"),
        ("sigma = { cell = 1 }\noutput = { cell = '1 +' }\n", "expect.output.cell: "),
    ],
)
def test_what_a_general_plan_cannot_promise_is_said(tmp_path, expect, says):
    told = promised(general(tmp_path, expect), TODAY)
    assert told.results == ()
    assert says in told.notes[0]


def test_a_plan_names_what_the_register_says_nothing_of(tmp_path):
    expect = "sigma = { cell = 4e-5 }\noutput = { cell = '0.1 + 0.5*force_kN' }\n"
    plan = general(tmp_path, expect)
    without = plan.documents[DOCUMENT].replace('"force_kN"', '"torque_Nm"')
    told = promised(replace(plan, documents={**plan.documents, DOCUMENT: without}), TODAY)
    assert told.lacking[0].startswith("the register states no errors of force_kN: none are in these uncertainties")
    assert not any("states no errors" in note for note in promised(plan, TODAY).lacking)


def test_outputs_are_promised_where_no_reading_determines_a_quantity(tmp_path):
    """Thermometers in the bath at several currents: a voltage alone gives neither the temperature nor the current."""
    lab = example("bath-lab")
    procedure, bench = ((lab / f"{name}.toml").read_text() for name in ("procedure", "bench"))
    (tmp_path / "procedure.toml").write_text(
        f'{procedure}\noutput = {{ prt_1 = "1e5*current_A*(1 + 4e-3*bath_degC)" }}\n'
    )
    (tmp_path / "bench.toml").write_text(
        bench.replace("[references.bath_degC]", '[references.bath_degC]\nasset = "X"', 1)
    )
    said = 'quantity = "bath_degC"\nunit = "K"\nstandard = 0.005\n'
    certificate = '[equipment.X.certificate]\nnumber = "1"\ndate = 2025-01-01\nlaboratory = "l"\n'
    (tmp_path / "equipment.toml").write_text(f"[equipment.X]\n{certificate}[[equipment.X.says]]\n{said}")
    told = promised(load_plan(tmp_path / "procedure.toml", tmp_path / "bench.toml", dry=True), TODAY)
    (one,) = told.results
    assert one.name == "prt_1 output at current 0.00125 A, bath 50 degC"
    assert one.dominant == "X offset of bath_degC"
    # 5 mK at 400 ohm/K and 1.25 mA: 2.5 uV
    assert one.expanded == pytest.approx(1.96 * 1e5 * 1.25e-3 * 4e-3 * 0.005, rel=0.01)
    assert "errors of whole plots 1 times as large (expect.whole_plot_ratio)" in told.notes[0]
    assert any("states no errors of current_A, prt_1_mV" in note for note in told.lacking)


@pytest.mark.parametrize("ratio", [0.3, 4.0])
def test_the_forecast_of_whole_plots_is_that_of_the_declared_errors_and_of_no_draw(ratio):
    """The repeatability depended on one draw of the errors of ten whole plots, and so on the order of the run."""
    expect = "[expect]\nsigma = { meter = 1e-3 }\noutput = { meter = '0.01 + 0.02*gap_mm + input_V' }\n"
    text = FIXTURE_PROCEDURE.replace("REPLICATIONS", "5") + expect + f"whole_plot_ratio = {ratio}\n"
    errors = []
    for seed in (3, 4, 5):
        procedure = parse_procedure(text.replace("seed = 3", f"seed = {seed}"), "procedure.toml")
        table = expected_run(procedure, procedure.expand(), {"meter_V": "meter"}).table
        fit = fit_run(RunModels.of(table)).result
        assert fit["sigma_subplot"] == pytest.approx(1e-3, rel=1e-6)
        assert fit["sigma_wholeplot"] == pytest.approx(ratio * 1e-3, rel=1e-6)
        errors.append([one["stderr"] for one in fit["coefficients"].values()])
    assert errors[0] == pytest.approx(errors[1], rel=1e-6)
    assert errors[0] == pytest.approx(errors[2], rel=1e-6)


def test_an_expected_output_of_no_sensor_is_refused(tmp_path):
    with pytest.raises(ConfigurationError, match="sell"):
        general(tmp_path, "output = { sell = '1 + force_kN' }\n")


def test_a_certificate_that_does_not_cover_the_plan_is_refused_before_the_night(tmp_path):
    plan = attitude(tmp_path)
    narrow = plan.documents[DOCUMENT].replace("range = [-185, 185]", "range = [-60, 60]", 1)
    with pytest.raises(ConfigurationError, match=r"says\.0\.range: the certificate covers -60 to 60, and pitch_deg"):
        promised(replace(plan, documents={**plan.documents, DOCUMENT: narrow}), TODAY)


def test_without_a_register_a_plan_says_that_no_total_uncertainty_is_predicted(tmp_path):
    plan = attitude(tmp_path)
    documents = {name: text for name, text in plan.documents.items() if name != DOCUMENT}
    assert (
        promised(replace(plan, documents=documents), TODAY)
        .notes[0]
        .startswith("no total uncertainty is predicted: the bench has no register")
    )


def test_certificates_that_expire_before_the_end_are_named_where_the_bench_has_no_date(tmp_path):
    plan = attitude(tmp_path)
    assert expired(plan, TODAY, date(2027, 2, 1)) == []  # the bench file has the voltmeter's date
    without = plan.bench.instruments["scanner"].model_copy(update={"due": None})
    bench = plan.bench.model_copy(update={"instruments": {**plan.bench.instruments, "scanner": without}})
    plan = replace(plan, bench=bench)
    assert expired(plan, TODAY, date(2027, 1, 31)) == []
    (said,) = expired(plan, TODAY, date(2027, 2, 1))
    assert said.startswith(
        "equipment.toml: equipment.DVM-0102.certificate.due = 2027-01-31, and this run would end on 2027"
    )


def test_the_forecast_of_a_pressure_run_has_its_declared_errors():
    procedure = parse_procedure((PRESSURE_LAB / "procedure.toml").read_text(), "procedure.toml")
    run_list = procedure.expand()
    table = expected_pressures(procedure, run_list, {"cell_mV": "cell"}).table
    names, columns = coded_columns(procedure, run_list)
    fit = fit_split_plot(columns, table.columns["cell_mV"], table.columns["whole_plot"], names)
    expect = procedure.expect
    assert fit.sigma_subplot == pytest.approx(expect.sigma_subplot_mV, rel=1e-6)
    assert fit.sigma_wholeplot == pytest.approx(expect.sigma_wholeplot_mV, rel=1e-6)
