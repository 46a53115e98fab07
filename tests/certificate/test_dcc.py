"""Digital calibration certificates: written by PTB's rules, signed, and read, also those of others."""

from __future__ import annotations

import os
import shutil
import subprocess
from dataclasses import replace
from datetime import UTC, datetime
from decimal import Decimal
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from sample_certificate import amended, document

from rig.dcc.read_dcc import parsed, read_dcc
from rig.errors import UsageError
from rig.units.si import plain_unit, si_unit
from rig.verbs.certificate.as_dcc import dcc

NOW = datetime(2026, 11, 24, tzinfo=UTC)
KINDS = {
    "one item": document(),
    "seven items, as found and as left, simulated": document(items=7, simulated=True, stages=("as found", "as left")),
    "amended": amended(document()),
    "without statements, effects and conditions": replace(
        document(), statements=(), effects=(), conditions=(), deviations=(), budgets=(), evidence=()
    ),
}


@pytest.fixture(scope="module")
def rules():
    """PTB's Schematron."""
    validation = pytest.importorskip("dcclib.validation")
    return validation.SchematronValidator.for_dcc()


def broken(rules, xml: bytes) -> list[str]:
    """Rules that a certificate breaks; that 3.3.0 is newer is none."""
    found = rules.validate_str(xml.decode())
    said = [*found.failed_assertions, *found.successful_reports]
    return [one.text for one in said if one.role == "error"]


@pytest.mark.parametrize("kind", KINDS)
def test_ptbs_rules_hold(rules, kind):
    assert broken(rules, dcc(KINDS[kind])) == []


def test_ptbs_rules_can_break(rules):
    wrong = dcc(document()).replace(b'refId="item0"', b'refId="item9"')
    assert broken(rules, wrong) != []


def test_every_result_has_its_expanded_uncertainty():
    made = document(items=2)
    read = parsed(dcc(made), "made.xml")
    results = [number for one in read.quantities if "basic_measuredValue" in one.ref_types for number in one.numbers]
    assert len(results) == sum(len(table.results) for table in made.tables)
    assert all(one.expanded and one.k and one.probability == 0.95 for one in results)


def test_every_budget_of_the_annex_is_in_it():
    made = document()
    read = parsed(dcc(made), "made.xml")
    for budget in made.budgets:
        named = f"{budget.sensor}: uncertainty budget of {budget.label}"
        found = {one.path[-1]: one.numbers[0] for one in read.quantities if named in one.path and one.numbers}
        factor = si_unit(budget.unit).factor
        combined = pytest.approx(float(Decimal(budget.combined) * factor), rel=1e-7)
        assert found["combined standard uncertainty"].value == combined
        assert {one.label for one in budget.contributions} <= set(found)


def test_every_number_is_read_again():
    made = document()
    read = parsed(dcc(made), "made.xml")
    outputs, coefficients = made.tables
    (found,) = [one for one in read.quantities if one.path[-1] == "output" and one.where == "results"]
    assert [one.value for one in found.numbers] == [float(one.value) for one in outputs.results]
    assert [one.expanded for one in found.numbers] == [float(one.expanded) for one in outputs.results]
    by_name = {one.path[-1]: one.numbers[0] for one in read.quantities if one.where == "results" and one.numbers}
    for one in coefficients.results:
        factor = si_unit(one.unit).factor
        assert by_name[one.label].value == pytest.approx(float(Decimal(one.value) * factor), rel=1e-7)
        assert by_name[one.label].expanded == pytest.approx(float(Decimal(one.expanded) * factor), rel=1e-7)


def test_the_number_of_the_laboratory_stands_beside_that_in_si_units():
    root = ET.fromstring(dcc(document()))
    units = [
        [unit.text for unit in hybrid.iter("{https://ptb.de/si}unit")]
        for hybrid in root.iter("{https://ptb.de/si}hybrid")
    ]
    assert ["\\milli\\volt\\pascal\\tothe{-1}", "|mV/psi"] in units


def test_it_reads_who_and_when():
    read = parsed(dcc(amended(document())), "made.xml")
    assert (read.version, read.number) == ("3.2.0", "K-2026-0147-1")
    assert (read.laboratory, read.customer) == ("Hillside Calibration Laboratory", "Meridian Space Systems Ltd")
    assert read.items == ("bridge_1, Northfield Sensors, PT-105A, 441100, MSS-P-001",)
    assert (read.began.isoformat(), read.ended.isoformat(), read.issued.isoformat()) == (
        "2026-11-09",
        "2026-11-14",
        "2026-11-24",
    )
    assert read.conformity == (("bridge_1: error of the inferred pressure at 0.5 psi", "pass"),)
    assert any("Point 41 was skipped" in one for one in read.statements)


def test_every_note_of_the_page_is_in_it():
    """The page said for how many readings inferred values hold, and what is not in the uncertainties; it did not."""
    made = document()
    assert made.notes
    read = parsed(dcc(made), "made.xml")
    assert all(any(note in one for one in read.statements) for note in made.notes)


def test_texts_with_control_characters_stay_xml():
    made = replace(document(), deviations=("a \x00 \x1b[31m <b> & ]]>",))
    read = parsed(dcc(made), "made.xml")
    assert any("<b> & ]]>" in one for one in read.statements)


@pytest.mark.skipif("DCC_SCHEMA" not in os.environ, reason="DCC_SCHEMA names PTB's schema 3.2.0, which is not shipped")
@pytest.mark.parametrize("kind", KINDS)
def test_the_schema_holds(kind):
    from rig.dcc.ptb_schema import schema_errors  # noqa: PLC0415

    assert schema_errors(dcc(KINDS[kind]), Path(os.environ["DCC_SCHEMA"])) == []


OTHERS = """<?xml version="1.0" encoding="UTF-8"?>
<digitalCalibrationCertificate xmlns="https://ptb.de/dcc" xmlns:s="https://ptb.de/si" schemaVersion="{version}">
 <administrativeData>
 <coreData><uniqueIdentifier>X 1</uniqueIdentifier><beginPerformanceDate>2026-01-02</beginPerformanceDate></coreData>
 <items><item><name><content lang="de">Waage</content><content lang="en">Balance</content></name></item></items>
 <calibrationLaboratory><contact><name><content>Labor</content></name></contact></calibrationLaboratory>
 </administrativeData>
 <measurementResults><measurementResult><name><content>M</content></name><results><result><name><content>R</content></name>
 <data><quantity refType="{ref}"><name><content>error</content></name>{body}</quantity></data></result></results>
 </measurementResult></measurementResults></digitalCalibrationCertificate>"""
U = "<s:coverageFactor>2</s:coverageFactor><s:coverageProbability>0.95</s:coverageProbability>"
MU = (
    "<s:measurementUncertaintyUnivariate{0}><s:expandedMU{0}>{1}</s:expandedMU{0}>"
    "</s:measurementUncertaintyUnivariate{0}>"
)
U_LIST = U.replace("Factor>", "FactorXMLList>").replace("bility>", "bilityXMLList>")
REAL = "<s:real><s:value>1.5</s:value><s:unit>\\\\volt</s:unit>{}</s:real>"
OLD = REAL.format(f"<s:expandedUnc><s:uncertainty>0.2</s:uncertainty>{U}</s:expandedUnc>")
FORMS = {
    "expandedUnc": OLD,
    "expandedMU": REAL.format(MU.format("", f"<s:valueExpandedMU>0.2</s:valueExpandedMU>{U}")),
    "list": "<s:realListXMLList><s:valueXMLList>1.5</s:valueXMLList><s:unitXMLList>\\\\volt</s:unitXMLList>"
    + MU.format(
        "XMLList",
        "<s:valueExpandedMUXMLList>0.2</s:valueExpandedMUXMLList>"
        + U.replace("Factor>", "FactorXMLList>").replace("bility>", "bilityXMLList>"),
    )
    + "</s:realListXMLList>",
    "hybrid": f"<s:hybrid><s:real><s:value>9</s:value><s:unit>|stone</s:unit></s:real>{OLD}</s:hybrid>",
}


def others(body: str, version: str = "3.3.0", ref: str = "a_b c_d") -> bytes:
    return OTHERS.format(version=version, body=body.replace("\\\\", "\\"), ref=ref).encode()


@pytest.mark.parametrize("form", FORMS)
def test_certificates_of_others_are_read(form):
    read = parsed(others(FORMS[form]), "x.xml")
    (number,) = read.find("R / error").numbers
    assert (number.value, number.unit, number.expanded, number.k, number.probability) == (1.5, "V", 0.2, 2.0, 0.95)
    assert number.standard == 0.1
    assert read.find("c_d") == read.find("error")
    assert read.items == ("Balance",)


def test_what_is_not_said_is_not_assumed():
    read = parsed(others("<s:real><s:value>1</s:value><s:unit>\\\\metre</s:unit></s:real>"), "x.xml")
    (number,) = read.find("error").numbers
    assert (number.expanded, number.k, number.probability, number.standard) == (None, None, None, None)
    assert (read.issued, read.customer) == (None, "")


LIST = (
    "<s:realListXMLList><s:valueXMLList>{values}</s:valueXMLList><s:unitXMLList>{units}</s:unitXMLList><s:expandedUncXMLList>"
    "<s:uncertaintyXMLList>{u}</s:uncertaintyXMLList><s:coverageFactorXMLList>2</s:coverageFactorXMLList>"
    "<s:coverageProbabilityXMLList>0.95</s:coverageProbabilityXMLList></s:expandedUncXMLList></s:realListXMLList>"
)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"<a/>", "is no digital calibration certificate"),
        (b"<a", "is not valid XML"),
        (b'<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>', "declares a document type"),
        (others(LIST.format(values="1 x 3", units="\\\\kelvin", u="1")), "'x' is not a number"),
        (others(LIST.format(values="1 2 3", units="\\\\kelvin", u="1 2")), "3 values, but 2 of their expanded"),
        (others(LIST.format(values="1 2 3", units="\\\\kelvin \\\\volt", u="1")), "3 values, but 2 units"),
        (others("<s:real><s:value>INF</s:value><s:unit>\\\\volt</s:unit></s:real>"), "'INF' is not a number"),
    ],
)
def test_what_cannot_be_read(data, words):
    with pytest.raises(UsageError, match=words):
        parsed(data, "x.xml")


def test_a_file_that_does_not_exist(tmp_path):
    with pytest.raises(UsageError, match="cannot be read"):
        read_dcc(tmp_path / "none.xml")


@pytest.mark.parametrize(
    ("unit", "text", "factor"),
    [
        ("", "\\one", 1),
        ("mV", "\\milli\\volt", 1),
        ("degC", "\\degreecelsius", 1),
        ("uV/degC", "\\micro\\volt\\kelvin\\tothe{-1}", 1),
        ("mV/(psi*degC)", "\\milli\\volt\\pascal\\tothe{-1}\\kelvin\\tothe{-1}", 1 / 6894.757293168361),
        ("psia", "\\pascal", 6894.757293168361),
        ("V/gn", "\\volt\\metre\\tothe{-1}\\second\\tothe{2}", 1 / 9.80665),
        ("mV*psi^-2", "\\milli\\volt\\pascal\\tothe{-2}", 6894.757293168361**-2),
        ("%", "\\percent", 1),
    ],
)
def test_units_of_the_digital_si(unit, text, factor):
    found = si_unit(unit)
    assert found.text == text
    assert float(found.factor) == pytest.approx(factor, rel=1e-12)


@pytest.mark.parametrize("unit", ["furlong", "mV psi", "V//", "V/(", "V)", "1e3", "degF"])
def test_units_that_do_not_convert_are_refused(unit):
    with pytest.raises(UsageError, match="cannot be written in SI units"):
        si_unit(unit)


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("\\metre\\per\\second\\tothe{2}", "m/s^2"),
        ("\\one", ""),
        ("\\kilogram", "kg"),
        ("\\degreeCelsius", "degC"),
        ("\\foo", "\\foo"),
        ("|psi", "psi"),
    ],
)
def test_units_of_others(text, unit):
    assert plain_unit(text) == unit


@pytest.fixture(scope="module")
def keys(tmp_path_factory) -> Path:
    """An RSA and an elliptic key with their certificates, by openssl."""
    if shutil.which("openssl") is None:
        pytest.skip("openssl makes keys")
    folder = tmp_path_factory.mktemp("keys")
    for name, kind in (("rsa", ["rsa:2048"]), ("ec", ["ec", "-pkeyopt", "ec_paramgen_curve:P-256"])):
        command = ["openssl", "req", "-x509", "-newkey", *kind, "-nodes", "-days", "9000", "-keyout", f"{name}.key"]
        command += ["-out", f"{name}.pem", "-subj", f"/CN=Laboratory {name}"]
        subprocess.run(command, cwd=folder, check=True, capture_output=True)
    return folder


@pytest.mark.parametrize("kind", ["rsa", "ec"])
def test_a_signature_holds_until_something_is_changed(keys, kind):
    pytest.importorskip("signxml")
    from rig.dcc.signature import signatures, signed  # noqa: PLC0415

    xml = signed(dcc(document()), keys / f"{kind}.key", keys / f"{kind}.pem")
    (found,) = signatures(xml, NOW.replace(year=2030), keys / f"{kind}.pem")
    assert (found.holds, found.trusted, found.by) == (True, True, f"CN=Laboratory {kind}")
    (other,) = signatures(xml, NOW, keys / f"{'ec' if kind == 'rsa' else 'rsa'}.pem")
    assert (other.holds, other.trusted) == (True, False)
    assert "has expired" in signatures(xml, NOW.replace(year=2099))[0].words
    for old, new in (
        (b"2.00410", b"2.00411"),
        (b"Hillside", b"Downside"),
        (b'refType="basic_measuredValue"', b'refType="x"'),
    ):
        (changed,) = signatures(xml.replace(old, new, 1), NOW)
        assert not changed.holds
        assert "DOES NOT HOLD" in changed.words
    assert parsed(xml, "x.xml").signatures == 1


def test_a_signature_of_another_document_does_not_hold(keys):
    pytest.importorskip("signxml")
    from rig.dcc.signature import signatures, signed  # noqa: PLC0415

    xml = signed(dcc(document()), keys / "ec.key", keys / "ec.pem")
    signature = xml[xml.index(b"<ds:Signature") : xml.index(b"</ds:Signature>") + len(b"</ds:Signature>")]
    other = dcc(document(items=2)).replace(b"</dcc:digital", signature + b"</dcc:digital")
    assert [one.holds for one in signatures(other, NOW)] == [False]


def test_a_key_of_another_certificate_is_refused(keys):
    pytest.importorskip("signxml")
    from rig.dcc.signature import signed  # noqa: PLC0415

    with pytest.raises(UsageError, match="is the certificate of another key"):
        signed(dcc(document()), keys / "ec.key", keys / "rsa.pem")


def test_a_missing_extra_is_named(monkeypatch):
    from rig import extras  # noqa: PLC0415

    monkeypatch.setattr(extras, "import_module", lambda name: (_ for _ in ()).throw(ImportError(name)))
    with pytest.raises(UsageError, match=r"pip install 'calibration-rig\[dcc\]'"):
        extras.needed("signxml.xades", "dcc")


@pytest.mark.parametrize("seed", range(4))
def test_random_certificates_break_no_rule_and_are_read_back(rules, seed):
    """A share of `python -m proving.certificates.checks`."""
    from proving.certificates.checks import violations  # noqa: PLC0415

    assert violations(seed, [lambda xml: broken(rules, xml)], paper=seed == 0) == []
