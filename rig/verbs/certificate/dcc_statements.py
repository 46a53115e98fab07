"""Statements of a digital calibration certificate: validity, traceability, deviations, effects, conformity, units."""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree import ElementTree as ET

from rig.units.si import SIUnit
from rig.verbs.certificate import standing_sentences as words
from rig.verbs.certificate.dcc_elements import add, add_contact, known_unit, solid, worded
from rig.verbs.certificate.document import Document, Supplied
from rig.verbs.certificate.measured import Statement


def add_statements(parent: ET.Element, document: Document) -> None:
    """All statements of a certificate."""
    if document.simulated:
        _declared(parent, "SIMULATED", words.PAGE["warning"], traceable=False)
    _declared(parent, "Validity", *words.COVER)
    _declared(
        parent,
        "Traceability",
        *words.TRACEABILITY,
        refType="basic_metrologicalTraceability",
        traceable=not document.simulated,
    )
    for unit in _other_units(document):
        one = add(parent, "statement")
        worded(one, "name", f"Unit {unit.original}")
        add(one, "nonSIDefinition", solid(unit.definition))
        add(one, "nonSIUnit", f"|{unit.original}")
    for deviation in document.deviations:
        _declared(parent, "Deviation from the procedure", deviation)
    for fact in document.unstated:
        _declared(parent, "Equipment", fact)
    for condition in document.unrecorded:
        _declared(parent, "Conditions during the calibration", condition)
    for asset in dict.fromkeys(one.asset for one in document.holdings):
        _declared(parent, f"Conditions of the certificate of {asset}", *_holdings(document, asset))
    for datum in document.supplied:
        one = _declared(parent, "Data supplied by the customer", _supplied(datum), *words.disclaimer(datum.affects))
        add_contact(add(one, "respAuthority"), document.customer)
    for effect in document.effects:
        state = "confirmed" if effect.confirmed else "not confirmed"
        text = f"{effect.sensor}: {effect.name}, {effect.cause}; {effect.size}; {state}: {effect.how}"
        text += f". {effect.shared}" if effect.shared else ""
        _declared(parent, "Effect beside the declared model", text)
    for model in document.models:
        _declared(parent, "Model of the results", model)
    for note in document.notes:
        _declared(parent, "Note on the results", note)
    if document.adjustment:
        _declared(parent, "Adjustment between as found and as left", document.adjustment)
    for text in (*document.remarks, *document.opinions):
        _declared(parent, "Remark", text)
    for statement in document.statements:
        _conformity(parent, statement, document)
    if document.next_due is not None:
        one = add(parent, "statement", refType="basic_recalibration")
        worded(one, "declaration", "Date of the next calibration, at the customer's wish.")
        add(one, "date", document.next_due.isoformat())


def _declared(
    parent: ET.Element, name: str, *texts: str, refType: str = "", traceable: bool | None = None
) -> ET.Element:
    one = add(parent, "statement", refType=refType)
    worded(one, "name", name)
    if traceable is not None:
        add(one, "traceable", "true" if traceable else "false")
    worded(one, "declaration", *[" ".join(texts)])
    return one


def _holdings(document: Document, asset: str) -> Iterable[str]:
    """Conditions under which the certificate of a piece of equipment holds, and what is known of each, sentences."""
    for one in document.holdings:
        if one.asset == asset:
            at = f" ({one.stage})" if one.stage else ""
            known = f"it was {one.found} {one.unit}, by {one.by}" if one.found else "not recorded"
            yield f"Certificate {one.certificate} holds at {one.label} {one.limits} {one.unit}; {known}{at}."


def _supplied(datum: Supplied) -> str:
    of = f"{datum.subject}: " if datum.subject else ""
    return f"{of}{datum.what}{f', {datum.value}' if datum.value else ''}."


def _conformity(parent: ET.Element, statement: Statement, document: Document) -> None:
    tables = [
        n for n, one in enumerate(document.tables) if (one.sensor, one.stage) == (statement.sensor, statement.stage)
    ]
    one = add(parent, "statement", refType="basic_conformity", refId=" ".join(f"result{n}" for n in tables))
    worded(one, "name", f"{statement.sensor}: {statement.what}")
    add(one, "convention", solid(statement.rule))
    add(one, "norm", "JCGM 106:2012")
    by = statement.basis and f" ({statement.basis})"
    told = (
        f"{statement.sentence} Tolerance {statement.tolerance}{by}; probability of conformity {statement.probability}."
    )
    worded(one, "declaration", told.strip())
    add(one, "conformity", statement.verdict)


def _other_units(document: Document) -> Iterable[SIUnit]:
    """Units that are not of the SI brochure, each once."""
    used = [column.unit for table in document.tables for column in table.at]
    used += [one.unit for table in document.tables for one in table.results]
    used += [condition.unit for condition in document.conditions]
    used += [one.unit for one in document.external]
    return [found for unit in dict.fromkeys(used) if (found := known_unit(unit)) is not None and found.original]
