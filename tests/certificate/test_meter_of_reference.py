"""Errors of the meter behind a reference standard: through the formula of the bench file, and through the whole fit."""

from __future__ import annotations

from datetime import date

import numpy as np
import pytest
from test_influences import by_result, general

from rig.bench.config import parse_bench
from rig.errors import ConfigurationError
from rig.procedures.evaluate.influences import corrected, influences
from rig.register import check_covered, parse_register, stated_of
from rig.register.computed import computed_from
from rig.unattended.doctor.instruments import check_stated

METER = '[instruments.{0}]\ndriver = "keysight-34970a"\naddress = "/dev/rig/{0}"\n'
TWO = 'channels = {"101" = "volts", "102" = "volts"}\n'
BENCH = f"""name = "stand"
{METER.format("scanner")}asset = "DVM-1"
{TWO}
{METER.format("other")}asset = "DVM-2"
{TWO}
[instruments.operator]
driver = "person"
[sensors.cell]
reader = "other"
channel = "101"
[references.force_kN]
reader = "scanner"
channel = "102"
formula = "0.02 + 4*reading"
asset = "REF-1"
[factors]
force_kN = "operator"
"""
SAYS = '[[equipment.{}.says]]\nquantity = "{}"\nbehaves = "{}"\nunit = "{}"\nstandard = {}\n'
EQUIPMENT = "".join(
    f'[equipment.{asset}.certificate]\nnumber = "{asset}"\ndate = 2026-01-01\nlaboratory = "L"\n'
    for asset in ("DVM-1", "DVM-2", "REF-1")
)
GAIN, OFFSET = SAYS.format("DVM-1", "V", "gain", "ppm", 20), SAYS.format("DVM-1", "V", "offset", "mV", 0.5)
REFERENCE = SAYS.format("REF-1", "force_kN", "gain", "ppm", 100)
TODAY = date(2026, 6, 1)


def stated(says, bench=BENCH):
    return stated_of(parse_register(f'name = "r"\n{EQUIPMENT}{says}', "r"), parse_bench(bench, "b"), TODAY)


def moved(says, bench=BENCH):
    evaluation = general()
    found = influences(evaluation, stated(says, bench), same_meter=False)
    return {one.name: by_result(evaluation, one) for one in found.influences}, found.notes


def test_a_gain_and_an_offset_of_the_meter_behind_a_reference_go_through_the_abscissa():
    by_name, _ = moved(GAIN + OFFSET + REFERENCE)
    slope, inferred = "cell coefficient force_kN", "cell inferred force at force 4 kN"
    assert abs(by_name["DVM-1 gain of V"][slope]) == pytest.approx(0.5 * 20e-6, rel=1e-3)
    # the reading is (4 - 0.02) / 4 V, and 20 ppm of it are 4 * 20e-6 times as many kN
    assert abs(by_name["DVM-1 gain of V"][inferred]) == pytest.approx(3.98 * 20e-6, rel=1e-3)
    assert abs(by_name["DVM-1 offset of V"][inferred]) == pytest.approx(4 * 0.5e-3, rel=1e-3)


def test_a_meter_that_reads_both_cancels_as_far_as_its_error_is_common():
    both = BENCH.replace('reader = "other"', 'reader = "scanner"')
    by_name, _ = moved(GAIN + REFERENCE, both)
    assert abs(by_name["DVM-1 gain of V"]["cell coefficient force_kN"]) < 1e-3 * 0.5 * 20e-6
    # the reference reads 0 V at 0.02 kN, and the cell at -0.02 kN
    assert abs(by_name["DVM-1 gain of V"]["cell inferred force at force 4 kN"]) == pytest.approx(0.04 * 20e-6, rel=0.05)


def test_a_correction_of_the_meter_corrects_the_reference():
    errors = stated(GAIN + "correction = 100\n").errors
    (found,) = corrected({"force_kN": np.array([0.02, 4.02])}, errors).values()
    assert found == pytest.approx([0.02, 4.02 + 4 * 100e-6], abs=1e-12)


def test_a_meter_behind_a_reference_without_stated_errors_is_told():
    told = stated(REFERENCE).lacking
    assert any(
        "references.force_kN: the register states no errors in V of DVM-1, which reads it" in one for one in told
    )
    assert not any("references" in one for one in stated(REFERENCE + GAIN).lacking)


def test_the_errors_of_its_meter_are_not_those_of_the_reference():
    other = SAYS.format("DVM-2", "V", "gain", "ppm", 1)
    assert stated(GAIN + other).unstated(general().columns) == ("force_kN",)


def test_a_range_is_that_of_the_reading():
    narrow = stated(GAIN + "range = [0, 2]\n")
    check_covered(narrow, {"force_kN": np.array([0.1, 8.0])}, "r")
    with pytest.raises(ConfigurationError, match=r"the reading of force_kN of the run goes from 0\.02 to 2\.47"):
        check_covered(narrow, {"force_kN": np.array([0.1, 9.9])}, "r")


@pytest.mark.parametrize(
    "formula", ["1 + 2*reading", "0.1 + 3*reading + 0.2*reading^2 - 0.01*reading^3", "exp(reading)"]
)
def test_readings_are_found_from_the_values_of_a_formula(formula):
    way = computed_from("force_kN", formula, 1e-3)
    readings = np.linspace(1.0, 3000.0, 50)  # in mV
    assert way.reading(way.value(readings)) == pytest.approx(readings, rel=1e-9)


def test_a_value_that_no_reading_gives_is_told():
    with pytest.raises(ConfigurationError, match=r"references.force_kN.formula: no reading was found .* force_kN = -1"):
        computed_from("force_kN", "reading^2", 1.0).reading(np.array([4.0, -1.0]))


def test_a_statement_in_another_prefix_of_the_unit_is_that_of_the_column():
    own, other = (
        moved(SAYS.format("REF-1", name, "offset", unit, "0.003") + GAIN)[0]["REF-1 offset of " + name]
        for name, unit in (("force_kN", "kN"), ("force_MN", "kN"))
    )
    assert own == pytest.approx(other)
    assert (
        stated(SAYS.format("REF-1", "load_kN", "offset", "kN", 1))
        .lacking[0]
        .startswith("equipment.REF-1.says.0 is not used: REF-1 gives no load_kN, but force_kN; correct the quantity")
    )


def test_the_doctor_warns_of_a_register_that_states_too_little():
    config = parse_bench(BENCH, "b")
    text = f'name = "r"\n{EQUIPMENT}' + SAYS.format("REF-1", "load_kN", "offset", "kN", 1)
    found = [one.found for one in check_stated(config, parse_register(text, "r"), 1.8e9)]
    assert found[0] == "it states no errors of cell_V, force_kN"
    assert "says.0 is not used" in found[1]
    assert "DVM-1, which reads it" in found[2]
    whole = f'name = "r"\n{EQUIPMENT}{GAIN}{REFERENCE}' + SAYS.format("DVM-2", "V", "gain", "ppm", 1)
    assert [one.level for one in check_stated(config, parse_register(whole, "r"), 1.8e9)] == ["ok"]
