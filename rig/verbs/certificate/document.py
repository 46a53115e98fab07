"""A calibration certificate as data, complete before anything is rendered.

Its numbers are texts, rounded by their uncertainty, because paper, page and XML must have the same digits. Beside them
are the unrounded numbers that they come from. The contents follow ISO/IEC 17025:2017, 7.8.2 and 7.8.4.
"""

from __future__ import annotations

import datetime
from collections.abc import Iterable
from dataclasses import dataclass, field, fields, is_dataclass
from math import isfinite
from typing import Any, Literal

from rig.verbs.certificate.measured import Budget, Effect, ResultTable, Stage, Statement


@dataclass(frozen=True)
class Party:
    """A laboratory or a customer.

    Attributes:
        name: of the organisation.
        address: lines.
        country: two letters of ISO 3166-1; "" if unknown.
        email: address; "" for none.
        phone: number; "" for none.
    """

    name: str
    address: tuple[str, ...]
    country: str = ""
    email: str = ""
    phone: str = ""


@dataclass(frozen=True)
class Logo:
    """A picture, as the bytes of its file."""

    data: bytes = field(repr=False)
    kind: Literal["svg", "png", "jpg"]


@dataclass(frozen=True)
class Laboratory:
    """Who issues the certificate.

    Attributes:
        party: name and address.
        accreditation: number and body of its accreditation; "" if it has none.
        logo: its own; None if it has none.
    """

    party: Party
    accreditation: str = ""
    logo: Logo | None = None


@dataclass(frozen=True)
class Item:
    """A sensor under calibration.

    Attributes:
        name: as in the run file and in tables.
        description: what it is.
        maker: manufacturer.
        model: of the manufacturer.
        serial: serial number.
        asset: the laboratory's number for it; "" if it has none.
        customer_id: the customer's number for it; "" if it has none.
        condition: as received.
        from_customer: which of `maker`, `model` and `serial` the customer stated.
    """

    name: str
    description: str
    maker: str
    model: str
    serial: str
    condition: str
    asset: str = ""
    customer_id: str = ""
    from_customer: tuple[str, ...] = ()


@dataclass(frozen=True)
class Person:
    """Somebody who answers for the certificate."""

    name: str
    role: str


@dataclass(frozen=True)
class Dates:
    """Dates of the calibration; `received` is None if the items never left the customer."""

    received: datetime.date | None
    began: datetime.date
    ended: datetime.date
    issued: datetime.date


@dataclass(frozen=True)
class Method:
    """How the items were calibrated: a name, sentences, and standards or papers."""

    name: str
    sentences: tuple[str, ...] = ()
    references: tuple[str, ...] = ()


@dataclass(frozen=True)
class Condition:
    """A quantity recorded during the run; the numbers are rounded texts.

    Attributes:
        name: its column in the run's table, or "" if the laboratory states it by another record.
        label: for people.
        unit: of all three.
        minimum: smallest value.
        mean: of all accepted observations; "" if the laboratory states the others.
        maximum: largest value.
        stage: of the run.
    """

    name: str
    label: str
    unit: str
    minimum: str
    mean: str
    maximum: str
    stage: Stage = ""


@dataclass(frozen=True)
class Holding:
    """A condition under which the certificate of a piece of equipment holds, and what is known of it.

    Attributes:
        asset: the laboratory's number for the equipment.
        certificate: number of its certificate.
        label: of the quantity, for people.
        unit: of all numbers.
        limits: what the certificate permits: `18 to 28`.
        found: what it was: `20.12 to 21.40`; "" if nothing recorded it.
        by: what recorded it, and where; "" for nothing.
        stage: of the run.
    """

    asset: str
    certificate: str
    label: str
    unit: str
    limits: str
    found: str
    by: str
    stage: Stage = ""


@dataclass(frozen=True)
class External:
    """A result of an external provider, which is not of this laboratory (ISO/IEC 17025, 7.8.2.1 p).

    Attributes:
        sensor: `Item.name`.
        label: what it is.
        value: as the provider states it.
        unit: of value and uncertainty; "" for a plain number.
        expanded: expanded uncertainty; "" if the provider states none.
        k: its coverage factor; "" without an uncertainty.
        probability: its coverage probability; "" without an uncertainty.
        laboratory: the provider.
        accreditation: of the provider for it; "" for none.
        certificate: number of the provider's certificate.
        date: of that certificate.
        used_for: which results of this laboratory depend on it; "" if none do.
    """

    sensor: str
    label: str
    value: str
    unit: str
    expanded: str
    k: str
    probability: str
    laboratory: str
    accreditation: str
    certificate: str
    date: datetime.date
    used_for: str = ""


def by_source(results: Iterable[External]) -> dict[str, list[External]]:
    """Results by their source, as words: provider, accreditation, number and date of the certificate."""
    found: dict[str, list[External]] = {}
    for one in results:
        by = ", ".join(filter(None, (one.laboratory, one.accreditation)))
        found.setdefault(f"{by}: certificate {one.certificate} of {one.date.isoformat()}", []).append(one)
    return found


@dataclass(frozen=True)
class Supplied:
    """Data that the customer supplied (ISO/IEC 17025, 7.8.2.2).

    Attributes:
        subject: `Item.name`, asset number of a piece of equipment, or what else they are of.
        what: the data.
        value: as the customer stated it; "" where it stands elsewhere on the certificate.
        affects: what can depend on it; "" for nothing.
    """

    subject: str
    what: str
    value: str
    affects: Literal["", "results", "conformity"]


@dataclass(frozen=True)
class Equipment:
    """An instrument or standard that was used, and its own certificate.

    Attributes:
        name: what it is.
        maker: manufacturer.
        model: of the manufacturer.
        serial: serial number.
        asset: the laboratory's number for it.
        certificate: number of its certificate; "" if no result is traced to it.
        laboratory: that issued the certificate.
        date: of the certificate; None without one.
        due: date of its next calibration; None if there is none.
        accreditation: of that laboratory; "" if none is stated.
    """

    name: str
    maker: str
    model: str
    serial: str
    asset: str
    certificate: str
    laboratory: str
    date: datetime.date | None
    due: datetime.date | None
    accreditation: str = ""


@dataclass(frozen=True)
class Evidence:
    """The run file, or the table, that the numbers come from.

    Attributes:
        file: its name.
        run_id: of the run; "" for a table.
        head: hash of its last record; SHA-256 of a table.
        records: their number; 0 for a table.
        observations: accepted observations.
        began: date of the first record.
        ended: date of the last observation.
        version: of the program that writes the certificate.
        stage: as found or as left.
    """

    file: str
    run_id: str
    head: str
    records: int
    observations: int
    began: datetime.date
    ended: datetime.date
    version: str
    stage: Stage = ""


@dataclass(frozen=True)
class Amendment:
    """The certificate that this one replaces, and what changed.

    Attributes:
        number: of the replaced certificate.
        issued: its date of issue.
        changes: sentences.
        sha256: of its file.
        original: number of the first certificate, where the replaced one was an amendment; otherwise the same number.
        original_issued: its date of issue.
    """

    number: str
    issued: datetime.date
    changes: tuple[str, ...]
    sha256: str
    original: str
    original_issued: datetime.date

    @property
    def sentence(self) -> str:
        """Reference to the replaced certificate, and to the original (ISO/IEC 17025, 7.8.8.3)."""
        first = f"; the original is {self.original} of {self.original_issued}" if self.original != self.number else ""
        return f"It replaces certificate {self.number} of {self.issued}{first}."


@dataclass(frozen=True)
class Document:
    """A complete calibration certificate.

    Attributes:
        number: unique number of the certificate.
        simulated: whether no real instrument was involved.
        laboratory: who issues it.
        customer: whom it is for.
        items: sensors under calibration.
        place: where the calibration was made.
        dates: of the calibration and of issue.
        calibrated_by: who calibrated.
        approved_by: who approves and signs.
        method: of the calibration.
        conditions: measured during the run.
        equipment: with its traceability.
        tables: results.
        budgets: for the annex.
        statements: of conformity; () if none was asked for.
        effects: found beside the declared model.
        adjustment: between as found and as left; "" if none was made.
        deviations: from the procedure: skipped points, repeated whole plots, exchanged instruments.
        evidence: a run file each.
        amends: the certificate that this one replaces; None for a first one.
        next_due: date of the next calibration, only at the customer's wish.
        remarks: further sentences of the laboratory.
        paper: size of a page.
        opinions: interpretations that are no results of measurement.
        notes: on the uncertainties, sentences.
        models: the model of the results, where effects were found beside the declared one, sentences.
        holdings: conditions under which the certificates of the equipment hold.
        external: results of external providers.
        supplied: data that the customer supplied.
        unstated: facts about the equipment that the register does not state, sentences.
        unrecorded: conditions of the calibration of which nothing is recorded, sentences.
    """

    number: str
    simulated: bool
    laboratory: Laboratory
    customer: Party
    items: tuple[Item, ...]
    place: str
    dates: Dates
    calibrated_by: tuple[Person, ...]
    approved_by: Person
    method: Method
    conditions: tuple[Condition, ...]
    equipment: tuple[Equipment, ...]
    tables: tuple[ResultTable, ...]
    budgets: tuple[Budget, ...]
    evidence: tuple[Evidence, ...]
    statements: tuple[Statement, ...] = ()
    effects: tuple[Effect, ...] = ()
    adjustment: str = ""
    deviations: tuple[str, ...] = ()
    amends: Amendment | None = None
    next_due: datetime.date | None = None
    remarks: tuple[str, ...] = ()
    opinions: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    paper: Literal["a4", "letter"] = "a4"
    models: tuple[str, ...] = ()
    holdings: tuple[Holding, ...] = ()
    external: tuple[External, ...] = ()
    supplied: tuple[Supplied, ...] = ()
    unstated: tuple[str, ...] = ()
    unrecorded: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """JSON values of all but the logo, dates as YYYY-MM-DD; infinite numbers are None."""
        told: dict[str, Any] = _plain(self)
        return told


def _plain(value: Any) -> Any:
    """JSON values of a part of a document."""
    if isinstance(value, Logo):
        return {"kind": value.kind}
    if is_dataclass(value):
        return {one.name: _plain(getattr(value, one.name)) for one in fields(value)}
    if isinstance(value, tuple):
        return [_plain(one) for one in value]
    if isinstance(value, float) and not isfinite(value):
        return None
    return value.isoformat() if isinstance(value, datetime.date) else value
