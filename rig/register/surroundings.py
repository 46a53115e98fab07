"""Conditions under which the certificates of equipment hold, and what tells of them where the equipment stands.

A standard stands in the room unless the register says otherwise; a chamber in which an item stands is not the room. So
only thermometers, hygrometers and barometers of the same place count, and nothing is taken for them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from rig.bench.config import ROOM, BenchConfig
from rig.errors import ConfigurationError
from rig.fitter.arrays import FloatArray
from rig.procedures.column_names import spelled, stem_of, unit_of
from rig.procedures.plan.hand_steps import Made
from rig.procedures.tables.table import Columns
from rig.register.check import entries
from rig.register.equipment_file import PERCENT, Register
from rig.units.differences import factor
from rig.units.of_instruments import TEMPERATURE_UNIT

_SLACK = 1e-3
"""Share of the range that readings may go beyond it: as for the ranges of certificates."""
BY_HAND, STATED = "a person in the run", "the laboratory's own record"
"""What tells of a condition that no column has."""
Range = tuple[float, float]


@dataclass(frozen=True)
class KnownConditions:
    """Knowledge of the surroundings of equipment beside the thermometers of the bench.

    Attributes:
        by_hand: numbers that a person stated in the run, by name with unit.
        stated: lowest and highest value in the room by the laboratory's own records, by name with unit.
    """

    by_hand: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    stated: Mapping[str, Range] = field(default_factory=dict)


@dataclass(frozen=True)
class Holds:
    """A condition under which the certificate of a piece of equipment on a bench holds.

    Attributes:
        asset: its asset number.
        certificate: number of its certificate.
        quantity: of the condition, with its unit.
        low: its lowest value.
        high: its highest.
        place: where the equipment stands: `ROOM`, another place of the bench, or a column.
    """

    asset: str
    certificate: str
    quantity: str
    low: float
    high: float
    place: str

    @property
    def label(self) -> str:
        """The quantity without its unit."""
        return stem_of(self.quantity).replace("_", " ")

    @property
    def words(self) -> str:
        """The condition, for messages: `temperature 18 to 28 degC`."""
        return f"{self.label} {self.low:g} to {self.high:g} {spelled(unit_of(self.quantity))}"

    @property
    def by_hand(self) -> frozenset[str]:
        """Name of a number that a person may state of it in a run: in the room alone."""
        return frozenset({self.quantity}) if self.place == ROOM else frozenset()

    def not_recorded(self, at: str = "") -> str:
        """That nothing tells of it, a sentence.

        Args:
            at: which run, in brackets; "" for the only one.
        """
        shown = f"{self.label} {self.low:g} to {self.high:g} {shown_unit(self.quantity)}"
        return f"Conditions of the certificate of {self.asset}, {shown}: not recorded in this run{at}."

    def columns(self, config: BenchConfig) -> list[str]:
        """Columns that record the quantity where the equipment stands."""
        placed = [name for name, one in config.temperatures.items() if one.place == self.place]
        return [name for name in dict.fromkeys((*placed, self.place)) if self._alike(name) is not None]

    def _alike(self, name: str) -> float | None:
        """Number of this condition's units in one unit of a column; None if it is another sort of quantity."""
        own, other = unit_of(self.quantity), unit_of(name)
        if TEMPERATURE_UNIT in (own, other):  # K and degF have another zero
            return 1.0 if own == other else None
        return 1.0 if own in PERCENT and other in PERCENT else factor(other, own)

    def sources(self, config: BenchConfig, columns: Columns, told: KnownConditions) -> dict[str, FloatArray]:
        """Values of all that tells of the quantity, in its unit, by what it is; readings that are missing are NaN."""
        found: dict[str, FloatArray] = {}
        for name in self.columns(config):
            if name in columns and np.isfinite(columns[name]).any():
                found[name] = np.asarray(columns[name]) * (self._alike(name) or 1.0)
        for name in self.by_hand & told.by_hand.keys():
            found[BY_HAND] = np.array(told.by_hand[name])
        for name, ends in told.stated.items() if self.place == ROOM else ():
            if (per := self._alike(name)) is not None:
                found[STATED] = np.array(ends) * per
        return found

    def outside(self, values: FloatArray) -> int:
        """How many of some values are not permitted."""
        slack = _SLACK * (self.high - self.low)
        return int(np.sum((values < self.low - slack) | (values > self.high + slack)))


def holds_of(register: Register, config: BenchConfig) -> Iterator[Holds]:
    """Conditions under which the certificates of the equipment on a bench hold, as the register states them."""
    for asset in dict.fromkeys(entry.asset for _, entry in entries(config)):
        known = register.equipment.get(asset)
        if known is not None and known.certificate is not None:
            for quantity, ends in (known.certificate.holds_at or {}).items():
                yield Holds(asset, known.certificate.number, quantity, *ends, known.stands_in)


def stated_by_hand(steps: Sequence[Made]) -> Mapping[str, tuple[float, ...]]:
    """Numbers that a person stated in a run, as in `Told.by_hand`."""
    found: dict[str, tuple[float, ...]] = {}
    for one in steps:
        if one.number is not None:
            found[one.value] = (*found.get(one.value, ()), one.number)
    return found


def check_surroundings(
    register: Register, config: BenchConfig, columns: Columns, told: KnownConditions, where: str
) -> None:
    """Refuse certificates of equipment that stood outside the conditions under which they hold.

    Args:
        register: the register.
        config: the bench.
        columns: of the run, or as a plan sets them.
        told: what else is known.
        where: name of the register's file, for messages.

    Raises:
        ConfigurationError: with a line for each condition.
    """
    found = []
    for one in holds_of(register, config):
        for name, values in one.sources(config, columns, told).items():
            if beyond := one.outside(values):
                low, high = float(np.nanmin(values)), float(np.nanmax(values))
                count = f", outside in {beyond} of {len(values)} observations" if name in columns else ""
                found.append(
                    f"{where}: equipment.{one.asset}.certificate.holds_at: the certificate holds at {one.words}, and "
                    f"by {name} it goes from {low:g} to {high:g}{count}: name a certificate that holds there, or "
                    "measure again within it"
                )
    if found:
        raise ConfigurationError("\n".join(found))


def shown_unit(name: str) -> str:
    """Unit of a column, for people."""
    unit = spelled(unit_of(name))
    return "%" if unit in PERCENT else unit.replace(TEMPERATURE_UNIT, "\N{DEGREE SIGN}C")
