"""One number is one certificate in a laboratory; a second certificate of one run says so, and why."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import date
from functools import cache
from pathlib import Path

import pytest
from certificate_lab import ISSUED, settled, stand

from rig.errors import UsageError
from rig.verbs.certificate import files
from rig.verbs.certificate.issue import Issue, issue
from rig.verbs.certificate.request import CertificateRequest
from rig.verbs.certificate.result import Made, make

pytest.importorskip("typst")
TOLERANCE = '[[tolerance]]\nresult = "every output"\nunit = "V"\nnominal = "0.1 + 0.5*force_kN"\ndeviation = {}\n'


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Path:
    return stand(tmp_path_factory.mktemp("stand"))


@cache
def _made(run: Path, deviation: float) -> Made:
    settings = settled(run.parent, TOLERANCE.format(deviation))
    return make(CertificateRequest((run,), date.fromisoformat(ISSUED), settings=settings))


def made(run: Path, folder: Path, deviation: float = 0.001) -> Made:
    """A certificate by the settings in a folder."""
    return replace(_made(run, deviation), folder=folder)


def other(of: Made) -> Made:
    """A certificate of another run, with the same results."""
    (evidence,) = of.document.evidence
    return replace(of, document=replace(of.document, evidence=(replace(evidence, run_id="another", head="f0" * 32),)))


def test_a_number_is_given_once_whatever_the_folder(run, tmp_path):
    of = made(run, tmp_path)
    assert issue(of, Issue(tmp_path / "a")).document.number == "SIM-S-2026-001"
    assert issue(other(of), Issue(tmp_path / "b")).document.number == "SIM-S-2026-002"
    third = replace(other(of), document=replace(other(of).document, place="elsewhere"))
    with pytest.raises(UsageError, match=r"SIM-S-2026-001 was issued on .*/a, and this one has other contents"):
        issue(third, Issue(tmp_path / "c", number="SIM-S-2026-001"))
    again = issue(of, Issue(tmp_path / "c", number="SIM-S-2026-001"))
    assert again.files[3].read_bytes() == (tmp_path / "a" / "SIM-S-2026-001.json").read_bytes(), "a copy of the same"
    entries = json.loads((tmp_path / "issued.json").read_text())
    assert [one["number"] for one in entries] == ["SIM-S-2026-001", "SIM-S-2026-002"]


def real(of: Made) -> Made:
    """The same as if real instruments had been read."""
    return replace(of, document=replace(of.document, simulated=False))


def test_a_simulated_certificate_takes_no_number_of_the_laboratory(run, tmp_path):
    rehearsed = made(run, tmp_path)
    first = issue(rehearsed, Issue(tmp_path / "a"))
    assert first.document.number == "SIM-S-2026-001"
    page = next(one for one in first.files if one.suffix == ".html").read_text()
    assert "its number is none of the laboratory" in page
    assert issue(real(other(rehearsed)), Issue(tmp_path / "a")).document.number == "S-2026-001", "none is missing"
    with pytest.raises(UsageError, match="the run is simulated: --number SIM-S-2026-002"):
        issue(rehearsed, Issue(tmp_path / "b", number="S-2026-002"))
    with pytest.raises(UsageError, match="SIM-9 is one of a simulated run, and this run is real"):
        issue(real(rehearsed), Issue(tmp_path / "b", number="SIM-9"))
    with pytest.raises(UsageError, match="SIM-S-2026-001 is of a simulated run, and this one is not: neither replaces"):
        issue(real(rehearsed), Issue(tmp_path / "a", amends="SIM-S-2026-001", because="measured"))


def test_a_simulated_certificate_from_before_these_numbers_is_amended_into_them(run, tmp_path, monkeypatch):
    rehearsed = made(run, tmp_path)
    with monkeypatch.context() as before:
        before.setattr("rig.verbs.certificate.issue.SIMULATED_NUMBER", "")
        assert issue(rehearsed, Issue(tmp_path / "a")).document.number == "S-2026-001"
    copied = issue(rehearsed, Issue(tmp_path / "b", number="S-2026-001"))
    assert copied.document.number == "S-2026-001", "a copy keeps it"
    again = issue(rehearsed, Issue(tmp_path / "a", amends="S-2026-001", because="again"))
    assert again.document.number == "SIM-S-2026-001-1"


def test_a_second_certificate_of_a_run_needs_a_reason_and_says_that_tolerances_changed(run, tmp_path):
    first = issue(made(run, tmp_path), Issue(tmp_path / "a"))
    wider = made(run, tmp_path, 0.01)
    with pytest.raises(UsageError, match=r"SIM-S-2026-001 of 2026-11-24 in .*/a is of the same run: --amends SIM-S-"):
        issue(wider, Issue(tmp_path / "b"))
    second = issue(wider, Issue(tmp_path / "b", because="The customer states another tolerance."))
    said = second.document.deviations
    assert said[0] == (
        "There is another certificate of the same run, SIM-S-2026-001 of 2026-11-24. Reason for this one: The customer "
        "states another tolerance."
    )
    rule = first.document.statements[0].rule
    changed = f"cell output at force 1 kN: 0.6 ± 0.001 V, {rule}; now 0.6 ± 0.01 V, {rule}"
    assert said[1].startswith(f"Tolerances or decision rules were changed after the results were known: {changed}.")
    assert said[0] in next(one for one in second.files if one.suffix == ".html").read_text()
    (tmp_path / "b" / "SIM-S-2026-002.json").rename(tmp_path / "moved.json")
    third = issue(wider, Issue(tmp_path / "c", because="Lost."))
    assert "SIM-S-2026-001 of 2026-11-24 and SIM-S-2026-002 of 2026-11-24" in third.document.deviations[0]
    assert "whether its tolerances were the same is not known" in third.document.deviations[1]


def test_an_amendment_with_other_tolerances_says_so_and_is_the_only_one(run, tmp_path):
    first = issue(made(run, tmp_path), Issue(tmp_path / "a"))
    second = issue(made(run, tmp_path, 0.01), Issue(tmp_path / "a", amends=first.document.number))
    assert second.document.deviations[0].startswith("Tolerances or decision rules were changed after the results")
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "SIM-S-2026-001.json").write_bytes((tmp_path / "a" / "SIM-S-2026-001.json").read_bytes())
    with pytest.raises(UsageError, match=r"SIM-S-2026-001 was replaced by SIM-S-2026-001-1"):
        issue(made(run, tmp_path, 0.02), Issue(tmp_path / "b", amends=first.document.number))


AGREED = TOLERANCE.format(0.001)


@pytest.fixture(scope="module")
def agreed(tmp_path_factory) -> Path:
    """A run with the laboratory's settings beside its bench."""
    folder = tmp_path_factory.mktemp("agreed")
    settled(folder, AGREED)
    return stand(folder)


@pytest.mark.parametrize(
    ("now", "words"),
    [
        (AGREED, ()),
        (
            TOLERANCE.format(0.01),
            (
                "The tolerance of 'every output' is not one recorded in the run before its first observation.",
                "A tolerance of 'every output', recorded in the run before its first observation, is not applied: "
                "unit = V, nominal = 0.1 + 0.5*force_kN, deviation = 0.001.",
            ),
        ),
        (
            f'[decision]\nrule = "simple"\n{AGREED}',
            ("The decision rule is not the one recorded in the run before its first observation: acceptance limits",),
        ),
    ],
    ids=["as agreed", "wider", "another rule"],
)
def test_what_was_recorded_before_the_run_is_compared(agreed, tmp_path, now, words):
    found = make(
        CertificateRequest((agreed,), date.fromisoformat(ISSUED), settings=settled(tmp_path, now))
    ).document.deviations
    said = [one for one in found if "olerance" in one or "decision" in one]
    assert len(said) == len(words)
    assert all(one.startswith(start) for one, start in zip(said, words, strict=True))


def test_tolerances_that_no_run_recorded_are_said_to_be_so(run, tmp_path):
    (said,) = (one for one in made(run, tmp_path).document.deviations if "olerance" in one)
    assert said.startswith("Tolerances and decision rule are not recorded in the run: nothing shows")


@pytest.mark.parametrize("after", [1, 2, 3, 4])
def test_a_number_whose_issue_is_cut_is_free_again(run, tmp_path, monkeypatch, after):
    """Killed after so many files have their names, the JSON being the last; the next issue clears up."""
    of, named = made(run, tmp_path), files._name

    def killed(*pair):
        count.append(pair)
        if len(count) == after:
            if after == 4:
                named(*pair)
            raise SystemExit
        named(*pair)

    count: list[tuple] = []
    with monkeypatch.context() as cut:
        cut.setattr(files, "_name", killed)
        cut.setattr(Path, "unlink", lambda *_, **__: None)  # a kill clears nothing up
        cut.setattr("rig.verbs.certificate.numbers_issued.Issued._undone", lambda *_: None)
        with pytest.raises(SystemExit):
            issue(of, Issue(tmp_path / "a"))
    how = Issue(tmp_path / "a", because="again" if after == 4 else "")
    assert issue(of, how).document.number == ("SIM-S-2026-002" if after == 4 else "SIM-S-2026-001")


def test_a_register_that_cannot_be_read_is_no_empty_one(run, tmp_path):
    (tmp_path / "issued.json").write_text("[{]")
    with pytest.raises(UsageError, match=r"the register of issued numbers cannot be read .* restore it from a backup"):
        issue(made(run, tmp_path), Issue(tmp_path / "a"))


def test_one_register_for_several_settings(run, tmp_path):
    folders = [tmp_path / "one", tmp_path / "two"]
    for folder in folders:
        folder.mkdir()
    one, two = (made(run, folder) for folder in folders)
    shared = [
        replace(of, settings=of.settings.model_copy(update={"numbers": "../all.json"})) for of in (one, other(two))
    ]
    assert [issue(of, Issue(of.folder)).document.number for of in shared] == ["SIM-S-2026-001", "SIM-S-2026-002"]
