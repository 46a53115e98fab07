"""`rig plan` with a register promises total uncertainty, and says what more points would no longer buy."""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import date

import pytest

from rig.closed_loop.promised import expired, promised
from rig.errors import ConfigurationError
from rig.plans import Plan, load_plan
from rig.register import DOCUMENT
from tests.dry import LAB, SHORT, write_short
from tests.dry_pressure import LAB as PRESSURE_LAB
from tests.dry_pressure import SHORT as SHORT_PRESSURE

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


def test_a_certificate_that_does_not_cover_the_plan_is_refused_before_the_night(tmp_path):
    plan = attitude(tmp_path)
    narrow = plan.documents[DOCUMENT].replace("range = [-185, 185]", "range = [-60, 60]", 1)
    with pytest.raises(ConfigurationError, match=r"says\.0\.range: the certificate covers -60 to 60, and pitch_deg"):
        promised(replace(plan, documents={**plan.documents, DOCUMENT: narrow}), TODAY)


def test_without_a_register_a_plan_says_repeatability_only(tmp_path):
    plan = attitude(tmp_path)
    documents = {name: text for name, text in plan.documents.items() if name != DOCUMENT}
    assert (
        promised(replace(plan, documents=documents), TODAY)
        .notes[0]
        .startswith("repeatability only: the bench has no register")
    )


def test_certificates_that_expire_before_the_end_are_named_where_the_bench_has_no_date(tmp_path):
    plan = attitude(tmp_path)
    assert expired(plan, date(2027, 2, 1)) == []  # the bench file has the voltmeter's date
    without = plan.bench.instruments["scanner"].model_copy(update={"due": None})
    bench = plan.bench.model_copy(update={"instruments": {**plan.bench.instruments, "scanner": without}})
    plan = replace(plan, bench=bench)
    assert expired(plan, date(2027, 1, 31)) == []
    (said,) = expired(plan, date(2027, 2, 1))
    assert said.startswith(
        "equipment.toml: equipment.DVM-0102.certificate.due = 2027-01-31, and this run would end on 2027"
    )
