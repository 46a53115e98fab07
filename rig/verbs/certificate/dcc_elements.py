"""Elements of a digital calibration certificate: texts, numbers with their uncertainty, in SI units."""

from __future__ import annotations

import re
from collections.abc import Sequence
from decimal import Context, Decimal
from xml.etree import ElementTree as ET

from rig.errors import UsageError
from rig.units.si import SIUnit, si_unit
from rig.verbs.certificate.document import External, Party
from rig.verbs.certificate.measured import Result

DCC, SI = "https://ptb.de/dcc", "https://ptb.de/si"
LANGUAGE = "en"
_EIGHT = Context(prec=8)
"""Digits of a conversion between units: beyond those that an uncertainty leaves."""


def add(parent: ET.Element, tag: str, text: str = "", space: str = DCC, **attributes: str) -> ET.Element:
    """A further element in another; empty attributes are left out."""
    found = ET.SubElement(parent, f"{{{space}}}{tag}", {name: value for name, value in attributes.items() if value})
    if text:
        found.text = _clean(text)
    return found


def _clean(text: str) -> str:
    """A text without the control characters that XML does not have."""
    return re.sub(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", "\ufffd", text)


def solid(text: str) -> str:
    """A text as the schema's strings want it: not empty, without spaces around it."""
    return " ".join(text.split()) or "-"


def worded(parent: ET.Element, tag: str, *texts: str, **attributes: str) -> ET.Element:
    """An element with texts in the language of the certificate."""
    found = add(parent, tag, **attributes)
    for text in texts:
        add(found, "content", text, lang=LANGUAGE)
    return found


def add_real(quantity: ET.Element, value: str, unit: str, result: Result | External | None = None) -> None:
    """A number as a real, as a hybrid with the unit of the laboratory, or as a text if its unit has no SI unit."""
    try:
        found = si_unit(unit)
    except UsageError:
        told = "" if result is None else f" ± {result.expanded} (k = {result.k}, probability {result.probability})"
        worded(quantity, "noQuantity", f"{value}{told}, in {unit}")
        return
    places = (
        [(add(quantity, "hybrid", space=SI), found), (None, _as_given(found))]
        if found.original
        else [(quantity, found)]
    )
    parent = places[0][0]
    for _, form in places:
        assert parent is not None
        real = add(parent, "real", space=SI)
        add(real, "value", scaled(value, form), SI)
        add(real, "unit", form.text, SI)
        if result is not None:
            about = add(real, "expandedUnc", space=SI)
            add(about, "uncertainty", scaled(result.expanded, form), SI)
            add(about, "coverageFactor", result.k, SI)
            add(about, "coverageProbability", result.probability, SI)


def add_list(quantity: ET.Element, values: Sequence[str], unit: str, results: Sequence[Result] = ()) -> None:
    """Numbers as a list, or as a hybrid of two."""
    found = si_unit(unit)
    parent = add(quantity, "hybrid", space=SI) if found.original else quantity
    for form in (found, _as_given(found)) if found.original else (found,):
        series = add(parent, "realListXMLList", space=SI)
        add(series, "valueXMLList", " ".join(scaled(text, form) for text in values), SI)
        add(series, "unitXMLList", form.text, SI)
        if results:
            about = add(series, "expandedUncXMLList", space=SI)
            add(about, "uncertaintyXMLList", " ".join(scaled(one.expanded, form) for one in results), SI)
            add(about, "coverageFactorXMLList", " ".join(one.k for one in results), SI)
            add(about, "coverageProbabilityXMLList", " ".join(one.probability for one in results), SI)


def _as_given(unit: SIUnit) -> SIUnit:
    return SIUnit(f"|{unit.original}")


def scaled(text: str, unit: SIUnit) -> str:
    """A number in another unit. Without a factor its text is unchanged."""
    if unit.factor == 1:
        return text
    return str(_EIGHT.multiply(Decimal(text), unit.factor)).replace("E+", "E")


def known_unit(unit: str) -> SIUnit | None:
    """A unit in SI units; None if it has none."""
    try:
        return si_unit(unit)
    except UsageError:
        return None


def add_contact(parent: ET.Element, party: Party) -> None:
    """Name, address, and how to reach somebody."""
    worded(parent, "name", party.name)
    for tag, text in (("eMail", party.email), ("phone", party.phone)):
        if text:
            add(parent, tag, solid(text))
    place = add(parent, "location")
    if party.country:
        add(place, "countryCode", party.country)
    worded(place, "further", "\n".join(party.address) or "-")
