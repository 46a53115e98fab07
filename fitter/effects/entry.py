"""What every catalogue says of an effect: its physical cause, where it varies, its size, its known aliases."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from fitter.effects.sizes import Size

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
        separate_by: the measurement that would tell the two apart.

    """

    when: str
    separate_by: str


@dataclass(frozen=True)
class Signed:
    """The sign that physics leaves the coefficients of an effect.

    Attributes:
        quantity: what would have to be negative: "compliance", "backlash".
        where: for each term that has one, by name, the sign of its coefficient where the quantity is positive; a term
            that is not named may have either. A number holds for all terms.
        otherwise: what a negative value would take, for who reads that it was refused; "" if
            nothing is known that does it.

    """

    quantity: str
    where: Mapping[str, int] | int
    otherwise: str

    def of(self, term: str) -> int:
        """+1 or -1, or 0 where either is possible."""
        return self.where if isinstance(self.where, int) else self.where.get(term, 0)


@dataclass(frozen=True)
class Largest:
    """The most that a coefficient of an effect can plausibly be; what needs more has another cause.

    Attributes:
        value: in the unit of the terms; of the sensitivity where `relative`.
        text: the same for people: "1 deg".
        relative: whether it is a part of the sensor's sensitivity.

    """

    value: float
    text: str
    relative: bool = False

    def of(self, sensitivity: float) -> float:
        """In the unit of the terms, for a sensor."""
        return self.value * abs(sensitivity) if self.relative else self.value


@dataclass(frozen=True)
class Entry:
    """What every catalogue says of an effect, whatever kind of run it is looked for in.

    Attributes:
        name: as reported.
        cause: what happens physically.
        source: what it comes from; effects of different sources are told apart by changing one of them.
        scope: "package", "line" or "voltmeter" if one cause moves all sensors together (one coefficient for all),
            "sensor" if each sensor has its own coefficient.
        stratum: where it varies when the order of the run is balanced. Pitch-roll: between the points of the design,
            or point by replication, that is with time, temperature or direction. Whole plots: from one whole plot to
            the next, or within them.
        unit: of the reported coefficients.
        size: the same in the terms of who works on the bench.
        against: the field of the data its residual is best looked at against.
        separate_by: the measurement that would confirm it, or tell it from what is not among the known aliases.
        usual_size: what instruments of this kind show.
        known_aliases: effects that are confounded with it on common designs.
        own: whether a laboratory added it: of what it looks like only its own entry knows.
        signed: the sign that its coefficients have physically; None where either is possible.
        largest: size beyond which it is no explanation; None where none is known.

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
    known_aliases: Mapping[str, Alias]
    own: bool = field(default=False, kw_only=True)
    signed: Signed | None = field(default=None, kw_only=True)
    largest: Largest | None = field(default=None, kw_only=True)

    def sign(self, term: str) -> int:
        """Sign of a term's coefficient, +1 or -1; 0 where either is possible."""
        return 0 if self.signed is None else self.signed.of(term)
