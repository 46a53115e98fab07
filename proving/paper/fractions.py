"""Figure 21 and eq. (109): fractional designs, section 7."""

from __future__ import annotations

import numpy as np

from proving.paper.plots import PITCH, ROLL, Figure, Line, Panel
from proving.paper.statement import Statement, digits
from proving.paper.table_2 import FRACTION_53, FRACTION_73
from rig.procedures.attitude.designs import Design, fraction, grid, uniform

FULL_247 = grid("D", uniform(-90, 90, 19), uniform(-180, 180, 13))
FRACTION_139 = fraction(FULL_247, pitch_every=3, roll_every=4)


def figure_21() -> Figure:
    """As plots."""
    panels = (_panel("(a) full, 19 x 13", FULL_247), _panel("(b) fraction, K_a = 3, K_R = 4", FRACTION_139))
    return Figure("21", "Experimental designs", panels)


def statements_21() -> tuple[Statement, ...]:
    """Numbers of points."""
    return (
        digits("21(a)", "points of the full design", 247, len(FULL_247), 0),
        digits("21(b)", "points of its fraction, eq. (109)", 139, len(FRACTION_139), 0),
        digits("9.2.2", "points of 5 x 13, K_a = K_R = 2", 53, len(FRACTION_53), 0,
               note="steps of 15 and 30 deg; the text's 3 deg for the former step of pitch is 5 deg"),
        digits("9.3.4", "points of 13 x 7, K_a = K_R = 2", 73, len(FRACTION_73), 0),
    )  # fmt: skip


def _panel(title: str, design: Design) -> Panel:
    pitch, roll = np.array(design.points_deg()).T
    return Panel(f"{title}: {len(design)} points", PITCH, ROLL, (Line(pitch, roll, "", "."),))
