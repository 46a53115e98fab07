"""Figures 6 to 8: pitch from one sensor, without roll or with roll measured by something else (sections 6.1, 6.3)."""

from __future__ import annotations

import numpy as np

from proving.paper.packages import normalised_sd, off_grid, package, percent, worst
from proving.paper.plots import PITCH, ROLL, Figure, Line, Panel
from proving.paper.statement import SMALL, Statement, about, above, below, digits

SINGLE = (("x", 1.0, 90.0, 1.0),)
ROLL_ERRORS = (1.0, 10.0, 100.0)
"""Standard deviation of measured roll in that of the pitch sensor."""
_SD = "sd of pitch / sd of output"
_PITCH = off_grid(-90, 90, 0.5)
_ROLL = np.arange(0.0, 181.0)


def figures_6_to_8() -> tuple[Figure, ...]:
    """As plots."""
    no_roll, single = package(("x", 0.0, 0.0, 1.0), roll=False), package(*SINGLE)
    six = Line(_PITCH, normalised_sd(no_roll, _PITCH, 0.0)[0])
    seven = [
        Line(_PITCH, normalised_sd(single, _PITCH, 0.0, measured_roll_sd=sd)[0], f"roll sd {sd:g}")
        for sd in ROLL_ERRORS[:2]
    ]
    eight = [
        Panel(
            f"pitch {pitch:g} deg",
            ROLL,
            _SD,
            tuple(
                Line(_ROLL, normalised_sd(single, pitch, _ROLL, measured_roll_sd=sd)[0], f"roll sd {sd:g}")
                for sd in ROLL_ERRORS
            ),
            (0.0, 3.0),
        )
        for pitch in (0.0, 30.0)
    ]
    return (
        Figure("6", "Pitch from one sensor without roll", (Panel("", PITCH, _SD, (six,), (0.0, 10.0)),)),
        Figure(
            "7",
            "Pitch from one sensor with measured roll, over pitch; coning 1 deg, azimuth 90 deg",
            (Panel("", PITCH, _SD, tuple(seven), (0.0, 10.0)),),
        ),
        Figure("8", "The same over roll", tuple(eight)),
    )


def statements_6_to_8() -> tuple[Statement, ...]:
    """What sections 6.1 and 6.3 say of them."""
    no_roll, single = package(("x", 0.0, 0.0, 1.0), roll=False), package(*SINGLE)
    edge = float(normalised_sd(no_roll, 89.9, 0.0)[0])
    of = {
        sd: normalised_sd(single, np.arange(-60.0, 61.0, 5.0)[:, None], _ROLL[None, :], measured_roll_sd=sd)[0]
        for sd in ROLL_ERRORS
    }
    swing = {sd: worst(percent(y.max(axis=1), y.min(axis=1))) for sd, y in of.items()}
    aligned = package(("x", 0.0, 0.0, 1.0))
    level, tilted = (float(normalised_sd(aligned, a, 0.0, measured_roll_sd=1.0)[0]) for a in (0.0, 30.0))
    least = float(_PITCH[np.argmin(normalised_sd(aligned, _PITCH, 0.0, measured_roll_sd=1.0)[0])])
    bent = float(normalised_sd(single, 30.0, 0.0, measured_roll_sd=1.0)[0])
    return (
        above("6", "unbounded near +-90 deg: at 89.9 deg", edge, 500),
        digits("6", "eq. (78): 1/cos at 60 deg", 2.0, float(normalised_sd(no_roll, 60.0, 0.0)[0]), 3),
        below("6.3", "eq. (82): least at 0 deg", abs(least), 0.5, "deg"),
        about("6.3", "approximately 15 percent greater at 30 deg than at 0", 15, 100 * (tilted / level - 1), 0.6, "%"),
        about("7", "... with a coning angle of 1 deg", 15, 100 * (bent - 1), 1.5, "%"),
        below("7", "roll sd 1: no significant variation with roll, |pitch| to 60 deg", swing[1.0], SMALL, "%"),
        below("7", "roll sd 10: no significant variation with roll", swing[10.0], SMALL, "%"),
        above("8", "roll sd 100: significant variation with roll", swing[100.0], SMALL, "%"),
        digits(
            "8",
            "eq. (81) at pitch 0, roll 0, A = 0, roll sd 100: (1 + (100 sin 1)^2)^1/2 / cos 1",
            float(np.hypot(1.0, 100.0 * np.sin(np.radians(1.0))) / np.cos(np.radians(1.0))),
            float(normalised_sd(package(("x", 1.0, 0.0, 1.0)), 0.0, 0.0, measured_roll_sd=100.0)[0]),
            4,
        ),
    )
