"""Tables on a terminal of 80 columns: no name and no number is cut."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from rig.procedures.present.blocks import Grid
from rig.procedures.present.terminal import show

LONG = "load_cell_on_the_north_column_of_the_stand"
UNIT = "V_per_unit_of_applied_reference_force_on_the_long_column_kN"
NUMBERS = [f"{1.0 / 3.0 + 7.0 * n:.9f}" for n in range(40)]


def _shown(grid: Grid, width: int = 80) -> str:
    text = io.StringIO()
    show([grid], Console(file=text, width=width, highlight=False))
    return text.getvalue()


@pytest.mark.parametrize("frame", ["box", "none", "plain", "rule"])
def test_long_names_fold_and_numbers_stay_whole(frame):
    """Rich ends a word that is too long for its column with an ellipsis."""
    rows = [(f"{LONG}_{n}", NUMBERS[n], UNIT, f"{LONG} of another", NUMBERS[n + 10]) for n in range(3)]
    text = _shown(Grid(("result", "value", "unit", "largest influence", "U"), frame=frame, apart=2, rows=rows))
    assert "…" not in text
    assert all(number in text for row in rows for number in (row[1], row[4]))
    columns = [line.split("│" if frame == "box" else "  ") for line in text.splitlines()]
    assert max(map(len, text.splitlines())) <= 80
    assert LONG in "".join(cells[1 if frame == "box" else 0].strip() for cells in columns if len(cells) > 1)


def test_a_table_of_many_numbers_is_wider_than_its_terminal():
    """Twelve numbers of eleven digits do not fit: the terminal wraps the lines, and nothing is lost."""
    rows = [[LONG, *NUMBERS[12 * n : 12 * n + 12]] for n in range(3)]
    text = _shown(Grid([str(n) for n in range(13)], frame="rule", rows=rows))
    assert all(number in text for row in rows for number in row[1:])
