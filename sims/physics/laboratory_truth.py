"""World-file tables of any laboratory: sensors, sources and reference standards by formulas."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from rig.sims.physics.expression import Formula
from rig.sims.physics.fields import Number, WorldError, accepts, quantity, read_table

ANY = "any"
"""Axis, among those of `sensor_axes`, of a sensor of any laboratory."""


@dataclass(frozen=True)
class Text:
    """A text that is a formula; its variables are checked with the bench."""

    def read(self, value: object, where: str, axes: Mapping[str, str]) -> str:
        """The checked value."""
        if not isinstance(value, str):
            raise WorldError(f"{where} must be a formula in quotes (it is {value!r})")
        Formula.parse(value or "0", where)
        return value


@dataclass(frozen=True)
class Name:
    """The name of a factor; it is checked with the bench."""

    def read(self, value: object, where: str, axes: Mapping[str, str]) -> str:
        """The checked value."""
        if not isinstance(value, str) or not value:
            raise WorldError(f"{where} must be the name of a factor (it is {value!r})")
        return value


@dataclass(frozen=True)
class AnySensorTruth:
    """A sensor of any laboratory: `[sensors.NAME]`, NAME as on the bench.

    Attributes:
        formula: its output, in the unit on the bench, from true values of factors; "" for a small one that grows with
            their sum.
        hidden: what its declared model may lack, in the same unit and from the same variables, added to it.
        noise: standard deviation of a mean over 1 s; over t seconds it is this divided by sqrt(t).
    """

    formula: str = field(default="", metadata=accepts(Text()))
    hidden: str = field(default="", metadata=accepts(Text()))
    noise: float = quantity(1e-5, 0.0, 1e9)


@dataclass(frozen=True)
class SourceTruth:
    """A factor as a source or a person sets it: `[sources.FACTOR]`.

    Attributes:
        formula: the true value, from the value `set`; "" for exactly that.
        time_constant_s: of its approach; a person's setting is there at once. Without it, that of the instrument in
            the bench file; else 480 for degC, 0.5 for other units.
        rest: the value before the first setting, and with the output off; without it 0, for degC the laboratory's mean
            temperature.
    """

    formula: str = field(default="", metadata=accepts(Text()))
    time_constant_s: float | None = field(default=None, metadata=accepts(Number(0.0, 1e6)))
    rest: float | None = field(default=None, metadata=accepts(Number(-1e9, 1e9)))


@dataclass(frozen=True)
class LagTruth:
    """A memory of a factor: `[lags.NAME]`, a variable of formulas.

    It is the difference between a first-order lag and the factor, zero after a long rest: creep, thermal lag.

    Attributes:
        of: the factor.
        time_constant_s: of the lag.
    """

    of: str = field(default="", metadata=accepts(Name()))
    time_constant_s: float = quantity(300.0, 1e-3, 1e7)


@dataclass(frozen=True)
class DrawTruth:
    """An error of each setting of a factor: `[draws.NAME]`, a variable of formulas.

    It is drawn anew whenever the factor is set, also to the same value: how a fixture sits, where a valve stops.

    Attributes:
        of: the factor.
        sd: its standard deviation.
    """

    of: str = field(default="", metadata=accepts(Name()))
    sd: float = quantity(1.0, 0.0, 1e9)


@dataclass(frozen=True)
class StandardTruth:
    """A reference standard: `[references.FACTOR]`.

    Attributes:
        formula: reading of its channel, from true values of factors; "" for the one that the formula of the bench file
            makes the factor. Of a quantity that a factor sets in another unit (`of` in the bench file) it is the true
            value, from those of factors; "" for the number that was set.
        error: how much more it reads, from true values of factors; in the unit of `formula`, or of the factor if that
            is "" or of a quantity with `of`. "" for none.
        noise: standard deviation of a mean over 1 s.
    """

    formula: str = field(default="", metadata=accepts(Text()))
    error: str = field(default="", metadata=accepts(Text()))
    noise: float = quantity(0.0, 0.0, 1e9)


@dataclass(frozen=True)
class Tables:
    """Tables with names of their own, `[KEY.NAME]`, each of one class."""

    table: type

    def read(self, value: object, where: str, axes: Mapping[str, str]) -> Mapping[str, Any]:
        """The checked value."""
        if not isinstance(value, Mapping):
            raise WorldError(f"{where} must be tables, [{where}.NAME]")
        return {str(name): read_table(self.table(), one, f"{where}.{name}", axes) for name, one in value.items()}
