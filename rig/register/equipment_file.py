"""The schema of `equipment.toml`: equipment, its certificates, the place, the laboratory, sensors under calibration.

Ideas of MSL's equipment register and of PTB's digital calibration certificate: a certificate makes statements, each a
correction with its uncertainty over a range. Every uncertainty is complete, or refused.
"""

from __future__ import annotations

import datetime
from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from rig.procedures.column_names import spelled, split_unit, stem_of, unit_of
from rig.procedures.evaluate.stated import BEHAVIOURS, Behaviour, Distribution
from rig.procedures.plan.settings import Name, Strict
from rig.units.differences import NOT_CELSIUS, factor, relative

Polynomial = Annotated[tuple[float, ...], Field(min_length=1, max_length=12)]
Amount = Annotated[float, Field(ge=0)]
Size = Amount | Annotated[tuple[Amount, ...], Field(min_length=1, max_length=12)]
"""A constant, or the coefficients of a polynomial in the magnitude of the quantity."""
PERCENT = ("pct", "percent", "%")
"""Units of quantities that are themselves percentages."""
Drift = Annotated[tuple[tuple[Amount, Amount], ...], Field(min_length=2, max_length=100)]
"""Rows [days since the calibration, error that is not exceeded with 95 %], as `rig chart --as-drift` prints them."""
_NUMBER = r"^-?\d+(\.\d+)?([eE][+-]?\d+)?$"
_UNITS = "unit of every number of it: the quantity's or another of its kind; `1`, `%` or `ppm` of the quantity's value"


class Uncertain(Strict):
    """An uncertainty, in one of three ways: `expanded` with `k` and `probability`, `standard`, or `half_width`."""

    expanded: Size | None = Field(None, description="expanded uncertainty; with `k` and `probability`")
    k: float | None = Field(None, gt=0, le=100, description="coverage factor of `expanded`")
    probability: float | None = Field(
        None, gt=0.5, lt=1, description="coverage probability of `expanded`; 95 % is 0.95, or 0.9545 where k = 2"
    )
    standard: Size | None = Field(None, description="standard uncertainty")
    half_width: Size | None = Field(
        None, description="limits of error, as a specification gives them: half of the full width"
    )
    distribution: Distribution | None = Field(
        None, description="with `half_width`: distribution between the limits; without it rectangular"
    )
    df: float | None = Field(
        None, ge=1, description="degrees of freedom; without it from `k` and `probability`, or infinite"
    )

    def _check_uncertainty(self, *, in_table: bool = False) -> None:
        ways = [name for name in ("expanded", "standard", "half_width") if getattr(self, name) is not None]
        if len(ways) > 1:
            raise ValueError(f"{' and '.join(ways)} give the uncertainty twice: leave one")
        if not ways and not in_table:
            raise ValueError(
                "the uncertainty is missing: add `expanded` with `k` and `probability`, or `standard`, or `half_width`"
            )
        if ways == ["expanded"] or in_table:
            if self.k is None:
                raise ValueError("an expanded uncertainty needs its coverage factor: add k, such as k = 2")
            if self.probability is None:
                raise ValueError(
                    f"k = {self.k:g} without a probability: add probability, such as 0.95, as the certificate says"
                )
        elif self.k is not None or self.probability is not None:
            raise ValueError(f"k and probability belong to `expanded`, and here is `{ways[0]}`: leave them out")
        if self.distribution not in (None, "normal") and ways != ["half_width"]:
            raise ValueError(f"distribution = {self.distribution!r} belongs to `half_width`: leave it out")
        if self.distribution == "normal" and ways == ["half_width"]:
            raise ValueError("a normal distribution has no half-width: give `standard`, or `expanded` with k")


class Statement(Uncertain):
    """One statement of a certificate or specification: the correction of a quantity, and its uncertainty.

    A reading plus the correction is the value. Correction and uncertainty may be constants or polynomials, or a table.
    """

    quantity: str = Field(
        min_length=1,
        description="of what: a column of tables, `bath_degC` (also with another prefix), or a unit for all columns in "
        "it, `V` or `m3_per_h`",
    )
    behaves: Behaviour = Field(
        "offset", description="; ".join(f"`{name}`: {words}" for name, words in BEHAVIOURS.items())
    )
    unit: str = Field(min_length=1, description=_UNITS)
    correction: float = Field(0.0, description="correction, to be added to readings")
    polynomial: Polynomial | None = Field(
        None, description="correction as a polynomial: coefficients of the quantity's powers 0, 1, 2, ..."
    )
    table: tuple[tuple[float, float, Amount], ...] | None = Field(
        None,
        min_length=2,
        description="rows [quantity, correction, expanded uncertainty], interpolated, with `k` and `probability`",
    )
    range: tuple[float, float] | None = Field(
        None, description="lowest and highest value of the quantity covered; without it, those of the table, or any"
    )
    meter_range: float | None = Field(None, gt=0, description="for this range of a meter only, in the quantity's unit")
    drift: Amount | Drift | None = Field(
        None,
        description="drift since the calibration; behaves as the statement: an allowance, the half-width of a "
        "rectangle, or by its history rows [days, error not exceeded with 95 %] of `rig chart --as-drift`",
    )
    resolution: Amount | None = Field(
        None, description="resolution of the indication; independent at every setting, rectangular"
    )

    @property
    def quantity_unit(self) -> str:
        """Unit of the quantity."""
        return self.quantity if self.of_unit else unit_of(self.quantity)

    @property
    def of_unit(self) -> bool:
        """Whether the quantity is a unit, such as `V`, `m3_per_h` or `m3/h`, and no column."""
        return "_" not in spelled(self.quantity)

    @property
    def covered(self) -> tuple[float, float] | None:
        """Range of the quantity covered, in its unit; None if it is not limited."""
        if self.range is not None:
            return self.range
        return None if self.table is None else (self.table[0][0], self.table[-1][0])

    @model_validator(mode="after")
    def _complete(self) -> Self:
        self._check_uncertainty(in_table=self.table is not None)
        if relative(self.unit) is None and factor(self.unit, self.quantity_unit) is None:
            raise ValueError(
                f"unit = {self.unit!r} does not convert to {self.quantity_unit}, the unit of {self.quantity}: use a "
                f"unit of the same kind, or 1, % or ppm of the value"
            )
        if self.unit == "%" and self.behaves != "gain" and self.quantity_unit in PERCENT:
            raise ValueError(
                f"unit = '%' of {self.quantity}, which is itself in percent, may be read in two ways: write "
                f"{self.quantity_unit!r} for points of {self.quantity}, or '1' or 'ppm' for a share of its value"
            )
        if self.behaves == "gain" and relative(self.unit) is None:
            raise ValueError(f"a gain is relative, and {self.unit} is not: give it in 1, % or ppm, or as an offset")
        if self.behaves == "turn" and relative(self.unit) is not None:
            raise ValueError(f"an error per turn is an angle, not {self.unit}")
        if sum((self.polynomial is not None, self.table is not None, self.correction != 0)) > 1:
            raise ValueError("the correction is given twice: leave one of correction, polynomial and table")
        if self.behaves in ("turn", "setting", "replication", "reading") and (
            self.correction or self.polynomial is not None or self.table is not None
        ):
            raise ValueError(f"an error that behaves as {self.behaves!r} has no correction: leave it out")
        if self.table is not None and any(b[0] <= a[0] for a, b in pairwise(self.table)):
            raise ValueError("table: the quantity has to increase from row to row")
        if isinstance(self.drift, tuple):
            _check_drift(self.drift)
        if self.range is not None and not self.range[0] < self.range[1]:
            raise ValueError(f"range: {self.range[0]:g} is not below {self.range[1]:g}")
        return self


def _check_drift(rows: Drift) -> None:
    if any(b[0] <= a[0] for a, b in pairwise(rows)):
        raise ValueError("drift: days have to increase from row to row")


class Certificate(Strict):
    """The certificate of a piece of equipment: number, dates, laboratory."""

    number: str = Field(min_length=1, description="number of the certificate")
    date: datetime.date
    due: datetime.date | None = Field(None, description="date on which the next calibration is due")
    laboratory: str = Field(min_length=1, description="laboratory that issued it")
    accreditation: str = Field("", description="its accreditation: body and number")
    holds_at: dict[str, tuple[float, float]] | None = Field(
        None,
        description="conditions around the equipment under which it holds, lowest and highest: `{ temperature_degC = "
        "[18, 28], humidity_pct = [20, 80] }`; `{}` if the certificate names none",
    )

    @model_validator(mode="after")
    def _conditions(self) -> Self:
        for name, (low, high) in (self.holds_at or {}).items():
            if not all(split_unit(name)):
                raise ValueError(f"holds_at: {name!r} has no unit at its end, such as temperature_degC")
            if unit_of(name) in NOT_CELSIUS:
                raise ValueError(f"holds_at: {name}: state a temperature in degC, as {stem_of(name)}_degC")
            if not low < high:
                raise ValueError(f"holds_at: {name}: {low:g} is not below {high:g}")
        return self

    @model_validator(mode="after")
    def _order(self) -> Self:
        if self.due is not None and self.due <= self.date:
            raise ValueError(f"due = {self.due} is not after date = {self.date}")
        return self


class Item(Strict):
    """Maker, model and serial number of a thing."""

    maker: str = ""
    model: str = ""
    serial: str = ""


class Equipment(Item):
    """A piece of equipment, by its asset number."""

    description: str = Field("", description="what it is, for people")
    stands_in: str = Field(
        "lab",
        min_length=1,
        description='where it stands, for `holds_at`: `lab` is the room, of thermometers with `place = "lab"`; else '
        "another place of the bench file's thermometers, or a column, such as `bath_degC`",
    )
    from_customer: str = Field(
        "", description="what of its data the customer supplied, such as `mass values`: results can depend on them"
    )
    certificate: Certificate | None = None
    says: tuple[Statement, ...] = Field(
        (), description="what its certificate, or its specification within the certificate's confirmation, says"
    )

    @model_validator(mode="after")
    def _traced(self) -> Self:
        if self.says and self.certificate is None:
            raise ValueError(
                "it says something of its errors, but has no certificate: add [equipment.ASSET.certificate]"
            )
        return self


PlaceName = Literal["gravity", "levelling", "line_head"]
PLACE_UNITS: dict[PlaceName, str] = {"gravity": "m/s2", "levelling": "deg", "line_head": "m"}
"""Constants of the place, and the units in which they are used."""


class Constant(Uncertain):
    """A constant of the place, with its uncertainty."""

    value: float
    unit: str = Field(min_length=1, description="unit of every number of it")
    source: str = Field("", description="where the value is from: a survey, a model, a measurement and its date")

    @model_validator(mode="after")
    def _complete(self) -> Self:
        self._check_uncertainty()
        return self


class Laboratory(Strict):
    """The laboratory that calibrates."""

    name: str = Field("", description="name of the laboratory")
    address: str = Field("", description="address, lines separated by newlines")
    accreditation: str = Field("", description="accreditation: body and number")
    calibrates: tuple[str, ...] = Field((), description="people who may calibrate")
    approves: tuple[str, ...] = Field((), description="people who may approve certificates")


class ExternalResult(Strict):
    """A result of an external provider about a sensor, printed as the provider states it, and as the provider's."""

    what: str = Field(min_length=1, description="what it is: `temperature coefficient of the output`")
    value: str = Field(pattern=_NUMBER, description='the number, as text with the digits of the provider: `"0.0210"`')
    unit: str = Field("", description="its unit; left out: a plain number")
    expanded: str = Field("", pattern=f"{_NUMBER}|^$", description="expanded uncertainty, as text")
    k: str = Field("", pattern=f"{_NUMBER}|^$", description="coverage factor of `expanded`, as text")
    probability: str = Field(
        "", pattern=r"^0\.\d+$|^$", description="coverage probability of `expanded`, as text: `0.95`"
    )
    laboratory: str = Field(min_length=1, description="the provider")
    accreditation: str = Field("", description="its accreditation for this result: body and number")
    certificate: str = Field(min_length=1, description="number of the provider's certificate")
    date: datetime.date = Field(description="date of that certificate")
    used_for: str = Field(
        "", description="results of this laboratory that depend on it: `outputs at 20 degC`; left out: none"
    )

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if len({bool(one) for one in (self.expanded, self.k, self.probability)}) > 1:
            raise ValueError("expanded, k and probability belong together: add what is missing, or leave out all three")
        return self


class CustomerDatum(Strict):
    """Something that the customer stated about a sensor, and that the laboratory did not verify."""

    what: str = Field(min_length=1, description="what it is: `mass of the loading head`, `sampling plan`")
    value: str = Field(min_length=1, description="as the customer stated it, with its unit")
    affects_results: bool = Field(
        True, description="whether results can depend on it: then the certificate has a disclaimer"
    )


class SensorItem(Item):
    """A sensor under calibration, by its name on the bench, or by its asset number there."""

    customer: str = Field("", description="name of the customer")
    customer_address: str = Field("", description="address of the customer, lines separated by newlines")
    received: datetime.date | None = Field(None, description="date on which it was received")
    condition: str = Field("", description="condition as received")
    from_customer: tuple[Literal["maker", "model", "serial"], ...] = Field(
        (), description="which of `maker`, `model` and `serial` the customer stated and nobody read from the sensor"
    )
    customer_data: tuple[CustomerDatum, ...] = Field((), description="what else the customer stated about it")
    external: tuple[ExternalResult, ...] = Field((), description="results of external providers about it")
    drift: Drift | None = Field(
        None, description="drift since its calibration, by its history: as `rig chart --as-drift` prints it"
    )
    drift_unit: str = Field("", description="unit of the errors of `drift`")

    @model_validator(mode="after")
    def _drift(self) -> Self:
        if self.drift is not None:
            _check_drift(self.drift)
        if (self.drift is not None) != bool(self.drift_unit):
            raise ValueError("drift and drift_unit belong together, as `rig chart --as-drift` prints them")
        return self


class Register(Strict):
    """A whole `equipment.toml`."""

    name: Name = Field("equipment", description="name of the register, for messages and reports")
    example: bool = Field(
        False,
        description="whether the values are examples, from public specifications; everything made from it says so",
    )
    laboratory: Laboratory = Laboratory()
    equipment: dict[str, Equipment] = Field(default_factory=dict)
    place: dict[PlaceName, Constant] = Field(default_factory=dict)
    sensors: dict[Name, SensorItem] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _place_units(self) -> Self:
        for name, constant in self.place.items():
            if factor(constant.unit, PLACE_UNITS[name]) is None:
                raise ValueError(
                    f"place.{name}: unit = {constant.unit!r} does not convert to {PLACE_UNITS[name]}: use another"
                )
            if name == "levelling" and constant.value != 0.0:
                raise ValueError(
                    f"place.levelling: value = {constant.value:g}: level the head, or correct its zero; its value is 0"
                )
            if isinstance(constant.expanded or constant.standard or constant.half_width, tuple):
                raise ValueError(f"place.{name}: the uncertainty of a constant is one number")
        return self
