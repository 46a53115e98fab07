"""Loops of other kinds, with the true cause hidden in the simulated world (`python -m proving.loops` does many)."""

from __future__ import annotations

import pytest

from proving.loops import one_loop


@pytest.mark.parametrize(("kind", "seed"), [("attitude", 1), ("attitude", 2), ("load-cell", 1)])
def test_the_true_cause_is_confirmed(kind: str, seed: int):
    """Also where the trace named its look-alike (attitude, seed 2), and where a person sets the weights."""
    told = one_loop(kind, seed)
    assert told.found
    assert told.verdict == "right", told.holds
    assert told.before is not None
    assert told.after is not None
    assert told.after < told.before
