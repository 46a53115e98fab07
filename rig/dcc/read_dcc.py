"""Reading digital calibration certificates, also those of others: versions 2 and 3, D-SI 1 and 2.

Numbers are found by their path of names, or by their `refType`. What a certificate does not say is None, never assumed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import date
from math import isfinite
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from rig.errors import UsageError
from rig.files.regular import open_regular
from rig.units.si import plain_unit

_MOST = 64 << 20


@dataclass(frozen=True)
class Number:
    """A value of a certificate.

    Attributes:
        value: in `unit`.
        unit: as tables have it, such as `kN/Pa`; as the certificate has it where that is unknown.
        expanded: expanded uncertainty in `unit`; None if the certificate gives none.
        k: its coverage factor; None if not given.
        probability: its coverage probability; None if not given.
        standard: standard uncertainty; from `expanded` and `k`, or as given; None if neither is.
    """

    value: float
    unit: str
    expanded: float | None = None
    k: float | None = None
    probability: float | None = None
    standard: float | None = None


@dataclass(frozen=True)
class Quantity:
    """Values of one quantity of a certificate, or a text.

    Attributes:
        path: names of result, lists and quantity, from outside to inside.
        ref_types: what the certificate calls it, such as `basic_measuredValue`.
        numbers: its values; () for a text.
        text: of a quantity without a value; "" otherwise.
        where: part of the certificate: "results", "conditions", "equipment", "statements" or "item".
    """

    path: tuple[str, ...]
    ref_types: tuple[str, ...]
    numbers: tuple[Number, ...]
    text: str = ""
    where: str = "results"

    @property
    def name(self) -> str:
        """The path as one text."""
        return " / ".join(self.path)


@dataclass(frozen=True)
class Read:
    """Contents of a digital calibration certificate.

    Attributes:
        file: its name.
        version: of its schema.
        number: its unique identifier.
        laboratory: who issued it.
        customer: whom it is for.
        items: name, maker, model and numbers of each item, as words.
        makers: maker, model and first number of each item.
        began: first day of the calibration; None if not given.
        ended: last day; None if not given.
        issued: day of issue; None if not given.
        quantities: all of its values, in order.
        statements: declarations, as words.
        untraceable: those of them that deny traceability; one "SIMULATED" if it is of a simulated run.
        conformity: words of conformity with what they are about.
        signatures: number of signatures in it; whether they hold is told by `rig.dcc.signature`.
    """

    file: str
    version: str
    number: str
    laboratory: str
    customer: str
    items: tuple[str, ...]
    makers: tuple[tuple[str, str, str], ...]
    began: date | None
    ended: date | None
    issued: date | None
    quantities: tuple[Quantity, ...]
    statements: tuple[str, ...]
    untraceable: tuple[str, ...]
    conformity: tuple[tuple[str, str], ...]
    signatures: int

    def find(self, where: str) -> Quantity:
        """A quantity of the results by the end of its path (`Calibration / error`), its name, or its refType.

        Several with one path and one refType, a value each, are the rows of one.

        Raises:
            UsageError: none or several match; the message lists them.
        """
        wanted = tuple(part.strip() for part in where.split(" / "))
        results = [one for one in self.quantities if one.where == "results" and one.numbers]
        found = [one for one in results if one.path[-len(wanted) :] == wanted or where in one.ref_types]
        rows = {(one.path, one.ref_types, len(one.numbers)) for one in found}
        if len(rows) == 1 and (len(found) == 1 or len(found[0].numbers) == 1):
            return replace(found[0], numbers=tuple(number for one in found for number in one.numbers))
        what = "several values" if found else "no value"
        listed = "; ".join(f"{one.name} ({', '.join(one.ref_types)})" for one in (found or results)[:12])
        raise UsageError(f"{self.file} has {what} {where!r}. It has: {listed or 'none'}")


def read_dcc(path: Path) -> Read:
    """Read a certificate.

    Raises:
        UsageError: the file cannot be read, or is no digital calibration certificate.
    """
    return parsed(bytes_of(path), str(path))


def bytes_of(path: Path) -> bytes:
    """Contents of the file of a certificate. Raises `UsageError`."""
    try:
        with open_regular(path) as file:
            read = file.read(_MOST + 1)
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror or error}") from error
    if len(read) > _MOST:
        raise UsageError(f"{path} is larger than {_MOST >> 20} MiB, which no certificate is")
    return read


class _NoDoctype(ET.TreeBuilder):
    """A document type could define entities, which grow without limit or name other files."""

    def doctype(self, name: str, pubid: str | None, system: str | None) -> None:
        raise UsageError("it declares a document type, which no certificate has")


def parsed(data: bytes, name: str) -> Read:
    """The certificate in the bytes of a file; errors as for `read_dcc`."""
    try:
        root = ET.fromstring(data, parser=ET.XMLParser(target=_NoDoctype()))
    except UsageError as error:
        raise UsageError(f"{name} is refused: {error}") from None
    except (ET.ParseError, ValueError, LookupError, RecursionError) as error:
        raise UsageError(f"{name} is not valid XML: {error}") from error
    if _local(root) != "digitalCalibrationCertificate":
        raise UsageError(f"{name} is no digital calibration certificate: its root is {_local(root)!r:.80}")
    core = _under(root, "administrativeData", "coreData")
    try:
        quantities, statements = tuple(_quantities(root)), tuple(_statements(root))
    except ValueError as error:
        raise UsageError(f"{name}: {error}") from error
    return Read(
        file=name,
        version=root.get("schemaVersion", ""),
        number=_text(_child(core, "uniqueIdentifier")),
        laboratory=_named(_under(root, "administrativeData", "calibrationLaboratory", "contact")),
        customer=_named(_under(root, "administrativeData", "customer")),
        items=tuple(_item(one) for one in _all(_under(root, "administrativeData", "items"), "item")),
        makers=tuple(_maker(one) for one in _all(_under(root, "administrativeData", "items"), "item")),
        began=_date(core, "beginPerformanceDate"),
        ended=_date(core, "endPerformanceDate"),
        issued=_date(core, "issueDate"),
        quantities=quantities,
        statements=tuple(told for told, _ in statements),
        untraceable=tuple(told for told, denies in statements if denies),
        conformity=tuple(_conformity(root)),
        signatures=sum(_local(one) == "Signature" for one in root),
    )


def _local(element: ET.Element) -> str:
    return str(element.tag).rpartition("}")[2]


def _child(element: ET.Element | None, name: str) -> ET.Element | None:
    return None if element is None else next((one for one in element if _local(one) == name), None)


def _all(element: ET.Element | None, name: str) -> list[ET.Element]:
    return [] if element is None else [one for one in element if _local(one) == name]


def _under(element: ET.Element, *names: str) -> ET.Element | None:
    found: ET.Element | None = element
    for name in names:
        found = _child(found, name)
    return found


def _text(element: ET.Element | None) -> str:
    return "" if element is None else " ".join((element.text or "").split())


def _content(element: ET.Element | None) -> str:
    """Its texts: in English where there is one, else without a language, else the first."""
    texts = _all(element, "content")
    by_language = {one.get("lang", ""): _text(one) for one in reversed(texts)}
    return by_language.get("en") or by_language.get("") or (_text(texts[0]) if texts else "")


def _named(element: ET.Element | None) -> str:
    return _content(_child(element, "name"))


def _date(element: ET.Element | None, name: str) -> date | None:
    try:
        return date.fromisoformat(_text(_child(element, name))[:10])
    except ValueError:
        return None


def _item(element: ET.Element) -> str:
    numbers = [_text(_child(one, "value")) for one in _all(_child(element, "identifications"), "identification")]
    parts = (_named(element), _named(_child(element, "manufacturer")), _text(_child(element, "model")), *numbers)
    return ", ".join(part for part in parts if part)


def _maker(element: ET.Element) -> tuple[str, str, str]:
    numbers = [_text(_child(one, "value")) for one in _all(_child(element, "identifications"), "identification")]
    return _named(_child(element, "manufacturer")), _text(_child(element, "model")), next(iter(numbers), "")


def _statements(root: ET.Element) -> Iterator[tuple[str, bool]]:
    """Words of each statement, and whether it says that something is not traceable."""
    for one in _all(_under(root, "administrativeData", "statements"), "statement"):
        told = ": ".join(part for part in (_named(one), _content(_child(one, "declaration"))) if part)
        if told:
            yield told, _text(_child(one, "traceable")) in ("false", "0")


def _conformity(root: ET.Element) -> Iterator[tuple[str, str]]:
    """Every statement of conformity anywhere in the certificate: its subject, and its word."""
    for one in root.iter():
        for name in ("conformity", "conformityXMLList"):
            if (verdict := _text(_child(one, name))) and _local(one) in ("statement", "metaData"):
                yield _named(one) or _content(_child(one, "declaration")) or "conformity", verdict


_PARTS = {
    "influenceConditions": "conditions",
    "measuringEquipments": "equipment",
    "items": "item",
    "statements": "statements",
    "measurementMetaData": "statements",
    "usedMethods": "methods",
    "relativeUncertainty": "relative",
}
_NAMED = ("result", "list", "influenceCondition", "measuringEquipment", "item", "statement", "metaData")
_QUANTITIES = ("quantity", "itemQuantity", "measuringEquipmentQuantity")


def _quantities(element: ET.Element, path: tuple[str, ...] = (), where: str = "results") -> Iterator[Quantity]:
    """All quantities below an element, in order."""
    for one in element:
        kind = _local(one)
        inside = _PARTS.get(kind, where)
        if kind in _QUANTITIES:
            here = (*path, _named(one) or one.get("refType", "") or kind)
            numbers = tuple(_numbers(one, here))
            text = "" if numbers else _content(_child(one, "noQuantity")) or _text(_child(one, "charsXMLList"))
            yield Quantity(here, tuple(one.get("refType", "").split()), numbers, text, inside)
            yield from _quantities(one, here, inside)
        else:
            name = _named(one) if kind in _NAMED else ""
            yield from _quantities(one, (*path, name) if name else path, inside)


def _numbers(quantity: ET.Element, path: tuple[str, ...]) -> Iterator[Number]:
    """Values of a quantity. Raises `ValueError` if a number is none."""
    for one in quantity:
        kind = _local(one)
        if kind == "hybrid":
            yield from _numbers(_most_si(one), path)
        elif kind in ("real", "constant"):
            yield _real(one, path)
        elif kind == "realListXMLList":
            yield from _real_list(one, path)
        elif kind in ("list", "realList"):
            yield from _numbers(one, path)


def _most_si(hybrid: ET.Element) -> ET.Element:
    """The form of a quantity in a unit of the SI brochure; its first form if there is none."""
    forms = [one for one in hybrid if not _unit(one).startswith("|")] or list(hybrid)
    chosen = ET.Element(hybrid.tag)
    chosen.extend(forms[:1])
    return chosen


def _unit(element: ET.Element) -> str:
    return next((_text(one) for one in element.iter() if _local(one) in ("unit", "unitXMLList")), "")


def _float(text: str, path: Sequence[str]) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not isfinite(value):
        raise ValueError(f"{' / '.join(path)}: {text!r:.40} is not a number")
    return value


_EXPANDED = {"uncertainty", "valueExpandedMU"}
_STANDARD = {"standardUnc", "standardMU", "valueStandardMU"}


def _about(element: ET.Element, path: tuple[str, ...]) -> dict[str, list[float]]:
    """Numbers of the uncertainty of a real, a list or a constant, by meaning; [] for what is not given."""
    found: dict[str, list[float]] = {"expanded": [], "k": [], "probability": [], "standard": []}
    for one in element.iter():
        name = _local(one).removesuffix("XMLList")
        meaning = (
            "expanded" if name in _EXPANDED else
            "standard" if name in _STANDARD and (one.text or "").strip() else
            "k" if name == "coverageFactor" else
            "probability" if name == "coverageProbability" else
            ""
        )  # fmt: skip
        if meaning:
            found[meaning] = [_float(text, path) for text in (one.text or "").split()]
    return found


def _at(values: Sequence[float], i: int) -> float | None:
    """Value of row `i` of a list that may have one value for all rows."""
    return None if not values else values[0] if len(values) == 1 else values[i] if i < len(values) else None


def _with(value: float, unit: str, about: dict[str, list[float]], i: int) -> Number:
    expanded, k, probability, standard = (_at(about[name], i) for name in ("expanded", "k", "probability", "standard"))
    if standard is None and expanded is not None and k:
        standard = expanded / k
    return Number(value, plain_unit(unit), expanded, k, probability, standard)


def _real(element: ET.Element, path: tuple[str, ...]) -> Number:
    return _with(_float(_text(_child(element, "value")), path), _unit(element), _about(element, path), 0)


def _real_list(element: ET.Element, path: tuple[str, ...]) -> Iterator[Number]:
    values = [_float(text, path) for text in _text(_child(element, "valueXMLList")).split()]
    units = _text(_child(element, "unitXMLList")).split()
    if len(units) not in (1, len(values)):
        raise ValueError(f"{' / '.join(path)}: {len(values)} values, but {len(units)} units")
    about = _about(element, path)
    for name, given in about.items():
        if len(given) not in (0, 1, len(values)):
            raise ValueError(f"{' / '.join(path)}: {len(values)} values, but {len(given)} of their {name}")
    for i, value in enumerate(values):
        yield _with(value, units[i] if len(units) > 1 else units[0], about, i)


def as_json(read: Read) -> dict[str, Any]:
    """JSON values of a certificate, dates as YYYY-MM-DD."""
    from dataclasses import asdict  # noqa: PLC0415

    told = asdict(read)
    for name in ("began", "ended", "issued"):
        told[name] = None if told[name] is None else told[name].isoformat()
    return told
