"""A certificate on paper and as a page: the same numbers, the same bytes every time, nothing from elsewhere."""

from __future__ import annotations

import contextlib
import io
import os
import re
import socket
import threading
from dataclasses import replace
from html import unescape

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sample_certificate import amended, document

from rig.errors import ConfigurationError
from rig.verbs.certificate.blocks import Grid, percent
from rig.verbs.certificate.document import Document
from rig.verbs.certificate.html import html
from rig.verbs.certificate.layout import sections
from rig.verbs.certificate.measured import Effect
from rig.verbs.certificate.pdf import pdf
from rig.verbs.certificate.standing_sentences import (
    CORRELATED,
    EFFECTS,
    INFERRED,
    OTHER_FACTOR,
    UNCONFIRMED,
    uncertainty,
)
from rig.verbs.certificate.typeset import padding, plain, raised, typeset

pytest.importorskip("typst")
pypdf = pytest.importorskip("pypdf")

WHOLE = document(items=2, stages=("as found", "as left"))


def pages(made: bytes) -> list[str]:
    """Text of every page."""
    return [page.extract_text() for page in pypdf.PdfReader(io.BytesIO(made)).pages]


@pytest.fixture(scope="module")
def paper() -> list[str]:
    return pages(pdf(WHOLE))


def shown(text: str) -> str:
    """Text of a page with plain numbers and single spaces."""
    return " ".join(plain(text).split())


def told(certificate: Document) -> set[str]:
    """Every number that a reader needs."""
    numbers = {
        text for table in certificate.tables for one in table.results for text in (one.value, one.expanded, one.k)
    }
    numbers |= {text for one in certificate.conditions for text in (one.minimum, one.mean, one.maximum)}
    numbers |= {text for one in certificate.budgets for text in (one.combined, one.expanded, one.k)}
    return numbers | {line.standard for one in certificate.budgets for line in one.contributions}


def words(certificate: Document) -> list[str]:
    """Every word that ISO/IEC 17025, 7.8, asks for."""
    found = [certificate.number, certificate.place, certificate.customer.name, certificate.laboratory.party.name]
    found += [certificate.laboratory.accreditation, certificate.approved_by.name, certificate.method.name]
    found += [one.name for one in certificate.calibrated_by]
    found += [one.isoformat() for one in vars(certificate.dates).values()]
    for item in certificate.items:
        found += [item.serial, item.model, item.maker, item.condition, item.customer_id]
    for one in certificate.equipment:
        found += [one.name, one.certificate, one.laboratory, one.serial, one.asset]
    found += [one.sentence.rstrip(".") for one in certificate.statements] + list(certificate.notes)
    found += [one.rule for one in certificate.statements]
    found += [one.size for one in certificate.effects] + list(certificate.deviations) + [certificate.adjustment]
    return [one for one in found if one] + [one.run_id for one in certificate.evidence]


def test_every_number_is_on_paper_and_on_the_page(paper):
    text, page = "\n".join(paper), re.sub("<[^>]*>", " ", html(WHOLE))
    missing = {(number, form) for form, said in (("pdf", text), ("html", page)) for number in told(WHOLE)
               if not re.search(rf"(?<![\d.]){re.escape(typeset(number))}(?![\d])", said)}  # fmt: skip
    assert missing == set()


def test_every_required_word_is_on_paper_and_on_the_page(paper):
    text = re.sub(r"\s+", "", "".join(paper))
    page = re.sub(r"\s+", "", unescape(re.sub("<[^>]*>", "", html(WHOLE))))
    for form, said in (("pdf", text), ("html", page)):
        missing = [word for word in words(WHOLE) if re.sub(r"\s+", "", raised(word)) not in said]
        assert missing == [], form


def test_the_head_hash_is_whole(paper):
    assert WHOLE.evidence[0].head in re.sub(r"\s", "", "".join(paper))


def test_pages_are_numbered_with_the_number_of_the_certificate(paper):
    assert len(paper) > 3
    for n, page in enumerate(paper, 1):
        assert f"Calibration certificate {WHOLE.number}" in page
        assert f"page {n} of {len(paper)}" in page
    assert ["end of the certificate" in page for page in paper] == [False] * (len(paper) - 1) + [True]


def test_simulated_is_on_every_page():
    made = document(simulated=True)
    for page in pages(pdf(made)):
        assert "SIMULATED" in page
        assert "This is not a certificate" in page
    assert "SIMULATED" in html(made)
    assert "SIMULATED" not in "".join(pages(pdf(document())))


def test_bytes_follow_from_the_document():
    assert pdf(document()) == pdf(document())
    assert pdf(document()) != pdf(replace(document(), number="K-2"))
    assert html(document()) == html(document())


def test_fonts_are_inside():
    reader = pypdf.PdfReader(io.BytesIO(pdf(document())))
    found = set()
    for page in reader.pages:
        for font in page["/Resources"]["/Font"].values():
            below = font["/DescendantFonts"][0]
            found.add(below["/BaseFont"].partition("+")[2])
            assert {"/FontFile2", "/FontFile3"} & below["/FontDescriptor"].keys()
    assert all(name.startswith(("LibertinusSerif", "DejaVuSansMono")) for name in found), found


@pytest.mark.parametrize(("paper_size", "size"), [("a4", (595, 842)), ("letter", (612, 792))])
def test_paper_sizes(paper_size, size):
    box = pypdf.PdfReader(io.BytesIO(pdf(replace(document(), paper=paper_size)))).pages[0].mediabox
    assert (round(box.width), round(box.height)) == size
    assert f"size: {'letter' if paper_size == 'letter' else 'A4'}" in html(replace(document(), paper=paper_size))


def test_an_amendment_says_what_it_replaces():
    made = amended(document())
    for said in (pages(pdf(made))[0], html(made)):
        assert "replaces certificate K-2026-0147 of 2026-11-24" in " ".join(said.split())
        assert "441101 instead of 441100" in " ".join(said.split())


def test_texts_are_texts():
    """Nothing that a customer is called becomes a command of typst or of HTML."""
    name = 'A & B <script>alert(1)</script> #panic("x") $a$ *b* _c_ \\ @d `e` "f"'
    made = replace(document(), customer=replace(document().customer, name=name))
    assert re.sub(r"\s", "", name) in re.sub(r"\s", "", pages(pdf(made))[0])
    assert "<script>" not in html(made)


def test_a_number_cannot_leave_the_style_sheet():
    made = replace(document(), number='K"; } body { display: none } </style><script>')
    style = html(made).partition("<style>")[2].partition("</style>")[0]
    assert "display: none" not in style
    assert "<script" not in html(made)


def test_the_page_refers_to_nothing():
    page = html(WHOLE)
    assert re.findall(r'(?:src|href)="(?!data:)', page) == []
    assert re.findall(r"url\(|@import", page) == []


def test_a_template_of_the_laboratory(tmp_path):
    own = tmp_path / "own.typ"
    own.write_text('#let all = json("contents.json")\n#set page(paper: "a6")\nOurs: #all.document.number')
    assert pages(pdf(document(), own)) == ["Ours: K-2026-0147"]


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("#nothing", "unknown variable"),
        ('#import "@preview/tablex:0.0.8": *', "imports a package"),
        ('#read("/etc/passwd")', "cannot be set"),
    ],
)
def test_a_template_that_cannot_be_used(tmp_path, source, words):
    own = tmp_path / "own.typ"
    own.write_text(source)
    with pytest.raises(ConfigurationError, match=words):
        pdf(document(), own)


@pytest.mark.parametrize(
    "source",
    [
        '#import "@" + "preview/tablex:0.0.8": *',
        '#let name = ("@", "preview", "/tablex:0.0.8").join()\n#import name as other',
        '#include str.from-unicode(64) + "preview/tablex:0.0.8"',
    ],
)
@pytest.mark.parametrize("passed_by", ["", "*"])
def test_a_package_with_a_computed_name_is_never_fetched(tmp_path, monkeypatch, source, passed_by):
    """A proxy of the environment is what typst would ask: nothing comes to it, and typst reaches nothing else."""
    own, asked = tmp_path / "own.typ", []
    own.write_text(source)

    def answer(server):
        with contextlib.suppress(OSError):
            while True:
                client, _ = server.accept()
                asked.append(client.recv(100))
                client.close()

    with socket.create_server(("127.0.0.1", 0)) as proxy:
        threading.Thread(target=answer, args=(proxy,), daemon=True).start()
        for name in ("http_proxy", "https_proxy", "all_proxy", "HTTPS_PROXY", "ALL_PROXY"):
            monkeypatch.setenv(name, f"http://127.0.0.1:{proxy.getsockname()[1]}")
        monkeypatch.setenv("no_proxy", passed_by)
        before = dict(os.environ)
        with pytest.raises(ConfigurationError, match="would be fetched: copy what it needs") as refused:
            pdf(document(), own)
        proxy.shutdown(socket.SHUT_RDWR)
    assert asked == []
    assert "Connection refused" in refused.value.__cause__.message, "by the proxy that cannot be, not by a name server"
    assert dict(os.environ) == before


def test_a_template_that_does_not_exist(tmp_path):
    with pytest.raises(ConfigurationError, match="cannot be read"):
        pdf(document(), tmp_path / "none.typ")


def test_sections_without_contents_are_absent():
    made = replace(document(), effects=(), statements=(), budgets=())
    titles = [one.title for one in sections(made)]
    assert "Effects beside the declared model" not in titles
    assert "Statement of conformity" not in titles
    assert titles[-1] == "Evidence"
    assert len(pages(pdf(made))) >= 2


def conformity(*given: tuple[str, str, str]) -> list[str]:
    """Sentences below the table, of (item, verdict, probability) each."""
    one = document().statements[0]
    statements = tuple(
        replace(one, sensor=item, what=f"output {n}", verdict=verdict, probability=p, stage="")
        for n, (item, verdict, p) in enumerate(given, 1)
    )
    (part,) = [s for s in sections(replace(document(), statements=statements)) if s.title == "Statement of conformity"]
    return list(part.blocks[-1].texts)


def test_one_sentence_for_each_item_says_what_the_table_of_conformity_does_not():
    eleven = [("cell", "pass", p) for p in ("> 0.999", "0.973", *["0.998"] * 9)]
    assert conformity(*eleven) == [
        "cell: all 11 results conform with their tolerances, each with a probability of at least 97.3 %."
    ]
    assert conformity(*eleven[:1] * 2) == [
        "cell: all 2 results conform with their tolerances, each with a probability of more than 99.9 %."
    ]
    assert conformity(*eleven[1:3], ("cell", "conditionalFail", "0.2"), ("other", "pass", "0.99")) == [
        "cell: 2 of 3 results conform with their tolerances, each with a probability of at least 97.3 %; output 3 is "
        "outside its tolerance, but nearer to a limit than the guard band.",
        "other: output 4 conforms with its tolerance.",
    ]
    assert conformity(("a", "pass", "0.99"), ("a", "pass", "0.99"), ("b", "pass", "0.99"), ("b", "pass", "0.99")) == [
        "a, b: all 2 results conform with their tolerances, each with a probability of at least 99 %."
    ]


def test_what_is_not_known_stands_with_equipment_and_conditions_and_is_no_deviation():
    made = replace(
        document(), unstated=("No serial number.",), unrecorded=("No temperature is recorded.",), deviations=()
    )
    under = {one.title: str(one.blocks) for one in sections(made)}
    assert "No serial number." in under["Equipment and traceability"]
    assert "No temperature is recorded." in under["Conditions during the calibration"]
    assert "'None.'" in under["Deviations from the procedure"]


def test_sentences_on_results_are_of_results_that_are_there():
    table = document().tables[0]
    result = table.results[0]
    for labels, said in ((("output",), ()), (("coefficient 1",), (CORRELATED,)), (("inferred p",), (INFERRED,))):
        results = tuple(replace(result, label=label) for label in labels)
        texts = " ".join(uncertainty(replace(document(), tables=(replace(table, results=results),))))
        assert [one for one in (CORRELATED, INFERRED) if one in texts] == list(said)


def test_a_coverage_factor_stands_with_its_reason_and_its_degrees_of_freedom():
    """k stood there alone: neither of which distribution, nor with how many degrees of freedom, nor why it is not 2."""
    table = document().tables[0]
    one = replace(table.results[0], factor=2.306, k="2.31", df=8.0, probability="0.95")
    made = replace(document(), tables=(replace(table, results=(one,)),))
    (said,) = [text for text in uncertainty(made) if "coverage factor" in text]
    assert "Student's t distribution" in said
    assert "so it is not 2 throughout" in said
    assert OTHER_FACTOR not in said
    (grid,) = [
        block for part in sections(made) if part.title == "Results" for block in part.blocks if isinstance(block, Grid)
    ]
    assert [head.label for head in grid.heads][-2:] == ["k", "Degrees of\nfreedom"]
    assert [cell.text for cell in grid.rows[0]][-2:] == ["2.31", "8"]
    other = replace(made, tables=(replace(table, results=(replace(one, factor=1.65),)),))
    assert OTHER_FACTOR in " ".join(uncertainty(other))


def test_nothing_is_said_of_unconfirmed_effects_where_all_are_confirmed():
    def notes(confirmed: bool) -> list[str]:
        effects = tuple(replace(one, confirmed=confirmed) for one in document().effects)
        (part,) = [one for one in sections(replace(document(), effects=effects)) if one.title.startswith("Effects")]
        return [note for block in part.blocks if isinstance(block, Grid) for note in block.notes]

    assert notes(True)[0] == EFFECTS
    assert notes(False)[0] == f"{EFFECTS} {UNCONFIRMED}"


def test_what_is_so_of_all_effects_and_items_stands_once_below_their_table():
    """The run that confirmed them and what all items share stood in each row: 3 effects of 2 sensors, six times."""
    names, shared = ("creep:F", "drift:t"), "{} is common to all 2 outputs: of one size in Hz. Find out"
    effects = [
        Effect(sensor, name, "the cause", "1 Hz", True, "by later, head 77aa", shared=shared.format(name))
        for sensor in ("a", "b")
        for name in names
    ]
    (part,) = [o for o in sections(replace(document(), effects=tuple(effects))) if o.title.startswith("Effects")]
    (table,) = part.blocks
    assert [[cell.text for cell in row][:2] for row in table.rows] == [
        ["a", "creep:F: the cause"],
        ["b", "the same"],
        ["a", "drift:t: the cause"],
        ["b", "the same"],
    ]
    assert list(table.notes[1:]) == [
        "Confirmed: by later, head 77aa.",
        "Each of creep:F and drift:t is common to all 2 outputs: of one size in Hz. Find out.",
    ]


def test_one_of_something_is_singular():
    budget = replace(document().budgets[0], left=1)
    notes = [block.notes for part in sections(replace(document(), budgets=(budget,))) for block in part.blocks
             if isinstance(block, Grid)]  # fmt: skip
    assert ("1 smaller contribution, below 0.1 %, is not listed.",) in notes


def test_no_next_date_unless_it_is_wanted(paper):
    assert "Next calibration" not in "".join(paper)
    made = replace(document(), next_due=document().dates.issued.replace(year=2027))
    assert "Next calibration" in pages(pdf(made))[0]
    assert "2027-11-24, at the customer" in html(made)


@settings(max_examples=50)
@given(st.decimals(allow_nan=False, allow_infinity=False))
def test_printed_numbers_keep_their_digits(number):
    text = f"{number}"
    assert float(plain(typeset(text))) == float(text)


@pytest.mark.parametrize(
    ("text", "printed"),
    [
        ("-0.000123", "−0.000\u202f123"),
        ("12345.678901", "12\u202f345.678\u202f901"),
        ("1234.5678", "1234.5678"),
        ("1.2e-05", "1.2 × 10⁻⁵"),
        ("inf", "∞"),
        ("DVM-0102", "DVM-0102"),
    ],
)
def test_numbers_as_the_si_brochure_prints_them(text, printed):
    assert typeset(text) == printed


def test_points_stand_below_each_other():
    assert padding(["1.25", "10.5", "3", "1.2 × 10⁻⁵"]) == ["000000", "0000000", "." + "0" * 8, ""]


@pytest.mark.parametrize(
    ("probability", "words"),
    [("0.95", "95 %"), ("0.9545", "95.45 %"), ("0.998", "99.8 %"), ("1.000", "100.0 %"), ("0.05", "5 %"), ("-", "-")],
)
def test_probabilities_in_percent(probability, words):
    assert percent(probability) == words


def test_raised_powers():
    assert raised("mV/psi^2") == "mV/psi²"
    assert raised("V/psi^(-2)") == "V/psi⁻²"
    assert raised("of second order (rh_pct^2), and more (x**3)") == "of second order (rh_pct²), and more (x³)"
    assert raised("V*degC^-1") == "V*°C⁻¹"


def test_a_text_without_a_font_is_named():
    made = replace(document(), place="校正所")
    with pytest.raises(ConfigurationError, match=r"校.*could not be displayed.*fonts = \"FOLDER\" in certificate.toml"):
        pdf(made)
    assert "校正所" in html(made)


def test_control_characters_are_shown():
    made = replace(document(), place="a\x1b[31mb\u202e")
    assert r"a\x1b[31mb\x202e" in "".join(pages(pdf(made))[0].split())
    assert "\x1b" not in html(made)
