"""Additions of a laboratory to the catalogues: effects of its own, and how often it found which effect."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TypeVar

from rig.fitter.effects.entry import Entry

Own = TypeVar("Own", bound=Entry)


@dataclass(frozen=True)
class History:
    """In how many of a laboratory's earlier calibrations a further run confirmed each effect.

    Attributes:
        calibrations: all that had a further run.
        confirmed: number of these by name of the effect; 0 for any other name.
    """

    calibrations: int = 0
    confirmed: Mapping[str, int] = field(default_factory=dict)

    def of(self, entry: Own) -> Own:
        """The entry with its part of this history; the entry itself without any."""
        if not self.calibrations:
            return entry
        return replace(entry, history=(self.confirmed.get(entry.name, 0), self.calibrations))


@dataclass(frozen=True)
class Laboratory:
    """Additions of a laboratory to the catalogues of all kinds of calibration.

    Attributes:
        effects: its own effects, of any kind.
        history: how often it found which effect.
    """

    effects: tuple[Entry, ...] = ()
    history: History = field(default_factory=History)


NOTHING = Laboratory()


def nats(entry: Entry) -> float:
    """Logarithm of the probability of an effect by the laboratory's history; 0.0 without one.

    The mean of the posterior of a share beside Jeffreys' prior: (confirmed + 1/2) / (calibrations + 1).
    """
    if entry.history is None:
        return 0.0
    confirmed, calibrations = entry.history
    return math.log((confirmed + 0.5) / (calibrations + 1.0))
