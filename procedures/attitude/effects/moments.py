"""Times of a run at which something changes: interruptions, starts of replications, or searched ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.effects.scene import Scene

SEARCHED = 64
"""Number of times tried over a run; a found one is then placed between two observations."""


@dataclass(frozen=True)
class Moment:
    """A time of a run.

    Attributes:
        name: "from block 2", "from replication 3" or "from 4.251 h".
        field: of the data, compared with it.
        value: of the field from which it has passed.
    """

    name: str
    field: str
    value: float

    def passed(self, scene: Scene) -> FloatArray:
        """(n,) one for observations after the time, zero before."""
        return np.asarray(getattr(scene.data, self.field) >= self.value, np.float64)


def blocks(data: AttitudeData) -> tuple[Moment, ...]:
    """Every recorded interruption."""
    return tuple(Moment(f"from block {block}", "block", float(block)) for block in np.unique(data.block)[1:])


def starts(data: AttitudeData) -> tuple[Moment, ...]:
    """Every recorded interruption, and the start of every replication but the first."""
    return (*blocks(data), *boundaries(data))


def boundaries(data: AttitudeData) -> tuple[Moment, ...]:
    """The start of every replication but the first: between two of them something is likeliest to be touched."""
    return tuple(Moment(f"from replication {r}", "replicate", float(r)) for r in data.replicates[1:])


def evenly(data: AttitudeData, count: int = SEARCHED) -> tuple[Moment, ...]:
    """`count` moments spread evenly over the observations."""
    between = _between(data)
    at = np.linspace(0, between.size, count + 2)[1:-1]
    return tuple(_at(t) for t in dict.fromkeys(between[at.astype(np.int64)].tolist()))


def near(data: AttitudeData, moment: Moment, count: int = SEARCHED) -> tuple[Moment, ...]:
    """Every moment between two observations, closer to one of `count` searched ones than its neighbours."""
    between = _between(data)
    middle, reach = int(np.searchsorted(between, moment.value)), between.size // (count + 1) + 1
    return tuple(_at(t) for t in between[max(middle - reach, 0) : middle + reach + 1].tolist())


def at_boundary(data: AttitudeData, moment: Moment) -> Moment | None:
    """The start of the replication that begins at a moment between two observations; None within a replication.

    None too where replications do not follow one another in time.
    """
    before = data.elapsed_s < moment.value
    if moment.field != "elapsed_s" or np.all(before) or not np.any(before):
        return None
    last, first = float(np.max(data.replicate[before])), float(np.min(data.replicate[~before]))
    return Moment(f"from replication {first:g}", "replicate", first) if last < first else None


def _between(data: AttitudeData) -> FloatArray:
    at = np.unique(data.elapsed_s)
    return np.asarray((at[1:] + at[:-1]) / 2)


def _at(elapsed_s: float) -> Moment:
    return Moment(f"from {elapsed_s / 3600.0:.3f} h", "elapsed_s", elapsed_s)
