"""Who answers: an answer that is cut short on its way looks like another instrument."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from drivers.errors import BadReply
from drivers.roles import Identity
from rig.bench import identities

TRUE = Identity("HEWLETT-PACKARD", "34970A", "0", "13-2-2")
CUT = Identity("WLETT-PACKARD", "34970A", "0", "13-2-2")
OTHER = Identity("AGILENT TECHNOLOGIES", "34970A", "0", "15-1-1")


def bench(*answers):
    """A bench of one scanner that says these in turn, and how often it was asked."""
    left = iter(answers)
    scanner = SimpleNamespace(identify=lambda: next(left))
    declared = SimpleNamespace(asset="", due=None, serial="", address="sim://scanner")
    config = SimpleNamespace(instruments={"scanner": declared})
    return SimpleNamespace(instruments={"scanner": scanner}, config=config, clock=None, answered={}), left


def makers(bench, known):
    return identities(bench, known)["scanner"]["maker"]


def known(identity):
    return {"scanner": {"maker": identity.maker, "model": identity.model, "serial": identity.serial}}


def test_an_answer_cut_short_is_asked_for_until_it_has_come_twice():
    scanner, left = bench(CUT, TRUE, TRUE, TRUE)
    assert makers(scanner, {}) == "HEWLETT-PACKARD"
    assert next(left) == TRUE  # three questions and no more


def test_who_is_known_is_asked_once():
    scanner, left = bench(TRUE, CUT)
    assert makers(scanner, known(TRUE)) == "HEWLETT-PACKARD"
    assert next(left) == CUT


def test_what_was_answered_a_moment_ago_is_not_asked_again():
    scanner, left = bench(TRUE, TRUE, CUT)
    assert makers(scanner, None) == "HEWLETT-PACKARD"
    assert makers(scanner, {}) == "HEWLETT-PACKARD"
    assert next(left) == CUT


def test_a_cut_answer_at_a_resume_is_no_other_instrument_and_another_instrument_is_one():
    assert makers(bench(CUT, TRUE, TRUE)[0], known(TRUE)) == "HEWLETT-PACKARD"
    assert makers(bench(OTHER, OTHER)[0], known(TRUE)) == "AGILENT TECHNOLOGIES"


def test_who_says_something_else_every_time_is_not_believed():
    answers = [Identity("HP", "34970A", str(n), "") for n in range(9)]
    with pytest.raises(BadReply, match="scanner reports a different identity every time"):
        makers(bench(*answers)[0], {})
