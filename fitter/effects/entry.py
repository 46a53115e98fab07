"""Common properties of effects in all catalogues: physical cause, stratum, size, known aliases."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from rig.fitter.effects.manual_changes import ByHand, Influence
from rig.fitter.effects.sizes import Size

Stratum = Literal["between-point", "point-by-replication", "replication", "whole-plot", "subplot", "noise"]


Source = Literal[
    "package",
    "pitch axis",
    "roll axis",
    "line",
    "chamber",
    "temperature",
    "time",
    "interruption",
    "sensor",
    "setting",
    "covariate",
    "group",
    "direction",
    "voltmeter",
]


Scope = Literal["package", "line", "voltmeter", "sensor"]


@dataclass(frozen=True)
class Alias:
    """Another effect that is confounded with it.

    Attributes:
        when: on which designs, in which sensors.
        separate_by: the measurement that would separate the two.
    """

    when: str
    separate_by: str


@dataclass(frozen=True)
class Signed:
    """The physically possible sign of the coefficients of an effect.

    Attributes:
        quantity: quantity that would have to be negative: "compliance", "backlash".
        where: sign of the coefficient for a positive quantity, for each term by name; other terms may have either sign.
            A number holds for all terms.
        otherwise: what a negative value would require, for readers of a refusal; "" if nothing is known.
    """

    quantity: str
    where: Mapping[str, int] | int
    otherwise: str

    def of(self, term: str) -> int:
        """+1 or -1, or 0 if both are possible."""
        return self.where if isinstance(self.where, int) else self.where.get(term, 0)


@dataclass(frozen=True)
class Largest:
    """The largest plausible coefficient of an effect; a larger one has another cause.

    Attributes:
        value: in the unit of the terms; of the sensitivity if `relative`.
        text: the same for people: "1 deg".
        relative: whether it is relative to the sensor's sensitivity.
    """

    value: float
    text: str
    relative: bool = False

    def of(self, sensitivity: float) -> float:
        """In the unit of the terms, for one sensor."""
        return self.value * abs(sensitivity) if self.relative else self.value


@dataclass(frozen=True)
class Entry:
    """Common properties of an effect, for any kind of run.

    Attributes:
        name: as reported.
        cause: the physical mechanism.
        source: its physical source; effects of different sources are separated by changing one of them.
        scope: "package", "line" or "voltmeter" if one cause affects all sensors together (one coefficient for all),
            "sensor" if each sensor has its own coefficient.
        stratum: stratum of its variation in a balanced run. Pitch-roll: between the points of the design, or point by
            replication, that is with time, temperature or direction. Whole plots: between whole plots, or within them.
        unit: of the reported coefficients.
        size: the size in the terms of people at the bench.
        against: field of the data for a plot of its residual.
        separate_by: the measurement that would confirm it, or separate it from effects that are not known aliases.
        usual_size: usual size for instruments of this kind.
        known_aliases: effects that are confounded with it on common designs.
        own: whether a laboratory added it: only its own entry knows its aliases.
        signed: the physical sign of its coefficients; None if both are possible.
        largest: size beyond which it is not an explanation; None if unknown.
        dynamic: whether its size depends on the order of the settings and on how long they are held.
        manual_changes: influences of changes by a person; None: those of its family, if its kind has families.
        history: number of the laboratory's earlier calibrations in which a further run confirmed it, and of all; None
            without a declared history.
    """

    name: str
    cause: str
    source: Source
    scope: Scope
    stratum: Stratum
    unit: str
    size: Size
    against: str
    separate_by: str
    usual_size: str
    known_aliases: Mapping[str, Alias] = field(default_factory=dict, kw_only=True)
    own: bool = field(default=False, kw_only=True)
    signed: Signed | None = field(default=None, kw_only=True)
    largest: Largest | None = field(default=None, kw_only=True)
    dynamic: bool = field(default=False, kw_only=True)
    manual_changes: tuple[ByHand, ...] | None = field(default=None, kw_only=True)
    history: tuple[int, int] | None = field(default=None, kw_only=True)

    @property
    def by_hand(self) -> tuple[ByHand, ...]:
        """Influences of changes by a person; without an entry of its own, those of its family."""
        return self.manual_changes or ()

    def influence(self, word: str) -> Influence | None:
        """Influence of the change of this word; None if it stays as it is."""
        return next((one.influence for one in self.by_hand if one.change.word == word), None)

    def sign(self, term: str) -> int:
        """Sign of a term's coefficient, +1 or -1; 0 if both are possible."""
        return 0 if self.signed is None else self.signed.of(term)
