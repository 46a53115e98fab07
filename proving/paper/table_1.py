"""Table 1: mean normalised standard deviations of the designs of figures 2 to 5."""

from __future__ import annotations

import numpy as np

from proving.paper import printed
from proving.paper.statement import Statement, digits
from rig.procedures.attitude.designs import roll_circle, uniform
from rig.procedures.attitude.merit import DesignPoints, Usage, figure_of_merit

N, M = 33, 64
"""Pitch and roll angles of the table's designs."""

_FINE = np.arange(-10, 11)
FIGURE_3_TOP = tuple(sorted([*_FINE, *(s * a for s in (-1, 1) for a in (12, 14, 18, 22, 26, 30))]))
FIGURE_3_BOTTOM = tuple(sorted([*np.arange(-16, 17, 4), *(s * a for s in (-1, 1) for a in (18, *range(20, 31)))]))
"""1 deg and 4 deg steps as section 5.3.2 has them make 31 angles. The table has N = 33: a pair half-way across each
change of step makes them 33 and gives the printed digits."""
FIGURE_4 = (*([-30.0] * 16), 0.0, *([30.0] * 16))


def grid(name: str, pitch_deg: tuple[float, ...], roll_deg: tuple[float, ...]) -> DesignPoints:
    """Every pitch with every roll; an angle that stands twice is visited twice."""
    pitch, roll = np.meshgrid(np.array(pitch_deg, float), np.array(roll_deg, float), indexing="ij")
    return DesignPoints(name, pitch.ravel(), roll.ravel())


def d1(pitch_max_deg: float, pitch_count: int = N) -> DesignPoints:
    """Design D1: pitch uniform from minus to plus `pitch_max_deg`, roll uniform over the circle without repeats."""
    pitch = uniform(-pitch_max_deg, pitch_max_deg, pitch_count)
    return grid(f"D1 +-{pitch_max_deg:g}", pitch, roll_circle(M, repeat_180=False))


def no_roll(pitch_max_deg: float, count: int) -> DesignPoints:
    """The same without roll."""
    pitch = np.array(uniform(-pitch_max_deg, pitch_max_deg, count))
    return DesignPoints(f"+-{pitch_max_deg:g} without roll", pitch, np.zeros(count), roll=False)


def designs() -> dict[str, DesignPoints]:
    """By the figure they are drawn in."""
    roll = roll_circle(M, repeat_180=False)
    return {
        "2(a)": d1(30),
        "2(b)": d1(45),
        "2(c)": d1(90),
        "2(d)": d1(180),
        "3 top": grid("D0, dense in the middle", FIGURE_3_TOP, roll),
        "3 bottom": grid("D0, dense at the ends", FIGURE_3_BOTTOM, roll),
        "4": grid("D0, all at the ends but one", FIGURE_4, roll),
        "5": grid("D1, roll repeated at 180", uniform(-30, 30, N), roll_circle(M + 1, repeat_180=True)),
    }


def merit(figure: str, usage_deg: float) -> float:
    """V^1/2 of one of the designs over plus and minus a range of pitch."""
    return figure_of_merit(designs()[figure], Usage.within(usage_deg))


def table_1() -> tuple[Statement, ...]:
    """Every number of the table."""
    found = []
    for figure, calibrated, used, value in printed.TABLE_1:
        says = f"V^1/2, calibrated over +-{calibrated:g} deg, used over +-{used:g} deg"
        found.append(digits(figure, says, value, merit(figure, used), 3))
    return tuple(found)
