"""Readings of which the outputs of a run are means."""

from __future__ import annotations

from types import SimpleNamespace

from rig.tables.behind_rows import within_points


def test_they_stand_in_the_order_of_the_outputs_so_that_a_calibration_is_written_the_same_twice():
    names = [f"sensor_{n}_V" for n in range(12)]
    seen = SimpleNamespace(outputs={name: {"sd": 0.1, "readings": [1.0, 1.1]} for name in names})
    assert list(within_points([seen, seen])) == names
