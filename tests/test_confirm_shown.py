"""What `rig confirm` prints is read at 80 columns: words are not broken into the columns of a table."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from rig.cli import confirm_show

WHAT = "force_kN at the settings of the first run and between them"


@pytest.fixture
def plain(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr("rig.closed_loop.confirm.proposals.otherwise", lambda *_: ["it may leave two causes open"])


SIZE = "23 points x 1 replication"


def proposal(**more):
    known = {
        "size": SIZE,
        "hours": 0.5,
        "separated": (3, 4),
        "nearest": (0.97, 4.1),
        "shown": (1.0, 278.0),
    }
    return SimpleNamespace(variation=SimpleNamespace(what=WHAT), **{**known, **more})


def test_a_proposed_run_is_two_lines(plain, capsys):
    confirm_show.show_proposals(None, [proposal(), proposal(nearest=None, separated=(0, 0))], (), 1, every=True)
    lines = capsys.readouterr().out.splitlines()
    assert lines[:4] == [
        f"1  {WHAT}",
        f"   {SIZE}, 30 min; 3 of 4 pairs separated; nearest pair 4.1 (97%); weakest cause 278 (100%)",
        f"2  {WHAT}",
        f"   {SIZE}, 30 min; weakest cause 278 (100%)",
    ]
    assert lines[-1] == "  run 1: it may leave two causes open"


def test_a_verdict_has_its_numbers_in_sentences(plain, capsys):
    member = SimpleNamespace(
        effect="creep:force_kN",
        holds=True,
        fits=True,
        sigmas=0.0,
        shown=116.0,
        limit=3.1,
        p_shown=1e-12,
        p_changed=0.081,
        sizes={"a_V": "1 mV", "b_V": "2 mV"},
    )
    other = SimpleNamespace(**{**vars(member), "effect": "drift", "holds": False, "fits": False, "sigmas": 8.0})
    answer = SimpleNamespace(effect="creep:force_kN", verdict="confirmed", members=(member, other), outliers=())
    confirm_show.show_answer(answer)
    assert capsys.readouterr().out.splitlines()[1:] == [
        "creep:force_kN: confirmed",
        "  creep:force_kN",
        "    shown by 116.0 standard errors (limit 3.1), p < 1e-06; the same size in both runs: p 0.081",
        "    size in the further run, 95 %: a_V: 1 mV",
        "                                   b_V: 2 mV",
        "  drift: does not hold",
        "    8.0 standard errors behind the best; shown by 116.0 standard errors (limit 3.1), p < 1e-06; the same size "
        "in both runs: p 0.081; does not fit the further run",
        "    size in the further run, 95 %: a_V: 1 mV",
        "                                   b_V: 2 mV",
    ]
