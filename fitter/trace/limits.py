"""Limits of traces that several kinds of run have: one table, with a column for each kind.

A limit that only one module needs stands in that module. One that a second kind needs moves here, with the campaign
that set it, so that two values of one limit are seen side by side.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Kind = Literal["pitch-roll", "whole-plot", "general"]
KINDS: tuple[Kind, ...] = ("pitch-roll", "whole-plot", "general")


@dataclass(frozen=True)
class Limit:
    """One limit.

    Attributes:
        name: unique in the table.
        values: by kind, in the order of `KINDS`; None where a kind does not ask.
        unit: "1" for a probability, a share or a number; "nats".
        meaning: of a value on the side that decides.
        campaign: that set it, `python -m proving ...`; "" for one that no campaign set.
    """

    name: str
    values: tuple[float | None, float | None, float | None]
    unit: str
    meaning: str
    campaign: str = ""


TABLE = (
    Limit(
        "unexplained",
        (1e-3, 1e-3, 1e-3),
        "1",
        "probability by chance of a remainder, over all that is tried, below which it is reported",
        "attitude clean, whole-plots clean, tables clean",
    ),
    Limit(
        "asked again",
        (0.05, 0.05, 0.05),
        "1",
        "probability above which a shape is not tested against slower noise too",
    ),
    Limit(
        "lead of a name",
        (3.0, 1.0, 3.0),
        "nats",
        "least lead of a name over the most probable shape without a name. Whole plots are few: with 3 nats five of "
        "sixteen right names have a doubt, with -1 three of 88 runs of strangers a wrong name without one",
        "strangers effects",
    ),
    Limit(
        "lead of a plain name",
        (3.0, -1.0, 0.0),
        "nats",
        "the same of a name without a searched constant: a smooth curve begins with a line or a square. Most causes in "
        "whole plots are one column that is also the slowest wave of its place: for any data their lead is hardly more "
        "than the difference between the two prices, so they may be behind",
        "strangers effects",
    ),
    Limit(
        "declared",
        (1e-4, 1e-3, 1e-3),
        "1",
        "share of a column beside the declared model, below which it is part of that model",
    ),
    Limit(
        "most outliers",
        (0.005, 0.03, None),
        "1",
        "share of readings above which there are none: they are noise with long tails, or an effect. Readings of "
        "attitude sensors that stand alone are left out; others stay, and count as three standard deviations",
        "attitude outliers, whole-plots spoilt",
    ),
    Limit(
        "inner residuals",
        (0.95, 0.95, None),
        "1",
        "share of residuals that give the scale of outliers; the middle ones have little information",
    ),
    Limit("harmonics", (3.0, 3.0, 3.0), "1", "harmonics of a period that its shape may have"),
    Limit("waves of a curve", (24.0, 24.0, 24.0), "1", "waves of a curve that is drawn over one variable"),
    Limit("places", (3.0, 3.0, 3.0), "1", "clearest places at which a shape in place of doubtful names is looked for"),
)


def limit(name: str, kind: Kind) -> float:
    """One limit of a kind. Raises KeyError for a name or a kind that the table does not have."""
    value = next((one.values[KINDS.index(kind)] for one in TABLE if one.name == name), None)
    if value is None:
        raise KeyError(f"no limit {name!r} of {kind}")
    return value
