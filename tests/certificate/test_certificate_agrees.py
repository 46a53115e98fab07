"""A certificate of a confirmed effect does not leave its cause open: "cannot separate" stood beside "confirmed"."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from rig.verbs.budget.found import Found
from rig.verbs.certificate.parts_in_numbers import effects, models, notes

NOTE = (
    "cell_V: drift:elapsed_s: it is doubtful: two causes do as well; these data cannot separate it from "
    "ageing:elapsed_s, slow-wander"
)
OTHER = "cell_V: creep:force_kN: these data cannot separate it from lag:force_kN"


def member(effect, *, holds):
    sizes = {"cell_V": "1.2 mV (1.1 to 1.3)"} if holds else {}
    return SimpleNamespace(effect=effect, holds=holds, sizes=sizes, zero=())


def confirmed(verdict="confirmed", effect="drift:elapsed_s"):
    members = (
        member(effect, holds=True),
        member("ageing:elapsed_s", holds=False),
        member("step:elapsed_s", holds=False),
    )
    answer = SimpleNamespace(effect=effect, verdict=verdict, members=members)
    return SimpleNamespace(answers=[answer], paths=[Path("later.sqlite")])


def run(*said):
    return SimpleNamespace(notes=said, sensors=(), budgets=(), of=SimpleNamespace(table=SimpleNamespace(outputs={})))


def test_a_note_says_what_the_run_alone_leaves_open_and_what_the_further_run_says():
    first, second = notes(run(NOTE, OTHER), confirmed())
    assert "these data cannot separate" not in first
    assert "by the data of this run alone it is doubtful: two causes do as well" in first
    assert "the data of this run alone cannot separate it from ageing:elapsed_s, slow-wander" in first
    assert "the further run confirms drift:elapsed_s and excludes ageing:elapsed_s, and the budgets count the" in first
    assert second == f"{OTHER}."


def test_a_doubt_without_another_cause_has_no_difference_that_budgets_count():
    """Each confirmed effect that the reason named was said to be counted, too."""
    doubt = "cell_V: drift:elapsed_s: it is doubtful: step:elapsed_s and creep:force_kN do as well together"
    answers = [*confirmed().answers, *confirmed(effect="creep:force_kN").answers]
    (told,) = notes(run(doubt), SimpleNamespace(answers=answers))
    assert told.endswith("together; the further run confirms drift:elapsed_s and excludes step:elapsed_s.")


@pytest.mark.parametrize(
    "given",
    [None, confirmed("undecided"), confirmed(effect="drift:elapsed_s,force_kN"), confirmed(effect="drift:elapsed")],
    ids=["no further run", "undecided", "a longer name", "a shorter name"],
)
def test_without_a_confirmation_of_this_effect_it_says_what_it_said(given):
    assert list(notes(run(NOTE), given)) == [f"{NOTE}."]


def test_the_state_of_the_effect_says_what_was_excluded():
    finding = SimpleNamespace(
        more={},
        kind="effect",
        effect="drift:elapsed_s",
        size="1 mV",
        size_95="",
        cause="drifts",
        aliases=("ageing:elapsed_s",),
        shared="",
    )
    outcome = SimpleNamespace(sensor="cell_V", findings=[finding])
    (one,) = effects(run(), [outcome], confirmed(), "", {Path("later.sqlite"): "ab" * 16})
    assert one.confirmed
    assert one.how == f"by later.sqlite, head {'ab' * 8}, which excludes ageing:elapsed_s"
    assert one.size == "1 mV; by the further run 1.2 mV (1.1 to 1.3)"
    both = confirmed()
    mine = both.answers[0].members[0]
    mine.zero, mine.terms, mine.intervals_together = ("t",), ("t (a_V)", "t (cell_V)"), ((1.0, 2.0), (0.1, 0.3))
    (one,) = effects(run(), [outcome], both, "", {Path("later.sqlite"): "ab" * 16})
    assert one.size.endswith("1.2 mV (1.1 to 1.3); by both runs together 0.1 to 0.3 for t (cell_V)")
    finding.effect = "outliers"
    (other,) = effects(run(), [outcome], confirmed(), "", {Path("later.sqlite"): "ab" * 16})
    assert other.how == "the further run was not judged by it"


def test_an_effect_that_a_further_run_replaced_has_one_name_on_the_page():
    """The table of effects said setting-lag, the line of the budget carry-over."""
    found = [SimpleNamespace(sensor="mfs_Hz", named=[SimpleNamespace(kind="effect", effect="carry-over:flow")])]
    answer = SimpleNamespace(effect="carry-over:flow", verdict="replaced", holding=("lag:flow",))
    about = SimpleNamespace(of=SimpleNamespace(table=SimpleNamespace(outputs={"mfs_Hz": "mfs"})), lacks={})
    about.evaluation = SimpleNamespace(holds=lambda: {"mfs_Hz": {"lag:flow": "at rest"}})
    (said,) = models(about, "", Found(found, SimpleNamespace(answers=[answer])))
    assert said.endswith("with the effects that were found (mfs: lag:flow (at rest)).")
    assert "rig " not in said, "a customer's page has no command lines"
