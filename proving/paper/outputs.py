"""Figures 1 to 5: standard deviation of the calibrated output over pitch, section 5.3."""

from __future__ import annotations

import numpy as np

from proving.paper.closed_forms import T4_VARIANCE, T6_VARIANCE, d1_variance
from proving.paper.plots import NORMALISED, PITCH, Figure, Line, Panel
from proving.paper.statement import SMALL, Statement, about, above, below, digits
from proving.paper.table_1 import M, N, d1, designs, merit, no_roll
from rig.fitter.arrays import FloatArray
from rig.procedures.attitude.angles import sin_cos
from rig.procedures.attitude.designs import uniform
from rig.procedures.attitude.merit import DesignPoints, Usage, curve, figure_of_merit

RANGES_DEG = (30.0, 45.0, 90.0, 180.0)
COUNTS = (5, 9, 17, 33, 65)
ROLLS_13 = uniform(-180, 180, 13)
T4_LEVEL, T6_LEVEL = float(np.sqrt(4 * T4_VARIANCE)), float(np.sqrt(6 * T6_VARIANCE))
_LETTERS = "abcd"


def figures_1_to_5() -> tuple[Figure, ...]:
    """As plots."""
    ones, twos = [], []
    for letter, to in zip(_LETTERS, RANGES_DEG, strict=True):
        title = f"({letter}) +-{to:g} deg"
        ones.append(_panel(title, [_line(no_roll(to, 65), to, "D1, N = 65")], to, ("T4", T4_LEVEL)))
        lines = [_line(d1(to, n), to, f"N = {n}") for n in COUNTS]
        twos.append(_panel(title, lines, to, ("T6", T6_LEVEL)))
    found = designs()
    threes = [
        _panel(where, [_line(found[f"3 {where}"], 30, ""), _marks(found[f"3 {where}"])], 30)
        for where in ("top", "bottom")
    ]
    five = curve(found["5"], Usage.within(30), 1.0, roll_deg=ROLLS_13)
    family = [Line(five.pitch_deg, y, f"roll {r:g}") for r, y in zip(five.roll_deg, five.normalised, strict=True)]
    return (
        Figure("1", "Output of a pitch sensor without roll, design D1, N = 65", tuple(ones)),
        Figure("2", "Output with roll, design D1", tuple(twos)),
        Figure("3", "Output with roll, unequally spaced pitch angles over +-30 deg", tuple(threes)),
        Figure("4", "Output with roll, 16 visits at each end and one at 0", (_panel("", [_own("4")], 30),)),
        Figure("5", "Output with roll, roll repeated at 180 deg, at 13 rolls", (_panel("", family, 30),)),
    )


def statements_1_to_5() -> tuple[Statement, ...]:
    """What section 5.3 says of them."""
    return (*_without_roll(), *_with_roll(), *_unequal(), *_repeated())


def _without_roll() -> list[Statement]:
    full = _normalised(no_roll(180, 65), 180)
    tumble = np.sqrt(T4_VARIANCE) / float(np.mean(full / np.sqrt(65)))
    found = [
        digits(
            "5.3, 1",
            "a tumble's uncertainty, not normalised, is greater by (65/4)^1/2",
            4.031,
            tumble / (T4_LEVEL / float(np.mean(full))),
            3,
        )
    ]
    for letter, to in zip(_LETTERS[:3], RANGES_DEG[:3], strict=True):
        y = _normalised(no_roll(to, 65), to)
        middle = _normalised(no_roll(to, 65), to / 2)
        says = f"+-{to:g} deg: low within the centre half of the range, rapidly increasing outside"
        found.append(
            above(
                f"1({letter})",
                says,
                _percent(y.max(), middle.max()),
                SMALL,
                "%",
                "end of the range over maximum in the centre",
            )
        )
    found.append(below("1(d)", "+-180 deg: nearly constant", _percent(full.max(), full.min()), SMALL, "%"))
    found.append(below("1(d)", "... approximately the four-point tumble's", _off(full.mean(), T4_LEVEL), SMALL, "%"))
    for to in RANGES_DEG[:3]:
        centre = figure_of_merit(no_roll(to, 65), Usage.within(to / 2))
        note = "" if to == 90 else "17 % is the value of +-90 deg only"
        says = f"... and 17 percent above the centre of +-{to:g} deg"
        found.append(about("5.3.1", says, 17, _percent(float(np.mean(full)), centre), 1, "%", note))
    return found


def _with_roll() -> list[Statement]:
    found = [
        digits(
            "5.3, 2",
            "a tumble's uncertainty, not normalised, is greater by (65/6)^1/2",
            3.291,
            float(np.sqrt(65 * M / 6)),
            3,
            note=f"the design has MN points, not N: the factor is (65 M/6)^1/2, here with M = {M}",
        )
    ]
    spread = max(
        float(np.ptp(curve(d1(to), Usage.within(to), 1.0, roll_deg=ROLLS_13).normalised, axis=0).max())
        for to in RANGES_DEG
    )
    found.append(below("2", "independent of roll (Theorem IV): largest change", spread, 1e-9))
    at = np.linspace(-30, 30, 31)
    other_m = np.abs(np.sqrt(33 * 7 * d1_variance(at, 30, 33, 7)) - np.sqrt(33 * M * d1_variance(at, 30, 33, M)))
    found.append(below("2", "normalised curves are independent of M: largest change from 7 to 64", other_m.max(), 1e-9))
    for letter, to in zip(_LETTERS, RANGES_DEG, strict=True):
        zero, beside = np.sqrt(N * M * d1_variance([0.0, 10.0], to, N, M))
        if to <= 45:
            found.append(above(f"2({letter})", "concave upward about 0: rise to 10 deg", beside - zero, 0))
        else:
            found.append(below(f"2({letter})", "concave downward about 0: rise to 10 deg", beside - zero, 0))
    for letter, to in (("c", 90.0), ("d", 180.0)):
        zero, end = np.sqrt(N * M * d1_variance([0.0, 90.0], to, N, M))
        says = "significantly greater at 0 than at +-90 deg"
        found.append(above(f"2({letter})", says, _percent(zero, end), SMALL, "%"))
    found.append(below("2(c)", "C_2a < 0 for +-90 deg (eq. 172)", _c_2a(90), 0))
    found.append(digits("2(d)", "C_2a = 1 for +-180 deg (eq. 172)", 1, _c_2a(180), 0))
    at_30 = merit("2(a)", 30)
    slight = below("5.3.2", "+-45 slightly reduces V^1/2 within +-30 deg", _percent(merit("2(b)", 30), at_30), 0, "%")
    found.append(slight)
    found.append(
        about(
            "5.3.2",
            "+-90 worsens V^1/2 within +-30 deg by 12 percent",
            12,
            _percent(merit("2(c)", 30), at_30),
            0.5,
            "%",
        )
    )
    for letter, to in zip(_LETTERS[:2], RANGES_DEG[:2], strict=True):
        few, many = _normalised(d1(to, 5), to), _normalised(d1(to, 65), to)
        shapes = np.abs((few / few.mean()) / (many / many.mean()) - 1).max()
        says = "the shape of the curves does not change significantly from N = 5 to 65"
        found.append(below(f"2({letter})", says, 100 * float(shapes), SMALL, "%", "largest change, with equal means"))
    best = min(range(30, 91), key=lambda to: figure_of_merit(d1(to), Usage.within(30)))
    says = "calibrate over approximately 1.5 times the usage range (recommendation 1)"
    note = f"least V^1/2 within +-30 deg is at +-{best} deg"
    found.append(about("10", says, 1.5, best / 30, 0.25, note=note))
    return found


def _unequal() -> list[Statement]:
    top, bottom, four, uniform_30 = (_normalised(designs()[f], 30) for f in ("3 top", "3 bottom", "4", "2(a)"))
    ten = merit("2(a)", 10)
    return [
        above("3", "bottom is significantly flattened: range of top relative to range of bottom",
              _percent(np.ptp(top), np.ptp(bottom)), SMALL, "%"),
        above("3", "... though its minimum is greater", bottom.min() - top.min(), 0),
        about(
            "5.3.2",
            "bottom reduces V^1/2 by 10 percent against top, used within +-30 deg",
            -10,
            _percent(merit("3 bottom", 30), merit("3 top", 30)),
            0.5,
            "%",
            "Table 1 itself gives 1.937 against 2.127: 8.9 %",
        ),
        about(
            "5.3.2",
            "... and increases it by only 1 percent within +-10 deg",
            1,
            _percent(merit("3 bottom", 10), merit("3 top", 10)),
            0.5,
            "%",
        ),
        about(
            "5.3.2",
            "bottom reduces V^1/2 by 9 percent within +-10 deg against D1",
            -9,
            _percent(merit("3 bottom", 10), ten),
            0.5,
            "%",
            "see below: 1.834 within +-10 deg against 1.989 within +-30 deg would be -7.8 %",
        ),
        about(
            "5.3.2",
            "top gives a 9-percent reduction within +-10 deg against D1",
            -9,
            _percent(merit("3 top", 10), ten),
            0.5,
            "%",
            f"9 % compares its 1.811 within +-10 deg with D1's 1.989 within +-30 deg; D1 has {ten:.3f} within +-10 deg",
        ),
        below("4", "less variation over the range than figure 3", np.ptp(four) / min(np.ptp(top), np.ptp(bottom)), 1),
        below("5.3.2", "unequal spacing brings only small reductions",
              -_percent(four.mean(), uniform_30.mean()), SMALL, "%"),
    ]  # fmt: skip


def _repeated() -> list[Statement]:
    lines = curve(designs()["5"], Usage.within(30), 1.0, roll_deg=ROLLS_13, count=361).normalised
    alone = _normalised(d1(30), 30)
    worst = 100 * float(np.abs(lines / alone - 1).max())
    return [
        above("5", "the curves depend on roll", float(np.ptp(lines, axis=0).max()), 1e-3),
        below("5", "deviation from design D1 is small", worst, SMALL, "%"),
    ]


def _c_2a(pitch_max_deg: float) -> float:
    return float(np.sum(sin_cos(2.0 * np.array(uniform(-pitch_max_deg, pitch_max_deg, N)))[1]))


def _normalised(design: DesignPoints, usage_deg: float) -> FloatArray:
    return np.asarray(curve(design, Usage.within(usage_deg), 1.0, count=361).normalised[0])


def _percent(value: float, than: float) -> float:
    return 100.0 * (value / than - 1.0)


def _off(value: float, than: float) -> float:
    return abs(_percent(value, than))


def _line(design: DesignPoints, to: float, label: str) -> Line:
    return Line(np.linspace(-to, to, 361), _normalised(design, to), label)


def _own(figure: str) -> Line:
    return _line(designs()[figure], 30, "")


def _marks(design: DesignPoints) -> Line:
    at = np.unique(design.pitch_deg)
    y = np.interp(at, np.linspace(-30, 30, 361), _normalised(design, 30))
    return Line(at, y, "calibration points", "o", "C1")


def _panel(title: str, lines: list[Line], to: float, level: tuple[str, float] | None = None) -> Panel:
    if level is not None:
        lines = [*lines, Line(np.array([-to, to]), np.array([level[1]] * 2), level[0], "--", "0.35")]
    return Panel(title, PITCH, NORMALISED, tuple(lines), (1.0, 3.5))
