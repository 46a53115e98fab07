"""Factors of a procedure of kind "general": levels, order, whether hard to change, and when a setting has arrived.

A further factor is a `[factors.NAME]` table of a procedure, and no code.
"""

from __future__ import annotations

import itertools
from collections.abc import Collection
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from rig.procedures.column_names import stem_of
from rig.procedures.plan.run_list import Factor, Settle
from rig.procedures.plan.settings import Positive, Strict

DEGC = "_degC"
"""End of the names of temperatures."""
RANDOM, UP_DOWN, AS_WRITTEN = "random", "up-down", "as written"
FACTOR_NAME = r"^[A-Za-z][A-Za-z0-9_]*_[A-Za-z][A-Za-z0-9]*$"
"""A factor ends in its unit, as a column of a table does."""

HEAD_ANGLES = ("pitch_deg", "roll_deg")
"""Angles of a dividing head: these have a side of approach also if they are hard to change."""

_NEAR = 0.25
"""Default of `near`, as a fraction of `tolerance`: readings scatter inside the rest of it."""
_BAND, _TOLERANCE = 1e-3, 0.02
"""Defaults of `band` and `tolerance`, as fractions of the range of the levels."""


class FactorSettings(Strict):
    """One `[factors.NAME]` table; the end of NAME is its unit, as in tables: `force_kN`."""

    levels: Annotated[list[float], Field(min_length=1, max_length=10_000)] | None = Field(
        None,
        description="settings of a grid, each once; the candidates of an optimal design; their extremes are those of a "
        "central composite design; not used with a file of points",
    )
    order: Literal["random", "up-down", "as written"] = Field(
        "random",
        description="up-down: from the lowest level to the highest and back, the highest once; as written: as in "
        "`levels`, or step by step as the rows of the file of points. The side of approach is planned and recorded",
    )
    hard: bool = Field(
        False, description="hard to change: its settings are whole plots, settled first, and in its order"
    )
    overtravel: Positive | None = Field(
        None,
        description="after an interruption an instrument first goes beyond by this much, to arrive from the planned "
        "side; left out: half the smallest step between its levels",
    )
    band: Positive | None = Field(
        None, description="settled within this of the setpoint; left out: a thousandth of the range of its levels"
    )
    drift_per_s: Positive | None = Field(
        None, description="and drifting slower than this, a second; left out: the band in one dwell"
    )
    tolerance: Positive | None = Field(
        None,
        description="largest difference from the setpoint of a reference standard's reading, or of the value that a "
        "person states; left out: a fiftieth of the range of its levels",
    )

    near: Positive | None = Field(
        None,
        description="of levels that a reference standard reads, with a table of approach: how near a level its reading "
        "is brought; left out: a quarter of `tolerance`",
    )

    @model_validator(mode="after")
    def _levels_differ(self) -> Self:
        levels = self.levels or []
        if len(set(levels)) != len(levels):
            twice = next(level for at, level in enumerate(levels) if level in levels[:at])
            raise ValueError(f"levels has {twice:g} twice; replications repeat all of them, and `points` any of them")
        return self

    def named(self, name: str, settings: Collection[float]) -> Factor:
        """The factor of a run list that visits these settings. Its axis is the name without the unit."""
        steps = [b - a for a, b in itertools.pairwise(sorted(set(settings)))]
        beyond = self.overtravel or min(steps, default=0.0) / 2.0
        return Factor(name, stem_of(name), beyond, hard=self.hard)

    def settle(self, span: float, dwell_s: float, timeout_s: float) -> Settle:
        """Criterion of its arrival; `span` is the range of its settings."""
        band = self.band or _BAND * (span or 1.0)
        return Settle(band, dwell_s, self.drift_per_s or band / max(dwell_s, 1.0), timeout_s)

    def tolerated(self, span: float) -> float:
        """Largest difference of a reference's reading from the setpoint."""
        return self.tolerance or _TOLERANCE * (span or 1.0)

    def nearness(self, span: float) -> float:
        """How near a level the reading of a reference is brought."""
        return self.near or _NEAR * self.tolerated(span)
