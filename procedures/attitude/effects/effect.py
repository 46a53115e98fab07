"""Effects: a physical cause, and the columns it adds to the model of each sensor."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.effects.entry import Entry
from rig.fitter.effects.manual_changes import ByHand
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.effects.manual_changes import FAMILIES
from rig.procedures.attitude.effects.scene import Scene

Column = Callable[[Scene, str], FloatArray]


@dataclass(frozen=True)
class Term:
    """One column of an effect.

    Attributes:
        name: unique within its effect.
        column: (n,) volts for a coefficient of one, for a given sensor.
        shown: for a given sensor, the term as a formula and the factor from the coefficient to that formula's, in the
            effect's unit; by default the name is the formula and the factor is one.
        group: terms of one effect with the same group are judged together, such as sine and cosine of one frequency; a
            term without one is judged separately.
        finer: for a column with a searched constant: groups of terms with values near this one, closer than in the
            catalogue.
        part: ordinal in its group; terms of several values of one constant correspond by it.
        likelier: whether its constant is likelier beforehand than its neighbours: a boundary between replications.
    """

    name: str
    column: Column
    shown: Callable[[Scene, str], tuple[str, float]] | None = None
    group: str = ""
    finer: Callable[[AttitudeData], tuple[tuple[Term, ...], ...]] | None = None
    part: int = 0
    likelier: bool = False

    def as_formula(self, scene: Scene, sensor: str) -> tuple[str, float]:
        """Formula and factor for one sensor; for a turned package the name, since formulas are in angles of
        the head.
        """
        text, factor = self.shown(scene, sensor) if self.shown else (self.name, 1.0)
        return (text, factor) if scene.data.mounting is None else (self.name, factor)


@dataclass(frozen=True)
class Effect(Entry):
    """An entry of the attitude catalogue. A new effect of the tracer is a new entry.

    Attributes:
        terms: its columns for given observations (an effect may have one per interruption).
        needs: requirements on the observations: keys of `PREREQUISITES`.
        searched: whether its terms are alternatives for values of a searched constant. The value counts as a
            coefficient in comparisons with other effects.
    """

    terms: Callable[[AttitudeData], tuple[Term, ...]]
    needs: tuple[str, ...] = ()
    searched: bool = False

    @property
    def by_hand(self) -> tuple[ByHand, ...]:
        """Influences of changes by a person; without an entry of its own, those of its family. Nothing is known of a
        laboratory's own effects.
        """
        families = {} if self.own else FAMILIES
        return families.get(self.source, ()) if self.manual_changes is None else self.manual_changes

    def applies_to(self, data: AttitudeData) -> bool:
        """Whether these observations meet the requirements of the effect."""
        return all(PREREQUISITES[need](data) for need in self.needs)


PREREQUISITES: Mapping[str, Callable[[AttitudeData], bool]] = {
    "roll": lambda data: data.has_roll,
    "temperature": lambda data: (
        data.sensor_temperature_degC is not None and bool(np.ptp(data.sensor_temperature_degC) > 1e-3)
    ),
    "time": lambda data: bool(np.ptp(data.elapsed_s) > 0),
    "pitch sides": lambda data: bool(np.ptp(data.pitch_side) > 0),
    "roll sides": lambda data: bool(np.ptp(data.roll_side) > 0) and data.has_roll,
    "blocks": lambda data: bool(np.ptp(data.block) > 0),
    "starts": lambda data: data.replicates.size > 1 or bool(np.ptp(data.block) > 0),
    "replications": lambda data: data.replicates.size > 1,
    "several sensors": lambda data: len(data.sensors) > 1,
    "a night": lambda data: bool(np.ptp(data.elapsed_s) > 6 * 3600.0),
}


def fixed(*terms: Term) -> Callable[[AttitudeData], tuple[Term, ...]]:
    """Terms that are the same for all observations."""
    return lambda _data: terms
