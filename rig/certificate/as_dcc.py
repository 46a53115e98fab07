"""A certificate as digital calibration certificate (DCC), version 3.2.0, with units of the Digital SI.

PTB's schema 3.2.0 uses D-SI 2.1.0, where an expanded uncertainty is `expandedUnc`; `expandedMU` came with DCC 3.3.0.
Every value stands in SI units; one of another unit is a hybrid quantity, with the unit of the laboratory beside it.
"""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Iterable, Sequence
from decimal import Context, Decimal
from xml.etree import ElementTree as ET

from rig.certificate import words
from rig.certificate.document import (
    Condition,
    Document,
    Equipment,
    Item,
    Party,
    Person,
    Result,
    ResultTable,
    Statement,
)
from rig.dcc.si_units import SIUnit, si_unit
from rig.errors import UsageError

VERSION = "3.2.0"
DCC, SI, XSI = "https://ptb.de/dcc", "https://ptb.de/si", "http://www.w3.org/2001/XMLSchema-instance"
_LANGUAGE = "en"
_EIGHT = Context(prec=8)
"""Digits of a conversion between units: beyond those that an uncertainty leaves."""


def dcc(document: Document, paper: bytes | None = None) -> bytes:
    """The certificate as XML, not signed.

    Args:
        document: the certificate.
        paper: its PDF, to be kept in the XML; None for none.

    Raises:
        UsageError: the unit of a column cannot be written in SI units.
    """
    for prefix, space in (("dcc", DCC), ("si", SI), ("xsi", XSI)):
        ET.register_namespace(prefix, space)
    where = f"{DCC} {DCC}/v{VERSION}/dcc.xsd"
    root = ET.Element(
        f"{{{DCC}}}digitalCalibrationCertificate", {"schemaVersion": VERSION, f"{{{XSI}}}schemaLocation": where}
    )
    _administrative(_add(root, "administrativeData"), document)
    results = _add(root, "measurementResults")
    for stage in dict.fromkeys(one.stage for one in document.tables):
        _measurement(_add(results, "measurementResult", refType="basic_measurement"), document, stage)
    if paper is not None:
        ring = _add(root, "document")
        _add(ring, "fileName", _solid(f"{document.number}.pdf"))
        _add(ring, "mimeType", "application/pdf")
        _add(ring, "dataBase64", b64encode(paper).decode())
    ET.indent(root)
    told: bytes = ET.tostring(root, encoding="utf-8", xml_declaration=True)
    return told


def _add(parent: ET.Element, tag: str, text: str = "", space: str = DCC, **attributes: str) -> ET.Element:
    """A further element in another; empty attributes are left out."""
    found = ET.SubElement(parent, f"{{{space}}}{tag}", {name: value for name, value in attributes.items() if value})
    if text:
        found.text = _clean(text)
    return found


def _clean(text: str) -> str:
    """A text without the control characters that XML does not have."""
    return re.sub(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", "\ufffd", text)


def _solid(text: str) -> str:
    """A text as the schema's strings want it: not empty, without spaces around it."""
    return " ".join(text.split()) or "-"


def _words(parent: ET.Element, tag: str, *texts: str, **attributes: str) -> ET.Element:
    """An element with texts in the language of the certificate."""
    found = _add(parent, tag, **attributes)
    for text in texts:
        _add(found, "content", text, lang=_LANGUAGE)
    return found


def _administrative(parent: ET.Element, document: Document) -> None:
    software = _add(_add(parent, "dccSoftware"), "software")
    _words(software, "name", "calibration-rig")
    _add(software, "release", _release(document))
    _add(software, "type", "application")
    _core(_add(parent, "coreData"), document)
    items = _add(parent, "items")
    measured = {one.sensor for one in document.tables}
    every = "" in measured
    for number, item in enumerate(document.items):  # an id without a reference to it is an error in the Schematron
        _item(_add(items, "item", id=f"item{number}" if every or item.name in measured else ""), item)
    laboratory = _add(parent, "calibrationLaboratory")
    if document.laboratory.accreditation:
        _add(laboratory, "calibrationLaboratoryCode", _solid(document.laboratory.accreditation))
    _contact(_add(laboratory, "contact"), document.laboratory.party)
    people = _add(parent, "respPersons")
    for person in (*document.calibrated_by, document.approved_by):
        _person(_add(people, "respPerson"), person, signs=person is document.approved_by)
    _contact(_add(parent, "customer"), document.customer)
    _statements(_add(parent, "statements"), document)


def _release(document: Document) -> str:
    return f"v{document.evidence[0].version}" if document.evidence else "v0"


def _core(parent: ET.Element, document: Document) -> None:
    dates = document.dates
    _add(parent, "countryCodeISO3166_1", document.laboratory.party.country)
    _add(parent, "usedLangCodeISO639_1", _LANGUAGE)
    _add(parent, "mandatoryLangCodeISO639_1", _LANGUAGE)
    _add(parent, "uniqueIdentifier", _solid(document.number))
    if dates.received is not None:
        _add(parent, "receiptDate", dates.received.isoformat())
    _add(parent, "beginPerformanceDate", dates.began.isoformat())
    _add(parent, "endPerformanceDate", dates.ended.isoformat())
    _add(parent, "performanceLocation", "laboratory")
    _add(parent, "issueDate", dates.issued.isoformat())
    if (amends := document.amends) is not None:
        before = _add(parent, "previousReport")
        _words(before, "referral", "calibration certificate")
        _add(before, "referralID", _solid(amends.number))
        _add(before, "procedure", "SHA-256")
        _add(before, "value", amends.sha256)
        _words(before, "description", amends.sentence, *amends.changes)


def _item(parent: ET.Element, item: Item) -> None:
    _words(parent, "name", item.name)
    _words(parent, "description", f"{item.description}. Condition as received: {item.condition}")
    _words(_add(parent, "manufacturer"), "name", item.maker)
    _add(parent, "model", _solid(item.model))
    numbers = [
        ("manufacturer", item.serial, "serialNumber"),
        ("calibrationLaboratory", item.asset, "measurementEquipmentNumber"),
        ("customer", item.customer_id, "customerAssetNumber"),
    ]
    _numbers(parent, numbers)


def _numbers(parent: ET.Element, numbers: Sequence[tuple[str, str, str]]) -> None:
    """Identifications: issuer, value and kind of each that has a value; no element if none has."""
    known = [one for one in numbers if one[1]]
    if known:
        listed = _add(parent, "identifications")
        for issuer, value, kind in known:
            _identification(listed, issuer, value, kind)


def _identification(parent: ET.Element, issuer: str, value: str, kind: str) -> None:
    one = _add(parent, "identification", refType=f"basic_{kind}")
    _add(one, "issuer", issuer)
    _add(one, "value", _solid(value))
    _words(one, "name", re.sub("([A-Z])", lambda letter: f" {letter[1].lower()}", kind))


def _contact(parent: ET.Element, party: Party) -> None:
    _words(parent, "name", party.name)
    for tag, text in (("eMail", party.email), ("phone", party.phone)):
        if text:
            _add(parent, tag, _solid(text))
    place = _add(parent, "location")
    if party.country:
        _add(place, "countryCode", party.country)
    _words(place, "further", "\n".join(party.address) or "-")


def _person(parent: ET.Element, person: Person, *, signs: bool) -> None:
    _words(_add(parent, "person"), "name", person.name)
    _add(parent, "role", _solid(person.role))
    _add(parent, "mainSigner", "true" if signs else "false")


def _statements(parent: ET.Element, document: Document) -> None:
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
        one = _add(parent, "statement")
        _words(one, "name", f"Unit {unit.original}")
        _add(one, "nonSIDefinition", _solid(unit.definition))
        _add(one, "nonSIUnit", f"|{unit.original}")
    for deviation in document.deviations:
        _declared(parent, "Deviation from the procedure", deviation)
    for effect in document.effects:
        state = "confirmed" if effect.confirmed else "not confirmed"
        text = f"{effect.sensor}: {effect.name}, {effect.cause}; {effect.size}; {state}: {effect.how}"
        _declared(parent, "Effect beside the declared model", text)
    for model in document.models:
        _declared(parent, "Model of the results", model)
    if document.adjustment:
        _declared(parent, "Adjustment between as found and as left", document.adjustment)
    for text in (*document.remarks, *document.opinions):
        _declared(parent, "Remark", text)
    for statement in document.statements:
        _conformity(parent, statement, document)
    if document.next_due is not None:
        one = _add(parent, "statement", refType="basic_recalibration")
        _words(one, "declaration", "Date of the next calibration, at the customer's wish.")
        _add(one, "date", document.next_due.isoformat())


def _declared(parent: ET.Element, name: str, *texts: str, refType: str = "", traceable: bool | None = None) -> None:
    one = _add(parent, "statement", refType=refType)
    _words(one, "name", name)
    if traceable is not None:
        _add(one, "traceable", "true" if traceable else "false")
    _words(one, "declaration", *[" ".join(texts)])


def _conformity(parent: ET.Element, statement: Statement, document: Document) -> None:
    tables = [
        n for n, one in enumerate(document.tables) if (one.sensor, one.stage) == (statement.sensor, statement.stage)
    ]
    one = _add(parent, "statement", refType="basic_conformity", refId=" ".join(f"result{n}" for n in tables))
    _words(one, "name", f"{statement.sensor}: {statement.what}")
    _add(one, "convention", _solid(statement.rule))
    _add(one, "norm", "JCGM 106:2012")
    by = statement.basis and f" ({statement.basis})"
    told = (
        f"{statement.sentence} Tolerance {statement.tolerance}{by}; probability of conformity {statement.probability}."
    )
    _words(one, "declaration", told.strip())
    _add(one, "conformity", statement.verdict)


def _measurement(parent: ET.Element, document: Document, stage: str) -> None:
    _words(parent, "name", f"Measurement results{f', {stage}' if stage else ''}")
    methods = _add(parent, "usedMethods")
    method = _add(methods, "usedMethod", refType="basic_calibrationMethod")
    _words(method, "name", document.method.name)
    if document.method.sentences:
        _words(method, "description", " ".join(document.method.sentences))
    for reference in document.method.references:
        _add(method, "reference", _solid(reference))
    uncertainty = _add(methods, "usedMethod", refType="basic_methodMeasurementUncertainty")
    _words(uncertainty, "name", "Measurement uncertainty")
    _words(uncertainty, "description", *words.uncertainty(document))
    _add(uncertainty, "norm", "JCGM 100:2008")
    software = _add(_add(parent, "usedSoftware"), "software")
    _words(software, "name", "calibration-rig")
    _add(software, "release", _release(document))
    if document.equipment:
        instruments = _add(parent, "measuringEquipments")
        for one in document.equipment:
            _instrument(_add(instruments, "measuringEquipment"), one)
    conditions = _add(parent, "influenceConditions")
    for condition in (one for one in document.conditions if one.stage == stage):
        _condition(_add(conditions, "influenceCondition"), condition, stage)
    if not len(conditions):
        none = _add(conditions, "influenceCondition")
        _words(none, "name", "Ambient conditions")
        _words(_add(none, "data"), "text", "No ambient quantity was recorded in the run.")
    results = _add(parent, "results")
    for n, table in enumerate(document.tables):
        if table.stage == stage:
            items = [f"item{i}" for i, one in enumerate(document.items) if table.sensor in ("", one.name)]
            judged = any((one.sensor, one.stage) == (table.sensor, stage) for one in document.statements)
            _result(_add(results, "result", id=f"result{n}" if judged else "", refId=" ".join(items)), table)
    evidence = [one for one in document.evidence if one.stage == stage]
    if evidence:
        metadata = _add(parent, "measurementMetaData")
        for run in evidence:
            about = _add(metadata, "metaData")
            text = f"Run {run.run_id} of {run.observations} observations: {run.file}, {run.records} records"
            hashed = "head hash"
            if not run.run_id:
                text, hashed = f"Table of {run.observations} observations, without a run file: {run.file}", "SHA-256"
            _words(about, "name", "Run file" if run.run_id else "Table")
            _words(about, "declaration", f"{text}, {hashed} {run.head}")


def _instrument(parent: ET.Element, one: Equipment) -> None:
    _words(parent, "name", one.name)
    if one.date is not None:
        due = "" if one.due is None else f", due {one.due.isoformat()}"
        _words(parent, "description", f"Certificate {one.certificate} of {one.laboratory}, {one.date.isoformat()}{due}")
    if one.maker:
        _words(_add(parent, "manufacturer"), "name", one.maker)
    if one.model:
        _add(parent, "model", _solid(one.model))
    numbers = [
        ("manufacturer", one.serial, "serialNumber"),
        ("calibrationLaboratory", one.asset, "measurementEquipmentNumber"),
    ]
    numbers.append(("other", one.certificate, "certificateNumber"))
    _numbers(parent, numbers)


_STATUS = {"as found": "beforeAdjustment", "as left": "afterAdjustment"}


def _condition(parent: ET.Element, condition: Condition, stage: str) -> None:
    _words(parent, "name", condition.label)
    if stage in _STATUS:
        _add(parent, "status", _STATUS[stage])
    data = _add(parent, "data")
    for end, text in (("Min", condition.minimum), ("Mean", condition.mean), ("Max", condition.maximum)):
        quantity = _add(data, "quantity", refType=f"basic_condition{end}")
        _words(quantity, "name", {"Min": "minimum", "Mean": "mean", "Max": "maximum"}[end])
        _real(quantity, text, condition.unit)


def _result(parent: ET.Element, table: ResultTable) -> None:
    _words(parent, "name", f"{table.sensor}: {table.title}" if table.sensor else table.title)
    if table.notes:
        _words(parent, "description", " ".join(table.notes))
    data = _add(parent, "data")
    if not table.at:
        for one in table.results:
            quantity = _add(data, "quantity", refType="basic_measuredValue")
            _words(quantity, "name", one.label)
            _real(quantity, one.value, one.unit, one)
        return
    series = _add(data, "list", refType="basic_resultTable")
    for n, column in enumerate(table.at):
        quantity = _add(series, "quantity", refType="basic_nominalValue")
        _words(quantity, "name", column.label)
        _list(quantity, [one.at[n] for one in table.results], column.unit)
    for label in dict.fromkeys(one.label for one in table.results):
        rows = [one for one in table.results if one.label == label]
        if len(rows) != len(table.results) or len({one.unit for one in rows}) > 1:
            raise ValueError(f"{table.title}: every setting needs one {label} in one unit")
        quantity = _add(series, "quantity", refType="basic_measuredValue")
        _words(quantity, "name", label)
        _list(quantity, [one.value for one in rows], rows[0].unit, rows)


def _real(quantity: ET.Element, value: str, unit: str, result: Result | None = None) -> None:
    """A number as a real, as a hybrid with the unit of the laboratory, or as a text if its unit has no SI unit."""
    try:
        found = si_unit(unit)
    except UsageError:
        told = "" if result is None else f" ± {result.expanded} (k = {result.k}, probability {result.probability})"
        _words(quantity, "noQuantity", f"{value}{told}, in {unit}")
        return
    places = (
        [(_add(quantity, "hybrid", space=SI), found), (None, _as_given(found))]
        if found.original
        else [(quantity, found)]
    )
    parent = places[0][0]
    for _, form in places:
        assert parent is not None
        real = _add(parent, "real", space=SI)
        _add(real, "value", scaled(value, form), SI)
        _add(real, "unit", form.text, SI)
        if result is not None:
            about = _add(real, "expandedUnc", space=SI)
            _add(about, "uncertainty", scaled(result.expanded, form), SI)
            _add(about, "coverageFactor", result.k, SI)
            _add(about, "coverageProbability", result.probability, SI)


def _list(quantity: ET.Element, values: Sequence[str], unit: str, results: Sequence[Result] = ()) -> None:
    """Numbers as a list, or as a hybrid of two."""
    found = si_unit(unit)
    parent = _add(quantity, "hybrid", space=SI) if found.original else quantity
    for form in (found, _as_given(found)) if found.original else (found,):
        series = _add(parent, "realListXMLList", space=SI)
        _add(series, "valueXMLList", " ".join(scaled(text, form) for text in values), SI)
        _add(series, "unitXMLList", form.text, SI)
        if results:
            about = _add(series, "expandedUncXMLList", space=SI)
            _add(about, "uncertaintyXMLList", " ".join(scaled(one.expanded, form) for one in results), SI)
            _add(about, "coverageFactorXMLList", " ".join(one.k for one in results), SI)
            _add(about, "coverageProbabilityXMLList", " ".join(one.probability for one in results), SI)


def _as_given(unit: SIUnit) -> SIUnit:
    return SIUnit(f"|{unit.original}")


def scaled(text: str, unit: SIUnit) -> str:
    """A number in another unit. Without a factor its text is unchanged."""
    if unit.factor == 1:
        return text
    return str(_EIGHT.multiply(Decimal(text), unit.factor)).replace("E+", "E")


def _other_units(document: Document) -> Iterable[SIUnit]:
    """Units that are not of the SI brochure, each once."""
    used = [column.unit for table in document.tables for column in table.at]
    used += [one.unit for table in document.tables for one in table.results]
    used += [condition.unit for condition in document.conditions]
    return [found for unit in dict.fromkeys(used) if (found := _known(unit)) is not None and found.original]


def _known(unit: str) -> SIUnit | None:
    try:
        return si_unit(unit)
    except UsageError:
        return None
