"""Results of external providers (ISO/IEC 17025, 7.8.2.1 p) and data of the customer (7.8.2.2) on a certificate."""

from __future__ import annotations

from dataclasses import replace
from datetime import date
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from certificate_lab import ISSUED, REGISTER, SETTINGS, settled, stand

from rig.dcc.read_dcc import parsed
from rig.errors import ConfigurationError
from rig.register import parse_register
from rig.verbs.budget.found import Found
from rig.verbs.certificate import standing_sentences as words
from rig.verbs.certificate.as_dcc import dcc
from rig.verbs.certificate.blocks import Grid
from rig.verbs.certificate.document import Document
from rig.verbs.certificate.layout import sections
from rig.verbs.certificate.request import CertificateRequest
from rig.verbs.certificate.result import make
from rig.verbs.certificate.runs import read_run

pytest.importorskip("typst")
EXTERNAL = """
[[sensors.cell.external]]
what = "temperature coefficient"
value = "0.00210"
unit = "mV/K"
expanded = "0.00040"
k = "2.00"
probability = "0.95"
laboratory = "Thermal Testing"
accreditation = "UKAS 4711"
certificate = "TT-42"
date = 2026-02-03
used_for = "outputs at 20 degC"
[[sensors.cell.external]]
what = "insulation resistance"
value = "5.2"
unit = "Gohm"
laboratory = "Another"
certificate = "A-1"
date = 2026-02-04
"""
CUSTOMER = """
from_customer = ["serial"]
[[sensors.cell.customer_data]]
what = "resolution of the indicator"
value = "0.001 mV"
[[sensors.cell.customer_data]]
what = "sampling plan"
value = "3 of 40"
affects_results = false
"""
DCC = "{https://ptb.de/dcc}"


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Path:
    return stand(tmp_path_factory.mktemp("stand"))


@pytest.fixture(autouse=True)
def no_trace(monkeypatch):
    """No effect is looked for: none is in this world."""
    monkeypatch.setitem(read_run.__globals__, "found_in", lambda *_, **__: Found(()))


@pytest.fixture
def certificate(run, tmp_path):
    """What makes a certificate by a register and settings."""

    def made(register: str, settings: str = "") -> Document:
        (tmp_path / "equipment.toml").write_text(register)
        asked = CertificateRequest((run,), date.fromisoformat(ISSUED), settings=settled(tmp_path, settings, SETTINGS))
        return make(replace(asked, equipment=tmp_path / "equipment.toml")).document

    return made


def grids(document: Document, title: str) -> list[Grid]:
    (section,) = (one for one in sections(document) if one.title == title)
    return [one for one in section.blocks if isinstance(one, Grid)]


def cells(grid: Grid) -> list[list[str]]:
    return [[cell.text.replace("\u202f", "") for cell in row] for row in grid.rows]


def statements(document: Document) -> list[str]:
    """Declarations of the digital certificate on the customer's data, with who answers for them."""
    paths = [f"{DCC}{part}/{DCC}content" for part in ("declaration", f"respAuthority/{DCC}name")]
    return [
        " | ".join(one.findtext(path) or "" for path in paths)
        for one in ET.fromstring(dcc(document)).iter(f"{DCC}statement")
        if one.findtext(f"{DCC}name/{DCC}content") == "Data supplied by the customer"
    ]


def test_results_of_each_provider_are_apart_with_all_of_its_digits(certificate):
    document = certificate(REGISTER + EXTERNAL)
    first, second = grids(document, "Results of external providers")
    assert first.title == "Thermal Testing, UKAS 4711: certificate TT-42 of 2026-02-03"
    assert cells(first) == [
        ["cell", "temperature coefficient", "mV/K", "0.00210", "0.00040", "2.00", "95 %", "outputs at 20 °C"]
    ]
    assert second.title == "Another: certificate A-1 of 2026-02-04"
    assert cells(second) == [["cell", "insulation resistance", "Gohm", "5.2", "-", "-", "-", "-"]]
    assert words.EXTERNAL[0] in str(sections(document))


def test_the_digital_certificate_has_them_apart_from_those_of_the_laboratory(certificate):
    root = ET.fromstring(dcc(certificate(REGISTER + EXTERNAL)))
    own, *others = root.iter(f"{DCC}measurementResult")
    names = [one.findtext(f"{DCC}name/{DCC}content") for one in others]
    assert names == [
        "Results of an external provider, Thermal Testing, UKAS 4711: certificate TT-42 of 2026-02-03",
        "Results of an external provider, Another: certificate A-1 of 2026-02-04",
    ]
    assert "external" not in ET.tostring(own, encoding="unicode")
    read = parsed(ET.tostring(root), "made.xml")
    (coefficient,) = (one for one in read.quantities if one.path[-1] == "temperature coefficient")
    assert coefficient.path[0] == "cell: temperature coefficient, by an external provider, Thermal Testing"
    assert not coefficient.ref_types, "who takes measured values from the certificate takes those of the laboratory"
    number = coefficient.numbers[0]
    assert (number.value, number.expanded, number.k, number.probability) == (0.0021, 0.0004, 2.0, 0.95)


def test_the_unit_of_an_external_result_is_declared_where_it_is_not_of_the_si(certificate):
    root = ET.fromstring(dcc(certificate(REGISTER + EXTERNAL.replace('"Gohm"', '"psi"'))))
    assert [one.text for one in root.iter(f"{DCC}nonSIUnit")] == ["|psi"]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (('k = "2.00"\n', ""), "expanded, k and probability belong together"),
        (('value = "0.00210"', "value = 0.0021"), "should be a text in quotes"),
        (('value = "0.00210"', 'value = "about 2"'), "value"),
        (('laboratory = "Another"\n', ""), "laboratory"),
        (('certificate = "A-1"\n', ""), "certificate"),
    ],
)
def test_an_external_result_is_whole_or_refused(change, says):
    assert change[0] in EXTERNAL
    with pytest.raises(ConfigurationError, match=r"sensors\.cell\.external") as refused:
        parse_register((REGISTER + EXTERNAL).replace(*change), "equipment.toml")
    assert says in str(refused.value)


def test_a_correction_names_the_certificate_and_who_issued_it(certificate):
    register = REGISTER.replace('laboratory = "force"', 'laboratory = "force"\naccreditation = "UKAS 12"')
    document = certificate(register.replace('behaves = "gain"\n', 'behaves = "gain"\ncorrection = 0.005\n'))
    told = "Recorded values were corrected by the certificates of the equipment: force_kN by certificate F-1 of W-1 "
    assert f"{told}(force, UKAS 12)." in document.deviations
    (row,) = (row for row in cells(grids(document, "Equipment and traceability")[0]) if row[3] == "F-1")
    assert row[4] == "force, UKAS 12"


def test_data_of_the_customer_are_marked_and_disclaimed(certificate):
    limits = 'unit = "V"\nnominal = 0.1\ndeviation = 0.001\n'
    tolerance = f'[[tolerance]]\nresult = "coefficient 1"\n{limits}from_customer = true'
    register = REGISTER.replace("[equipment.W-1]\n", '[equipment.W-1]\nfrom_customer = "mass of the yoke"\n') + CUSTOMER
    document = certificate(register, tolerance)
    (grid,) = grids(document, "Data supplied by the customer")
    assert cells(grid) == [
        ["cell", "serial number", "77", "nothing"],
        ["cell", "resolution of the indicator", "0.001 mV", "results"],
        ["cell", "sampling plan", "3 of 40", "nothing"],
        ["W-1", "mass of the yoke", "-", "results"],
        ["-", "tolerance of coefficient 1", "-", "statement of conformity"],
    ]
    assert grid.notes == (words.SUPPLIED, words.AFFECTED, words.JUDGED)
    shown = str(sections(document))
    assert "serial number 77 (stated by the customer)" in shown
    assert words.SEE_SUPPLIED in shown
    told = statements(document)
    assert len(told) == len(grid.rows)
    assert told[0] == f"cell: serial number, 77. {words.SUPPLIED} | Bridge builders"
    assert told[3] == f"W-1: mass of the yoke. {words.SUPPLIED} {words.AFFECTED} | Bridge builders"
    assert "Stated by the customer: serial number" in dcc(document).decode()
    assert document.to_json()["supplied"][2] == {
        "subject": "cell", "what": "sampling plan", "value": "3 of 40", "affects": "",
    }  # fmt: skip


def test_nothing_is_said_where_the_customer_supplied_nothing(certificate):
    document = certificate(REGISTER)
    titles = [one.title for one in sections(document)]
    assert not {"Data supplied by the customer", "Results of external providers"} & set(titles)
    assert words.SEE_SUPPLIED not in str(sections(document))
    harmless = certificate(REGISTER + 'from_customer = ["model"]\n')
    assert words.SEE_SUPPLIED not in str(sections(harmless))
    assert grids(harmless, "Data supplied by the customer")[0].notes == (words.SUPPLIED,)
