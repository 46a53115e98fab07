"""`rig certificate`: from a run to its certificate; every reason why none is made; amendments; reading."""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import replace
from datetime import date
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from certificate_lab import ISSUED, REGISTER, SETTINGS, settled, stand
from command import rig
from dry import SHORT, dry
from general_lab import BENCH, CHAMBER, PROCEDURE, WORLD, run_dry

from rig.dcc.read_dcc import read_dcc
from rig.engine.session import Outcome
from rig.errors import ConfigurationError, UsageError
from rig.fitter.rounding import rounded
from rig.fitter.trace.outcome import Finding
from rig.procedures.plan import hand_steps
from rig.run_file.read.reader import RunReader
from rig.tables.table_of_run import run_table
from rig.units.si import per_term
from rig.verbs.budget.evaluation import checked_run, run_with_register
from rig.verbs.budget.found import Found, found_in
from rig.verbs.budget.held import held
from rig.verbs.budget.result import budget
from rig.verbs.certificate.changes import changes
from rig.verbs.certificate.files import write_once
from rig.verbs.certificate.issue import Issue, issue
from rig.verbs.certificate.layout import sections
from rig.verbs.certificate.parts_in_numbers import conditions, decimal_text, doubtful, effects
from rig.verbs.certificate.parts_in_words import equipment, steps_by_hand
from rig.verbs.certificate.request import CertificateRequest
from rig.verbs.certificate.result import Made, Refused, make
from rig.verbs.certificate.runs import read_run
from rig.verbs.certificate.standing_sentences import UNTRACED
from rig.verbs.certificate.typeset import plain

pytest.importorskip("typst")
DAY = date.fromisoformat(ISSUED)


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Path:
    return stand(tmp_path_factory.mktemp("stand"))


@pytest.fixture(scope="module")
def bare(tmp_path_factory) -> Path:
    """A run without a register."""
    path, _ = run_dry(tmp_path_factory.mktemp("bare"), PROCEDURE)
    return path


def asked(run: Path, settings: Path, **more: object) -> CertificateRequest:
    return CertificateRequest((run,), DAY, settings=settings, **more)  # type: ignore[arg-type]


@pytest.fixture(autouse=True)
def traced_once(monkeypatch):
    """The trace of a run follows from the run alone: made once for all tests."""
    monkeypatch.setitem(read_run.__globals__, "found_in", TRACED)


_FOUND: dict[tuple[Path, tuple[Path, ...]], Found] = {}


def TRACED(of, path, later=(), equipment=None) -> Found:
    """What a trace finds, once for each file."""
    key = (path, tuple(later))
    if key not in _FOUND:
        _FOUND[key] = found_in(of, path, later, equipment)
    return _FOUND[key]


@pytest.fixture
def made(made_once, tmp_path_factory) -> Made:
    """Of a laboratory that has issued no certificate yet."""
    return replace(made_once, folder=tmp_path_factory.mktemp("laboratory"))


@pytest.fixture(scope="module")
def made_once(run, tmp_path_factory) -> Made:
    tolerance = '[[tolerance]]\nresult = "coefficient 1"\nunit = "V"\nnominal = 0.1\ndeviation = 0.001\n'
    return make(asked(run, settled(tmp_path_factory.mktemp("settings"), tolerance)))


def reasons(run: Path, folder: Path, text: str = SETTINGS, **more: object) -> tuple[str, ...]:
    with pytest.raises(Refused) as refused:
        make(asked(run, settled(folder, text=text), **more))
    return refused.value.reasons


def test_every_number_is_that_of_the_budget(run, made):
    found = budget(run, at=[{"force_kN": 1}, {"force_kN": 4}]).found.budgets
    results = [one for table in made.document.tables for one in table.results]
    assert [(one.estimate, one.standard, one.factor, one.df) for one in results] == [
        (one.value, one.standard_uncertainty, one.coverage_factor, one.df) for one in found
    ]
    for result, one in zip(results, found, strict=True):
        both = rounded(one.value, one.expanded_uncertainty)
        assert (float(result.value), float(result.expanded)) == (float(both.value), float(both.uncertainty))
        assert len(result.expanded.replace(".", "").lstrip("0")) == 2, "two digits"
        assert result.k == f"{one.coverage_factor:.2f}"
    shares = [line.share for one in made.document.budgets for line in one.contributions]
    assert set(shares) <= {line.share for one in found for line in one.contributions}


def test_a_limit_that_dominates_has_its_own_coverage_factor_and_the_certificate_says_so(run, tmp_path):
    register = tmp_path / "equipment.toml"
    register.write_text(REGISTER.replace("standard = 0.1", "half_width = 50"))
    asked_for = asked(run, settled(tmp_path), equipment=register)
    document = make(asked_for).document
    results = {one.name: one for table in document.tables for one in table.results}
    assert {one.k for one in results.values()} > {"1.65"}
    by_limit = [name for name, one in results.items() if one.k == "1.65"]
    (note,) = (note for note in document.notes if "dominate these results" in note)
    assert all(name in note for name in by_limit)
    assert not any(name in note for name, one in results.items() if float(one.k) > 1.9)
    rare = make(asked(run, settled(tmp_path, "probability = 0.99"), equipment=register)).document
    assert not any("dominate" in note for note in rare.notes)
    assert all(float(one.k) > 2.5 for table in rare.tables for one in table.results)


def test_the_page_says_how_the_output_follows_from_the_coefficients(made):
    (table,) = made.document.tables
    assert table.notes == ("Output in V: the sum of all coefficients, each times its term, by the model 1 + force_kN.",)


@pytest.mark.parametrize(("asset", "column"), [("W-1", "force_kN"), ("DVM-1", "cell_V")])
def test_what_is_read_or_set_without_a_stated_error_is_refused(run, tmp_path, asset, column):
    register = tmp_path / "equipment.toml"
    said = rf"(?s)\[\[equipment\.{asset}\.says\]\].*?(?=\[equipment\.DVM-1\]|\[sensors)"
    register.write_text(re.sub(said, "", REGISTER))
    assert any(one.startswith(f"{column}: the register states") for one in reasons(run, tmp_path, equipment=register))
    told = f"the register states no errors of {column}: none are in these uncertainties, which are too small"
    assert told in budget(run, equipment=register).notes()


def test_the_page_says_what_an_instrument_without_a_certificate_is_for(run, tmp_path, made):
    def page(of: Made) -> str:
        return "".join(str(block) for section in sections(of.document) for block in section.blocks)

    assert UNTRACED[0] not in page(made)
    document = replace(
        made.document, equipment=(*made.document.equipment, replace(made.document.equipment[0], laboratory=""))
    )
    assert UNTRACED[0] in page(replace(made, document=document))


def test_two_statements_of_one_sort_are_two_influences(run, tmp_path):
    """Such as the uncertainty of the calibration, and that of a specification: both are gains."""
    again = "[[equipment.W-1.says]]\nquantity = 'force_kN'\nbehaves = 'gain'\nunit = '%'\nhalf_width = 0.02\n"
    register = tmp_path / "equipment.toml"
    register.write_text(REGISTER.replace("[equipment.DVM-1]\n", f"{again}[equipment.DVM-1]\n", 1))
    lines = {line.name for one in budget(run, equipment=register).found.budgets for line in one.contributions}
    assert {"W-1 gain of force_kN", "W-1 gain of force_kN, no. 2"} <= lines


@pytest.mark.parametrize(("kind", "seed"), [("general", 96), ("attitude", 1), ("pressure", 3)])
def test_every_number_of_the_page_of_a_random_run_is_in_its_run_file(kind, seed, tmp_path):
    """A share of `python -m proving certificates runs`; one digit changed is found."""
    from proving.certificates import runs  # noqa: PLC0415

    stand = runs.stand_of(kind, seed, tmp_path)
    path = runs.run_of(stand)
    of = make(asked(path, tmp_path / "certificate.toml"))
    issued = issue(of, Issue(tmp_path / "out"))
    page = runs.page_text(next(one for one in issued.files if one.suffix == ".html").read_text())
    told = runs.sources(path, stand, of)
    assert runs.not_in_run(page, *told, issued.document) == []
    assert list(runs.not_computed_again(path, stand, issued.document)) == []
    value = issued.document.tables[0].results[0].value
    other = f"{value[:-1]}{(int(value[-1]) + 5) % 10}"
    assert value in page
    assert runs.not_in_run(page.replace(value, other), *told, issued.document) != []


def test_what_is_said_of_the_run_is_in_the_run_file(run, made):
    (evidence,) = made.document.evidence
    with RunReader.open(run) as reader:
        count, head = reader.head()
        run_id = reader.about().run_id
    assert (evidence.records, evidence.head, evidence.run_id) == (count, head.hex(), run_id)
    table = run_table(run)
    assert evidence.observations == len(table)
    assert str(made.document.dates.began) == table.provenance["began_utc"][:10]


def test_it_names_equipment_customer_and_people(made):
    document = made.document
    assert {one.certificate for one in document.equipment} == {"F-1", "E-1"}
    assert (document.customer.name, document.customer.address) == ("Bridge builders", ("2 River Road",))
    assert (document.items[0].serial, document.items[0].condition) == ("77", "clean")
    assert ([one.name for one in document.calibrated_by], document.approved_by.name) == (["A. Byron"], "C. Wheat")
    assert document.simulated
    assert document.place == "1 Weight Road"


def test_conformity_is_stated_by_the_rule(made):
    (statement,) = made.document.statements
    assert (statement.sensor, statement.verdict, statement.what) == ("cell", "pass", "coefficient 1")
    assert statement.tolerance == "0.1 ± 0.001 V"
    assert "1 times the expanded uncertainty" in statement.rule


def test_an_item_with_another_slope_fails(run, tmp_path):
    """2.1 V at 4 kN, where its data sheet has 1.9 V: the same tolerance of the inferred 4 kN would be a pass."""
    tolerance = '[[tolerance]]\nresult = "output at force 4 kN"\nunit = "V"\nnominal = {}\ndeviation = 0.05'
    for nominal, verdict in ((2.1, "pass"), (1.9, "fail")):
        (statement,) = make(asked(run, settled(tmp_path, tolerance.format(nominal)))).document.statements
        assert (statement.what, statement.verdict) == ("output at force 4 kN", verdict)


@pytest.mark.parametrize(
    ("rule", "verdict"),
    [
        ('rule = "simple"', "pass"),
        ('rule = "guard-band"', "conditionalPass"),
        ('rule = "guard-band"\nbinary = true', "fail"),
        ('rule = "guard-band"\nbinary = true\nfactor = -1', "pass"),
        ('rule = "probability"\nprobability = 0.9999', "noPass"),
        ('rule = "shared-risk"', "noPass"),
    ],
)
def test_decision_rules(run, tmp_path, rule, verdict):
    """A coefficient of 0.10001 V with an expanded uncertainty of 0.0002 V, and a tolerance of as much."""
    tolerance = (
        f'[decision]\n{rule}\n[[tolerance]]\nresult = "coefficient 1"\nunit = "V"\nnominal = 0.1\ndeviation = 0.0002'
    )
    (statement,) = make(asked(run, settled(tmp_path, tolerance))).document.statements
    assert statement.verdict == verdict
    assert ("acceptance limits outside the tolerance by 1 times" in statement.rule) == ("factor = -1" in rule)


def test_all_reasons_are_listed_at_once(run, tmp_path):
    bare = REGISTER.replace('serial = "77"', "").replace('condition = "clean"', "").replace("2 River Road", "")
    equipment = tmp_path / "bare.toml"
    equipment.write_text(bare.replace('name = "Stand laboratory"', ""))
    text = SETTINGS.replace('country = "GB"', "").replace('approved_by = "C. Wheat"', "")
    found = reasons(run, tmp_path, text.replace('name = "W-3: comparison with weights"', ""), equipment=equipment)
    for words in (
        "the serial number of cell is missing: add sensors.cell.serial",
        "the condition of cell as received is missing",
        "the name of the laboratory is missing: add laboratory.name",
        "the country of the laboratory is missing: add country",
        "who approves is missing",
        "the calibration method is missing: add method.name",
        "the customer's address is missing",
    ):
        assert any(words in one for one in found), words
    assert len(found) == 7


OF_REGISTER = {  # a fault: what it changes into what, and what is said of it
    "due = 2030-01-01": ("due = 2021-01-01", "it had expired"),
    'number = "E-1"\ndate = 2020': (
        'number = "E-1"\ndate = 2029',
        "the date is simulated: make the dry run again with this register",
    ),
    "range = [-10, 10]": ("range = [-1, 1]", "the certificate covers -1 to 1"),
    'serial = "77"': ("", "the serial number of cell is missing"),
    'customer = "Bridge builders"': ("", "the customer is missing"),
    'name = "Stand laboratory"': ("", "the name of the laboratory is missing"),
    'quantity = "force_kN"': ('quantity = "mass_kg"', "force_kN: the register states no error"),
}
OF_SETTINGS = {
    'country = "GB"': ('logo = "no.svg"', "the country of the laboratory is missing"),
    'name = "W-3: comparison with weights"': ("", "the calibration method is missing"),
    'approved_by = "C. Wheat"': (
        "customer_wants_due_date = true\nnext_due = 2026-11-24",
        "next_due = 2026-11-24 is not after the date of issue",
    ),
}
OF_BOTH = {"force_kN = 4": ("force_kN = 9", "force_kN = 9 is outside the run")}


@pytest.mark.parametrize("register", ["faulty", "none", "unverified"])
def test_no_reason_hides_another(run, bare, tmp_path, monkeypatch, register):
    """Every fault that can be beside the others, all at once: each is said, so none of any two or three is hidden."""
    finding = Finding("effect", "the cell creeps", "replication", 0.5, effect="creep", doubtful="a curve fits as well")
    outcomes = [replace(one, findings=(finding,)) for one in TRACED(run_with_register(run), run).outcomes]
    monkeypatch.setitem(read_run.__globals__, "found_in", lambda *_, **__: Found(outcomes))
    faults = OF_SETTINGS | (OF_BOTH if register != "unverified" else {}) | (OF_REGISTER if register == "faulty" else {})
    texts = REGISTER, SETTINGS
    for old, (new, _) in faults.items():
        assert sum(old in text for text in texts) == 1
        texts = texts[0].replace(old, new), texts[1].replace(old, new)
    told = [words for _, words in faults.values()]
    equipment = tmp_path / "faulty.toml"
    equipment.write_text(texts[0])
    if register == "unverified":
        path = tmp_path / "changed.sqlite"
        path.write_bytes(run.read_bytes()[:-4096])
        told.append("is not verified")
    else:
        path = run if register == "faulty" else bare
        told += [
            "the name of effect creep is doubtful",
            "no.svg cannot be read",
            "say what was adjusted",
            "of the same",
        ]
    told += ["has no register of equipment", "sensor cell is missing"] if register == "none" else []
    wanted = asked(path, settled(tmp_path, text=texts[1]), equipment=equipment if register == "faulty" else None)
    with pytest.raises(Refused) as refused:
        make(replace(wanted, runs=(path, path)))
    assert not [words for words in told if not any(words in one for one in refused.value.reasons)]
    if register == "none":
        assert not any("register states" in one or "repeatability" in one for one in refused.value.reasons)


def test_people_must_be_allowed(run, tmp_path):
    found = reasons(run, tmp_path, approved_by="A. Byron", calibrated_by="Nobody")
    assert [re.sub(r" of \S+,", ",", one) for one in found] == [
        "Nobody is not in laboratory.calibrates, which has A. Byron",
        "A. Byron is not in laboratory.approves, which has C. Wheat",
    ]


def test_an_item_is_not_received_after_its_calibration(run, tmp_path):
    equipment = tmp_path / "late.toml"
    equipment.write_text(REGISTER.replace('condition = "clean"', 'condition = "clean"\nreceived = 2999-01-01'))
    (reason,) = reasons(run, tmp_path, equipment=equipment)
    assert "received on 2999-01-01, after the run began" in reason


@pytest.mark.parametrize(
    ("issued", "reason"),
    [
        ("2026-11-24", None),
        ("2026-11-25", "issued on 2026-11-25, and today is 2026-11-24 (UTC): correct --issued"),
        ("2026-01-14", "issued on 2026-01-14, before the run ended on 2026-01-15"),
    ],
)
def test_a_certificate_of_a_real_run_is_issued_between_its_end_and_today(run, tmp_path, monkeypatch, issued, reason):
    opened = read_run.__globals__["checked_run"]

    def real(path, equipment, more):
        checked = opened(path, equipment, more)
        return replace(checked, of=replace(checked.of, table=replace(checked.of.table, simulated=False)))

    monkeypatch.setitem(read_run.__globals__, "checked_run", real)
    wanted = replace(asked(run, settled(tmp_path), today=DAY), issued=date.fromisoformat(issued))
    if reason is None:
        assert not make(wanted).document.simulated
        return
    with pytest.raises(Refused) as refused:
        make(wanted)
    assert refused.value.reasons == (reason,)


def test_an_expired_certificate_is_refused(run, tmp_path):
    equipment = tmp_path / "expired.toml"
    equipment.write_text(REGISTER.replace("due = 2030-01-01", "due = 2021-01-01"))
    found = reasons(run, tmp_path, equipment=equipment)
    assert any("it had expired" in one for one in found)


def test_reasons_of_a_register_say_that_it_is_the_one_kept_in_the_run(tmp_path):
    """A register that was filled after the run was complained of, and nothing said how to take it."""
    path = stand(tmp_path, register=REGISTER.replace('address = "1 Weight Road"', 'address = ""'))
    wanted = asked(path, settled(tmp_path))

    def last() -> str:
        with pytest.raises(Refused, match=r"add laboratory\.address in equipment\.toml") as refused:
            make(wanted)
        return str(refused.value).splitlines()[-1]

    kept, file = f"equipment.toml and the register are those kept in {path} when it began", tmp_path / "equipment.toml"
    begin, end = f"{kept}; ", f"--equipment {file} takes it, or make the dry run again"
    assert last() == f"{begin}correct {file}; then {end}"
    file.write_text(REGISTER)
    assert last() == f"{begin}{file} is different now: {end}"
    make(replace(wanted, equipment=file))
    file.unlink()
    assert last() == f"{kept}: --equipment FILE takes a corrected one"
    path.rename(path := tmp_path / "whole.sqlite")
    wanted = asked(path, settled(tmp_path, text=SETTINGS.replace('country = "GB"', "")))
    with pytest.raises(Refused) as refused:
        make(replace(wanted, equipment=_written(file)))
    assert "kept in" not in str(refused.value)


def _written(path: Path) -> Path:
    path.write_text(REGISTER)
    return path


def test_a_range_that_is_left_is_refused(run, tmp_path):
    equipment = tmp_path / "range.toml"
    equipment.write_text(REGISTER.replace("range = [-10, 10]", "range = [-1, 1]"))
    assert any("range" in one for one in reasons(run, tmp_path, equipment=equipment))


def test_repeatability_only_is_refused(run, tmp_path):
    equipment = tmp_path / "nothing.toml"
    text = re.sub(r"(?s)\[\[equipment\.W-1\.says\]\].*?(?=\[equipment\.DVM-1\])", "", REGISTER)
    equipment.write_text(re.sub(r"(?s)\[\[equipment\.DVM-1\.says\]\].*?(?=\[sensors)", "", text))
    found = reasons(run, tmp_path, equipment=equipment)
    (said,) = (one for one in found if "repeatability only" in one)
    assert said.startswith(
        "the uncertainties of 6 results are repeatability only (coefficient 1, coefficient force_kN, "
    )
    assert said.endswith(" of cell); state the errors of the instruments in the register")


def test_a_changed_file_is_refused(run, tmp_path):
    damaged = tmp_path / "damaged.sqlite"
    data = bytearray(run.read_bytes())
    data[len(data) // 2] ^= 0xFF
    damaged.write_bytes(data)
    (reason,) = reasons(damaged, tmp_path)
    assert "is not verified" in reason


def test_a_doubtful_name_is_refused_until_it_is_confirmed(made, monkeypatch, run, tmp_path):
    finding = Finding("effect", "the cell creeps", "replication", 0.5, effect="creep", doubtful="a curve fits as well")

    def with_doubt(*given):
        found = TRACED(*given)
        return replace(found, outcomes=[replace(one, findings=(finding,)) for one in found.outcomes])

    monkeypatch.setitem(read_run.__globals__, "found_in", with_doubt)
    (reason,) = reasons(run, tmp_path)
    assert "the name of effect creep is doubtful: a curve fits as well; confirm it" in reason
    outcomes = with_doubt(run_with_register(run), run).outcomes
    answer = SimpleNamespace(effect="creep", verdict="confirmed", members=())
    assert list(doubtful(outcomes, None)) == [("cell_V", finding)]
    heads = {Path("later.sqlite"): "f0" * 32, Path("last.sqlite"): "1e" * 32}
    confirmed = SimpleNamespace(answers=(answer,), paths=tuple(heads))
    assert list(doubtful(outcomes, confirmed)) == []
    (effect,) = effects(made.budgets[0], outcomes, confirmed, "", heads)
    assert (effect.sensor, effect.confirmed) == ("cell", True)
    files = "later.sqlite, head f0f0f0f0f0f0f0f0 and last.sqlite, head 1e1e1e1e1e1e1e1e"
    assert effect.how == f"by {files}"
    other = SimpleNamespace(effect="curve", sizes={"cell_V": "2 mV"})
    confirmed.answers = (SimpleNamespace(effect="creep", verdict="replaced", members=(other,)),)
    assert list(doubtful(outcomes, confirmed)) == []
    (effect,) = effects(made.budgets[0], outcomes, confirmed, "", heads)
    assert (effect.name, effect.size, effect.how) == ("curve", "2 mV", f"distinguished from creep by {files}")
    assert effect.cause == "what the trace of the run named creep"
    confirmed.answers = (SimpleNamespace(effect="creep", verdict="undecided", members=(other,)),)
    assert list(doubtful(outcomes, confirmed)) == [("cell_V", finding)]


def test_a_further_run_of_another_kind_or_bench_is_refused_with_what_to_run(run, tmp_path):
    few = SHORT.replace("replications = 2", "replications = 1")
    (reason,) = reasons(run, tmp_path, confirmed_by=(dry(tmp_path / "attitude", text=few),))
    assert "is a pitch-roll run and" in reason
    assert f"rig confirm {run} --list shows those that would confirm it" in reason
    other, _ = run_dry(tmp_path / "other", PROCEDURE, bench=BENCH.replace("a stand", "another stand"))
    (reason,) = reasons(run, tmp_path, confirmed_by=(other,))
    assert "was made on bench another stand" in reason
    assert f"rig confirm {run} --list shows the runs that would confirm them" in reason


@pytest.mark.parametrize(
    ("verdict", "following"),
    [
        ("undecided", "later.sqlite did not confirm it (verdict: undecided): make the next run (rig confirm {run} "
         "--after {later} --dry), then --confirmed-by {later} --confirmed-by NEXT_RUN"),
        ("not shown", "(verdict: not shown): make the next run (rig confirm {run} --after {later} --dry)"),
        ("none holds", "none of the causes that were looked for, or it changed between the runs: no certificate is "
         "made of this run. rig confirm {run} --by {later} shows why; find the cause, then calibrate again"),
    ],
)  # fmt: skip
def test_a_further_run_that_does_not_confirm_is_no_dead_end(monkeypatch, run, tmp_path, verdict, following):
    finding = Finding("effect", "the cell creeps", "replication", 0.5, effect="creep", doubtful="a curve fits as well")

    def judged(of, path, later, equipment):
        outcomes = [replace(one, findings=(finding,)) for one in TRACED(of, path).outcomes]
        answers = (SimpleNamespace(effect="creep", verdict=verdict, members=(), holding=()),)
        return Found(outcomes, SimpleNamespace(answers=answers, paths=later))

    monkeypatch.setitem(read_run.__globals__, "found_in", judged)
    later = tmp_path / "later.sqlite"
    later.write_bytes(run.read_bytes())
    (reason,) = reasons(run, tmp_path, confirmed_by=(later,))
    assert following.format(run=run, later=later) in reason


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (
            '[[tolerance]]\nresult = "nothing"\nunit = "V"\nlower = 1',
            "no result has that label; there are: coefficient 1",
        ),
        ('[[tolerance]]\nresult = "coefficient 1"\nunit = "mV"\nlower = 1', "is in 'V': convert the limits"),
        (
            '[[tolerance]]\nresult = "inferred force at force 4 kN"\nunit = "kN"\nnominal = 4\ndeviation = 0.1',
            "its value is the point by definition, whatever the item does, so every item would conform; state the "
            "nominal output there, with its tolerance in the output's unit: result = 'output at force 4 kN'",
        ),
    ],
)
def test_tolerances_that_belong_to_nothing(run, tmp_path, more, words):
    with pytest.raises(Refused, match=re.escape(words)):
        make(asked(run, settled(tmp_path, more)))


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ("next_due = 2027-11-24", "recommends no date unless the customer wants one"),
        ("customer_wants_due_date = true", "needs next_due"),
        ('[[tolerance]]\nresult = "a"\nunit = "V"', "a tolerance is lower or upper or both, or nominal with deviation"),
        ('[[tolerance]]\nresult = "a"\nunit = "V"\nlower = 2\nupper = 1', "lower limit must be below"),
        ("nonsense = 1", "nonsense"),
    ],
)
def test_settings_that_cannot_be_used(run, tmp_path, more, words):
    with pytest.raises(ConfigurationError, match=words):
        make(asked(run, settled(tmp_path, more)))


def test_a_date_if_the_customer_wants_one(run, tmp_path):
    wanted = "customer_wants_due_date = true\nnext_due = 2027-11-24"
    assert make(asked(run, settled(tmp_path, wanted))).document.next_due == date(2027, 11, 24)


def test_as_found_and_as_left(run, tmp_path):
    settings, left = settled(tmp_path), stand(tmp_path / "later")
    with pytest.raises(Refused, match="say what was adjusted between them"):
        make(CertificateRequest((run, left), DAY, settings=settings))
    with pytest.raises(Refused, match="both files are of the same run"):
        make(CertificateRequest((run, run), DAY, settings=settings, adjustment="zero was set"))
    found = make(CertificateRequest((run, left), DAY, settings=settings, adjustment="zero was set")).document
    assert [one.stage for one in found.tables] == ["as found", "as left"]
    assert [one.stage for one in found.evidence] == ["as found", "as left"]
    assert found.adjustment == "zero was set"
    with pytest.raises(UsageError, match="one run, or of two"):
        make(CertificateRequest((run, run, run), DAY, settings=settings))


def test_files_are_written_once(made, tmp_path):
    first = issue(made, Issue(tmp_path))
    assert [path.name for path in first.files] == [f"SIM-S-2026-001.{form}" for form in ("pdf", "html", "xml", "json")]
    second = issue(made, Issue(tmp_path, because="The customer wants two."))
    assert second.document.number == "SIM-S-2026-002"
    before = {path: path.read_bytes() for path in first.files}
    with pytest.raises(UsageError, match="is never overwritten: --amends SIM-S-2026-001"):
        issue(made, Issue(tmp_path, number="SIM-S-2026-001"))
    assert {path: path.read_bytes() for path in first.files} == before
    again = issue(made, Issue(tmp_path / "elsewhere", number="SIM-S-2026-001"))
    assert {path.name: path.read_bytes() for path in again.files} == {path.name: data for path, data in before.items()}


def test_half_a_certificate_is_none(tmp_path):
    (tmp_path / "K-1.html").write_text("somebody else's")
    with pytest.raises(UsageError, match="never overwritten"):
        write_once(tmp_path, "K-1", {"pdf": b"a", "html": b"b"})
    assert [path.name for path in tmp_path.iterdir()] == ["K-1.html"]


@pytest.mark.parametrize("number", ["../K-1", "a/b", "", " K", ".hidden", "a\\b"])
def test_numbers_that_are_no_file_names(made, tmp_path, number):
    if number:
        with pytest.raises(UsageError, match="cannot be the name of a file"):
            issue(made, Issue(tmp_path, number=number))
    assert list(tmp_path.iterdir()) == []


def test_fields_that_an_earlier_version_did_not_have_are_no_change_where_they_are_empty():
    now = {"number": "1", "supplied": [], "items": [{"name": "cell", "serial": "7", "from_customer": []}]}
    before = {"number": "1", "items": [{"name": "cell", "serial": "8"}]}
    assert changes(before, now) == ("items cell serial: 8 is now 7",)


def result_of(label, value, **more):
    return {"label": label, "value": value, "expanded": "0.2", "k": "1.96", "unit": "Hz", "probability": "0.95", **more}


def test_a_result_is_the_same_by_its_name_and_changes_in_one_sentence():
    """A coefficient more moves no other result; digits that the page has not are no change."""
    first = [result_of("coefficient 1", "46.1", estimate=46.12885), result_of("output", "112.2", df=3e4)]
    then = [
        result_of("coefficient 1", "48.0", estimate=48.01431, k="1.97"),
        result_of("coefficient x", "0.5"),
        result_of("output", "112.2", df=360.06),
    ]
    before, now = ({"tables": [{"sensor": "s_Hz", "results": rows}]} for rows in (first, then))
    assert changes(before, now) == (
        "result coefficient 1: 46.1 ± 0.2 Hz (k = 1.96) is now 48.0 ± 0.2 Hz (k = 1.97)",
        "result coefficient x is new: 0.5 ± 0.2 Hz (k = 1.96)",
    )
    assert changes(now, before)[-1] == "result coefficient x is left out: 0.5 ± 0.2 Hz (k = 1.96)"


def test_an_amendment_says_what_changed(made, tmp_path):
    first = issue(made, Issue(tmp_path)).document
    corrected = replace(made.document, items=(replace(made.document.items[0], serial="78"),))
    second = issue(replace(made, document=corrected), Issue(tmp_path, amends=first.number, because="A typing error."))
    amends = second.document.amends
    assert second.document.number == "SIM-S-2026-001-1"
    assert amends.changes == ("A typing error.", "items cell serial: 77 is now 78")
    assert (amends.number, amends.issued) == (first.number, DAY)
    assert b"<dcc:referralID>SIM-S-2026-001<" in (tmp_path / "SIM-S-2026-001-1.xml").read_bytes()
    again = replace(made.document, items=(replace(made.document.items[0], serial="79"),))
    third = issue(replace(made, document=again), Issue(tmp_path, amends=second.document.number)).document
    assert third.number == "SIM-S-2026-001-2", "an amendment of an amendment is one of the original"
    assert third.amends.changes == ("items cell serial: 78 is now 79",)
    reference = f"It replaces certificate SIM-S-2026-001-1 of {DAY}; the original is SIM-S-2026-001 of {DAY}."
    assert all(reference.encode() in (tmp_path / f"SIM-S-2026-001-2.{form}").read_bytes() for form in ("xml", "html"))
    with pytest.raises(UsageError, match="nothing changed"):
        issue(replace(made, document=again), Issue(tmp_path, amends=third.number))
    with pytest.raises(UsageError, match="SIM-S-2026-001 was replaced by SIM-S-2026-001-1: --amends SIM-S-2026-001-1"):
        issue(made, Issue(tmp_path, amends=first.number, because="Another word."))
    with pytest.raises(UsageError, match="S-9 cannot be amended"):
        issue(made, Issue(tmp_path, amends="S-9"))


def test_steps_by_hand_are_told_as_the_procedure_says_them():
    weigh = hand_steps.Made("weight", "hang the weight.", 60.0, "force_kN", 5.0, "A. Byron")
    lock = hand_steps.Made("pads-locked", "lock the pads", 7200.0)
    assert list(steps_by_hand([weigh, lock, replace(weigh, elapsed_s=600.0, number=5.01)], "")) == [
        "A person (A. Byron) did a step by hand, 2 times, 60 s, 10 min after the begin of the run: hang the weight; "
        "stated for force: 5, 5.01 kN.",
        "A person did a step by hand, 2 h 00 min after the begin of the run: lock the pads.",
    ]


WARM = PROCEDURE.replace(
    "[settle]", "[factors.oven_degC]\nlevels = [10, 40]\nhard = true\n[soak]\ndwell_s = 60\n[settle]"
)
WARM_BENCH = (
    BENCH.replace("[sensors.cell]", f"{CHAMBER}[sensors.cell]")
    .replace(
        'force_kN = "operator"\n[limits]', 'force_kN = "operator"\noven_degC = "oven"\n[limits]\noven_degC = [-60, 100]'
    )
    .replace('driver = "person"\n', 'driver = "person"\nasset = "W-1"\n')
    .replace("nplc = 1\n", 'nplc = 1\nasset = "DVM-1"\n', 1)
)


@pytest.fixture(scope="module")
def warm(tmp_path_factory) -> Path:
    """A run at two temperatures, which are in no model."""
    folder = tmp_path_factory.mktemp("warm")
    (folder / "equipment.toml").write_text(REGISTER)
    path, result = run_dry(folder, WARM, WARM_BENCH)
    assert result.outcome is Outcome.COMPLETE, result.message
    return path


def test_a_factor_without_influence_is_no_part_of_a_point_and_the_certificate_says_where_results_hold(warm, tmp_path):
    """Nothing depends on the oven: the point needs none, and the results hold at its temperatures."""
    document = make(asked(warm, settled(tmp_path))).document
    oven = run_table(warm).columns["oven_degC"]
    told = f"which are in no model: oven {oven.min():.4g} to {oven.max():.4g} °C, mean 25 °C."
    told = f"Results hold at the conditions of the run, {told}"
    assert told in document.notes
    assert [one.label for one in document.tables[0].results][-1] == "inferred force at force 4 kN"
    text = SETTINGS.replace("force_kN = 1 }", "force_kN = 1, oven_degC = 23 }").replace(
        "force_kN = 4 }", "force_kN = 4, oven_degC = 23 }"
    )
    document = make(asked(warm, settled(tmp_path, text=text))).document
    assert "Of the points oven_degC is not used: the model of the results does not have it." in " ".join(document.notes)


def test_a_temperature_in_the_model_of_one_sensor_is_still_a_condition_of_the_others(warm):
    """An amended certificate lost the temperature of the chamber when one of four sensors depended on it."""
    table = run_table(warm)
    table = replace(table, outputs={"cell_V": "cell", "other_V": "other"})
    some = SimpleNamespace(
        columns={"force_kN": 0, "oven_degC": 0}, lack=lambda name: ["other_V"] if name == "oven_degC" else ()
    )
    (told,) = held(table, (), some, ())
    assert told.startswith("results of other hold at the conditions of the run, which their models do not have: oven ")
    every = SimpleNamespace(columns={"force_kN": 0, "oven_degC": 0}, lack=lambda _: ())
    assert [*held(table, (), every, ())] == []


@pytest.mark.parametrize(
    ("at", "says"),
    [
        ("{ oven_degC = 20 }", "they lack force_kN, on which results of cell_V depend; add it"),
        ("{ force_N = 20 }", "the run has no force_N; its factors are"),
        (
            "{ force_kN = 1 }, { force_kN = 1, oven_degC = 2 }",
            "they have different quantities, force_kN and",
        ),
    ],
)
def test_points_that_cannot_be_used_name_the_settings_as_well(warm, tmp_path, at, says):
    text = re.sub(r"at = .*", f"at = [{at}]", SETTINGS)
    (reason,) = [one for one in reasons(warm, tmp_path, text) if "points of results" in one]
    assert reason.startswith("the points of results (`--at`, or `at` in certificate.toml): ")
    assert says in reason


def test_what_is_not_traced_has_no_certificate_in_the_table(warm, tmp_path):
    document = make(asked(warm, settled(tmp_path))).document
    by_name = {one.name: one for one in document.equipment}
    assert by_name["oven"].certificate == by_name["oven"].laboratory == ""
    assert by_name["dvm"].certificate == "E-1"
    # a certificate of which the register states nothing traces no result
    silent = REGISTER.replace('quantity = "force_kN"', 'quantity = "load_kN"')
    of = checked_run(warm, written_register(tmp_path, silent)).of
    assert [one.certificate for one in equipment([of]) if one.asset == "W-1"] == [""]


def written_register(folder: Path, text: str) -> Path:
    path = folder / "other.toml"
    path.write_text(text)
    return path


def test_a_point_outside_the_run_is_refused(run, tmp_path):
    (reason,) = reasons(run, tmp_path, SETTINGS.replace("force_kN = 4", "force_kN = 25"))
    assert reason == (
        "force_kN = 25 is outside the run, which has 0 to 5: nothing shows that the model holds there; correct `at`"
    )


def test_another_register_than_that_of_the_run_is_on_the_certificate(run, tmp_path):
    given = tmp_path / "other.toml"
    given.write_text(REGISTER.replace("expanded = 0.01", "expanded = 0.001"))
    document = make(asked(run, settled(tmp_path), equipment=given)).document
    digest = hashlib.sha256(given.read_bytes()).hexdigest()
    assert document.deviations[0] == (
        f"The register of equipment kept with the run was replaced after it by other.toml, SHA-256 {digest}: equipment "
        "W-1 says 1 expanded: 0.01 is now 0.001."
    )
    given.write_text(REGISTER)
    same = make(asked(run, settled(tmp_path), equipment=given)).document
    assert not any("replaced" in one for one in same.deviations)


def test_two_items_with_one_serial_number_are_refused(tmp_path):
    item = REGISTER.partition("[sensors.cell]")[2]
    second = '[instruments.dvm_2]\ndriver = "keysight-34401a"\naddress = "/dev/rig/dvm_2"\nasset = "DVM-1"\n'
    bench = BENCH.replace("[factors]", f'{second}[sensors.other]\nreader = "dvm_2"\n[factors]')
    world = WORLD.replace("[person]", '[sensors.other]\nformula = "0.5*force_kN"\nnoise = 1e-5\n[person]')
    run = stand(tmp_path, register=f"{REGISTER}[sensors.other]{item}", bench=bench, world=world)
    assert "cell and other have one serial number, 77: correct sensors.other.serial in equipment.toml" in reasons(
        run, tmp_path
    )


def test_the_command(run, tmp_path):
    settings = settled(tmp_path)
    out = tmp_path / "out"
    done = rig(
        "certificate", run, "--settings", settings, "--out", out, "--issued", ISSUED, "--paper", "letter", "--json"
    )
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["number"] == "SIM-S-2026-001"
    assert sorted(told["files"]) == ["html", "json", "pdf", "xml"]
    read = rig("certificate", "--read", told["files"]["xml"], "--json")
    assert read.returncode == 0, read.stderr
    quantities = json.loads(read.stdout)["quantities"]
    values = [n["value"] for q in quantities if "basic_measuredValue" in q["ref_types"] for n in q["numbers"]]
    assert values == [float(one["value"]) for table in told["tables"] for one in table["results"]]
    shown = rig("certificate", "--read", told["files"]["xml"])
    assert "not signed" in shown.stdout
    assert "SIM-S-2026-001" in shown.stdout


def test_a_refusal_ends_with_two_and_writes_nothing(run, tmp_path):
    done = rig("certificate", run, "--out", tmp_path / "out", cwd=tmp_path)
    assert done.returncode == 2
    assert "no certificate is made of" in done.stderr
    assert done.stderr.count("\n- ") >= 4
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("missing", "extra"), [("typst", "certificate"), ("signxml", "dcc")])
def test_a_missing_extra_is_told_before_the_work(run, tmp_path, monkeypatch, missing, extra):
    from rig import extras  # noqa: PLC0415

    real = extras.import_module

    def imported(name):
        if name.startswith(missing):
            raise ImportError(name)
        return real(name)

    monkeypatch.setattr(extras, "import_module", imported)
    monkeypatch.setitem(read_run.__globals__, "found_in", None)  # would fail if it were reached
    keys = ["--key", tmp_path / "k.pem", "--key-certificate", tmp_path / "c.pem"]
    done = rig("certificate", run, "--settings", settled(tmp_path), "--out", tmp_path / "out", *keys)
    assert (done.returncode, f"pip install 'calibration-rig[{extra}]'" in done.stderr) == (2, True), done.stderr


@pytest.mark.parametrize("arguments", [[], ["--out", "x"], ["RUN"], ["RUN", "--read", "x.xml"]])
def test_what_is_asked_for_must_be_complete(run, arguments):
    assert rig("certificate", *(run if one == "RUN" else one for one in arguments)).returncode == 2


@pytest.mark.parametrize("half", ["key", "certificate"])
def test_half_a_key_is_told_before_the_work_and_not_ignored(tmp_path, half):
    with pytest.raises(UsageError, match="a signature needs both"):
        Issue(tmp_path, **{half: tmp_path / "half.pem"})


def test_conditions_are_the_smallest_the_mean_and_the_largest(made):
    of = made.budgets[0].of
    columns = {**of.table.columns, "room_degC": np.array([20.004, 20.0, 21.006]), "lost_degC": np.array([1.0, np.nan])}
    config = of.config.model_copy(update={"temperatures": {"room_degC": None, "lost_degC": None, "none_degC": None}})
    run = replace(made.budgets[0], of=replace(of, table=replace(of.table, columns=columns), config=config))
    (room,) = conditions(run, "as left")
    assert (room.label, room.unit, room.minimum, room.mean, room.maximum, room.stage) == (
        *("room", "°C", "20.00", "20.34", "21.01"),
        "as left",
    )


@pytest.mark.parametrize(
    ("unit", "plainly"),
    [
        ("V per unit of force_kN", "V/kN"),
        ("V per unit of force_kN^2", "V/kN^2"),
        ("V per unit of force_kN:bath_degC", "V/(kN*degC)"),
        ("V per unit of log(force_kN)", "V per unit of log(force_kN)"),
        ("Hz per unit of I((chamber_degC - 25) * flow_kg_per_min)", "Hz*min/(degC*kg)"),
        ("V per unit of I(log(force_kN))", "V per unit of I(log(force_kN))"),
        ("V", "V"),
        ("Hz per unit of flow_m3_per_h", "Hz*h/m^3"),
        ("Hz per unit of flow_kg_per_min:chamber_degC", "Hz*min/(kg*degC)"),
        ("mV_per_V per unit of flow_m3_per_h^2", "mV_per_V*h^2/m^6"),
    ],
)
def test_units_of_coefficients(unit, plainly):
    assert per_term(unit) == plainly


def test_a_unit_without_an_si_unit_is_a_text_in_the_xml(made, tmp_path):
    table = made.document.tables[0]
    odd = replace(table.results[0], unit="V per unit of log(force_kN)")
    document = replace(made.document, tables=(replace(table, results=(odd,)),), budgets=())
    issue(replace(made, document=document), Issue(tmp_path))
    read = read_dcc(tmp_path / "SIM-S-2026-001.xml")
    (text,) = [one.text for one in read.quantities if one.where == "results"]
    assert odd.value in text
    assert odd.expanded in text


def test_rounded_numbers_have_all_of_their_digits():
    for value, u in ((1234567.0, 15000.0), (1e-12, 1.5e-13), (0.1, 0.001), (-5.0, 0.01)):
        both = rounded(value, u)
        assert float(decimal_text(both.value)) == float(both.value)
        assert np.isclose(float(plain(decimal_text(both.uncertainty))), u, rtol=0.05)
