"""Numbers of certificates of others: into the register of equipment, and into tables for fits."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest
from command import rig
from sample_certificate import document
from test_dcc import LIST, keys, others  # noqa: F401 - a fixture

from rig.cli import app  # noqa: F401 - commands are registered
from rig.cli.certificate import _padded
from rig.dcc.read_dcc import parsed
from rig.errors import UsageError
from rig.register import parse_register
from rig.register.from_dcc import Wanted, equipment_text
from rig.units.si import ratio
from rig.verbs.certificate.as_dcc import dcc
from rig.verbs.infer import read_calibration

THERMOMETER = (
    '<quantity refType="b_reading"><name><content>reading</content></name><s:realListXMLList>'
    "<s:valueXMLList>373.15 273.15</s:valueXMLList><s:unitXMLList>\\\\kelvin</s:unitXMLList></s:realListXMLList>"
    "</quantity>"
)


def thermometer(path: Path, u: str = "0.060 0.040", k: str = "2") -> Path:
    """A certificate of errors at two temperatures."""
    errors = LIST.format(values="0.072 -0.01", units="\\\\kelvin", u=u).replace(">2<", f">{k}<")
    xml = others(errors, ref="b_error").decode().replace("</data>", THERMOMETER.replace("\\\\", "\\") + "</data>")
    path.write_text(xml)
    return path


def test_numbers_of_others_go_into_the_register(tmp_path):
    file = thermometer(tmp_path / "t.xml")
    asked = ["--as-equipment", "T-1", "--quantity", "bath_degC", "--error", "b_error", "--at", "b_reading"]
    done = rig("certificate", "--read", file, *asked)
    assert done.returncode == 0, done.stderr
    assert "not signed" in done.stderr
    register = parse_register(done.stdout, "made")
    (says,) = register.equipment["T-1"].says
    assert says.table == ((0.0, 0.01, 0.04), (100.0, -0.072, 0.06)), "corrections of errors, in the order of degC"
    assert (says.quantity, says.unit, says.k, says.probability) == ("bath_degC", "degC", 2.0, 0.95)
    certificate = register.equipment["T-1"].certificate
    assert certificate is not None
    assert (certificate.number, certificate.laboratory, str(certificate.date)) == ("X 1", "Labor", "2026-01-02")


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (["--quantity", "bath_degC"], "say whether the values are errors"),
        (["--quantity", "bath_degC", "--error", "b_error", "--correction", "b_error"], "say whether the values"),
        (["--error", "b_error"], "name the column or unit"),
        (["--quantity", "bath_degC", "--error", "b_error"], "say at which settings"),
        (["--quantity", "force_kN", "--error", "b_error", "--at", "b_reading"], "does not convert to 'kN'"),
        (["--quantity", "bath_degC", "--error", "b_reading", "--at", "b_error"], "no coverage factor and probability"),
        (["--quantity", "bath_degC", "--error", "nothing", "--at", "b_reading"], "no value 'nothing'"),
    ],
)
def test_numbers_that_cannot_go_into_the_register(tmp_path, asked, words):
    done = rig("certificate", "--read", thermometer(tmp_path / "t.xml"), "--as-equipment", "T-1", *asked)
    assert (done.returncode, words in done.stderr, done.stdout) == (2, True, "")


def test_nothing_untraceable_goes_into_the_register(tmp_path):
    file = tmp_path / "t.xml"
    file.write_bytes(dcc(document(simulated=True), b"%PDF"))
    done = rig("certificate", "--read", file, "--as-equipment", "T-1", "--quantity", "V", "--correction", "offset")
    assert (done.returncode, done.stdout) == (2, "")
    assert "says that it is not traceable (SIMULATED: Simulated run: no real instrument was involved." in done.stderr
    assert "it says that it is not traceable: SIMULATED" in rig("certificate", "--read", file).stdout
    file.write_bytes(dcc(document(), b"%PDF"))
    assert "traceable" not in rig("certificate", "--read", file).stdout


def test_several_coverage_factors_are_not_one(tmp_path):
    file = thermometer(tmp_path / "t.xml", k="2 2.1")
    asked = ["--as-equipment", "T-1", "--quantity", "bath_degC", "--error", "b_error", "--at", "b_reading"]
    assert "several coverage factors" in rig("certificate", "--read", file, *asked).stderr


def test_nothing_is_taken_from_a_changed_certificate(keys, tmp_path):  # noqa: F811
    pytest.importorskip("signxml")
    from rig.dcc.signature import signed  # noqa: PLC0415

    file = tmp_path / "signed.xml"
    file.write_bytes(signed(thermometer(tmp_path / "t.xml").read_bytes(), keys / "ec.key", keys / "ec.pem"))
    asked = [
        "--read",
        file,
        "--as-equipment",
        "T-1",
        "--quantity",
        "bath_degC",
        "--error",
        "b_error",
        "--at",
        "b_reading",
    ]
    assert "signature holds" in rig("certificate", *asked).stderr
    assert rig("certificate", "--read", file, "--authority", keys / "ec.pem").returncode == 0
    assert rig("certificate", "--read", file, "--authority", keys / "rsa.pem").returncode == 1
    file.write_bytes(file.read_bytes().replace(b"0.072", b"0.027"))
    done = rig("certificate", *asked)
    assert (done.returncode, "nothing is taken from" in done.stderr, done.stdout) == (2, True, "")
    assert rig("certificate", "--read", file).returncode == 1


PTB = {
    "basic_referenceValue": ("273.149 283.151 293.151 303.149 313.149 323.149 333.150 303.151 273.151", "\\kelvin"),
    "basic_measuredValue": (
        "100.0220 103.9329 107.8300 111.7130 115.5841 119.4422 123.2880 111.7131 100.0224",
        "\\kilogram\\metre\\tothe{2}\\ampere\\tothe{-2}\\second\\tothe{-3}",
    ),
}
"""Values of PTB's good-practice example of a resistance thermometer (GP_DCC_temperature_resistance_1.2)."""
PRINTED = (100.0225, 0.0039155, -6.469e-7)
"""R0 in ohm, A and B of Callendar's equation as that certificate gives them."""


def resistance(path: Path) -> Path:
    """A certificate with these values."""
    u = "0.0039 0.0041 0.0042 0.0044 0.0045 0.0047 0.0048 0.0044 0.0039"
    known = "<quantity refType='{}'><s:realListXMLList><s:valueXMLList>{}</s:valueXMLList>"
    known += "<s:unitXMLList>{}</s:unitXMLList></s:realListXMLList></quantity>"
    given = known.format("basic_referenceValue", *PTB["basic_referenceValue"])
    values, unit = PTB["basic_measuredValue"]
    xml = others(LIST.format(values=values, units=unit, u=u), ref="basic_measuredValue").decode()
    path.write_text(xml.replace("</data>", f"{given}</data>"))
    return path


def test_a_thermometer_of_ptbs_example_has_the_coefficients_of_its_certificate(tmp_path):
    file, table = resistance(tmp_path / "prt.xml"), tmp_path / "prt.csv"
    columns = ["--column", "bath_degC=basic_referenceValue", "--column", "prt_ohm=basic_measuredValue"]
    done = rig("certificate", "--read", file, *columns)
    assert done.returncode == 0, done.stderr
    assert "mostly common to its rows" in done.stderr
    table.write_text(done.stdout)
    rows = list(csv.DictReader(done.stdout.splitlines()))
    assert (rows[0]["bath_degC"], rows[0]["prt_ohm"], rows[0]["u_prt_ohm"]) == ("-0.001", "100.022", "0.00195")
    fitted = tmp_path / "prt.json"
    model = ["--response", "prt_ohm", "--formula", "1 + bath_degC + bath_degC^2", "--u-y", "u_prt_ohm"]
    assert rig("fit", table, *model, "--out", fitted).returncode == 0
    r0, a, b = read_calibration(fitted).calibration.coefficients
    assert (r0, a / r0, b / r0) == pytest.approx(PRINTED, rel=2.5e-3)
    assert (r0, a / r0) == pytest.approx(PRINTED[:2], rel=2e-5), "of five digits or more"


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        (["bath_degC"], "say a column and values of the certificate"),
        (["bath=basic_referenceValue"], "the column's name ends in its unit"),
        (["bath_V=basic_referenceValue"], "which does not convert to 'V'"),
        (["bath_degC=nothing"], "no value 'nothing'. It has: R / error"),
    ],
)
def test_a_table_that_cannot_be_made_is_one_message(tmp_path, columns, words):
    given = [part for one in columns for part in ("--column", one)]
    done = rig("certificate", "--read", resistance(tmp_path / "prt.xml"), *given)
    assert (done.returncode, words in done.stderr, done.stdout) == (2, True, "")


def test_a_setting_that_was_taken_twice_is_not_two_corrections(tmp_path):
    file = thermometer(tmp_path / "t.xml")
    file.write_text(file.read_text().replace("373.15 273.15", "273.15 273.15"))
    asked = ["--as-equipment", "T-1", "--quantity", "bath_degC", "--error", "b_error", "--at", "b_reading"]
    done = rig("certificate", "--read", file, *asked)
    assert (done.returncode, "has a setting more than once" in done.stderr, done.stdout) == (2, True, "")


def test_single_values_of_one_name_are_rows():
    """As a list of quantities has them; a certificate of a force machine from the Philippines does."""
    body = "<s:real><s:value>{}</s:value><s:unit>\\newton</s:unit></s:real>"
    one = f"<quantity><name><content>{{}}</content></name>{body}</quantity>"
    xml = others(body.format(2).replace("\\", "\\\\")).decode()
    values = (100.76, 200.19, 300.12)
    rows = xml.replace("</data>", f"{''.join(one.format('applied', value) for value in values)}</data>")
    assert tuple(number.value for number in parsed(rows.encode(), "x.xml").find("applied").numbers) == values
    twice = parsed(xml.replace("</data>", f"{one.format('error', 1)}</data>").encode(), "x.xml")
    with pytest.raises(UsageError, match="several values 'error'"):  # of another refType
        twice.find("error")


def test_a_standard_uncertainty_alone_is_one_standard_deviation():
    unc = "<s:measurementUncertaintyUnivariate><s:standardMU><s:valueStandardMU>0.5</s:valueStandardMU></s:standardMU>"
    body = f"<s:real><s:value>2</s:value><s:unit>\\\\kelvin</s:unit>{unc}</s:measurementUncertaintyUnivariate></s:real>"
    read = parsed(others(body), "x.xml")
    text = equipment_text(read, Wanted("T-1", "bath_degC", "error", "error"), "0" * 64)
    (says,) = parse_register(text, "made").equipment["T-1"].says
    assert (says.correction, says.expanded, says.k, says.probability) == (-2.0, 0.5, 1.0, 0.6827)


@pytest.mark.parametrize(
    ("of", "to", "number"),
    [
        ("kg*m^2/A^2/s^3", "ohm", 1.0),
        ("kg*m^2/s^3/A", "mV", 1e3),
        ("kg/m/s^2", "psi", 1 / 6894.757293168),  # NIST SP 811, B.8
        ("", "%", 100.0),
        ("", "pct", 100.0),
        ("mV/V", "ppm", 1e3),
        ("1/K", "1/degC", 1.0),
        ("deg", "rad", 0.017453292519943),
        ("N", "J", None),
        ("stone", "kg", None),
    ],
)
def test_units_of_others_convert_by_their_base_units(of, to, number):
    assert ratio(of, to) == (number if number is None else pytest.approx(number, rel=1e-12))


@pytest.mark.parametrize(
    ("value", "expanded", "shown"),
    [
        (2.0, 0.011, "2.000"),
        (47.8, 1.7, "47.8"),
        (20.00123, 0.01, "20.00123"),
        (5.0, None, "5.0"),
        (1e-7, 2e-9, "1e-07"),
    ],
)
def test_a_value_is_shown_with_the_zeros_that_its_uncertainty_has_digits_for(value, expanded, shown):
    """It was 2.0 beside 0.011 where the certificate has 2.000."""
    assert _padded(value, expanded) == shown
