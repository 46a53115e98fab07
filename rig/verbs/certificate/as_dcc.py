"""A certificate as digital calibration certificate (DCC), version 3.2.0, with units of the Digital SI.

PTB's schema 3.2.0 uses D-SI 2.1.0, where an expanded uncertainty is `expandedUnc`; `expandedMU` came with DCC 3.3.0.
Every value stands in SI units; one of another unit is a hybrid quantity, with the unit of the laboratory beside it.
"""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Sequence
from xml.etree import ElementTree as ET

from rig.verbs.certificate import standing_sentences as words
from rig.verbs.certificate.dcc_elements import DCC, LANGUAGE, SI, add, add_contact, add_list, add_real, solid, worded
from rig.verbs.certificate.dcc_statements import add_statements
from rig.verbs.certificate.document import Condition, Document, Equipment, External, Item, Person, by_source
from rig.verbs.certificate.measured import Budget, ResultTable

VERSION = "3.2.0"
XSI = "http://www.w3.org/2001/XMLSchema-instance"


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
    _administrative(add(root, "administrativeData"), document)
    results = add(root, "measurementResults")
    for stage in dict.fromkeys(one.stage for one in document.tables):
        _measurement(add(results, "measurementResult", refType="basic_measurement"), document, stage)
    for source, ones in by_source(document.external).items():
        _external(add(results, "measurementResult"), document, source, ones)
    if paper is not None:
        ring = add(root, "document")
        add(ring, "fileName", solid(f"{document.number}.pdf"))
        add(ring, "mimeType", "application/pdf")
        add(ring, "dataBase64", b64encode(paper).decode())
    ET.indent(root)
    told: bytes = ET.tostring(root, encoding="utf-8", xml_declaration=True)
    return told


def _administrative(parent: ET.Element, document: Document) -> None:
    software = add(add(parent, "dccSoftware"), "software")
    worded(software, "name", "calibration-rig")
    add(software, "release", _release(document))
    add(software, "type", "application")
    _core(add(parent, "coreData"), document)
    items = add(parent, "items")
    measured = {one.sensor for one in document.tables} | {one.sensor for one in document.external}
    every = "" in measured
    for number, item in enumerate(document.items):  # an id without a reference to it is an error in the Schematron
        _item(add(items, "item", id=f"item{number}" if every or item.name in measured else ""), item)
    laboratory = add(parent, "calibrationLaboratory")
    if document.laboratory.accreditation:
        add(laboratory, "calibrationLaboratoryCode", solid(document.laboratory.accreditation))
    add_contact(add(laboratory, "contact"), document.laboratory.party)
    people = add(parent, "respPersons")
    for person in (*document.calibrated_by, document.approved_by):
        _person(add(people, "respPerson"), person, signs=person is document.approved_by)
    add_contact(add(parent, "customer"), document.customer)
    add_statements(add(parent, "statements"), document)


def _release(document: Document) -> str:
    return f"v{document.evidence[0].version}" if document.evidence else "v0"


def _core(parent: ET.Element, document: Document) -> None:
    dates = document.dates
    add(parent, "countryCodeISO3166_1", document.laboratory.party.country)
    add(parent, "usedLangCodeISO639_1", LANGUAGE)
    add(parent, "mandatoryLangCodeISO639_1", LANGUAGE)
    add(parent, "uniqueIdentifier", solid(document.number))
    if dates.received is not None:
        add(parent, "receiptDate", dates.received.isoformat())
    add(parent, "beginPerformanceDate", dates.began.isoformat())
    add(parent, "endPerformanceDate", dates.ended.isoformat())
    add(parent, "performanceLocation", "laboratory")
    add(parent, "issueDate", dates.issued.isoformat())
    if (amends := document.amends) is not None:
        before = add(parent, "previousReport")
        worded(before, "referral", "calibration certificate")
        add(before, "referralID", solid(amends.number))
        add(before, "procedure", "SHA-256")
        add(before, "value", amends.sha256)
        worded(before, "description", amends.sentence, *amends.changes)


def _item(parent: ET.Element, item: Item) -> None:
    worded(parent, "name", item.name)
    theirs = ", ".join(words.IDENTITY[key] for key in item.from_customer)
    stated = f". Stated by the customer: {theirs}" if theirs else ""
    worded(parent, "description", f"{item.description}. Condition as received: {item.condition}{stated}")
    worded(add(parent, "manufacturer"), "name", item.maker)
    add(parent, "model", solid(item.model))
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
        listed = add(parent, "identifications")
        for issuer, value, kind in known:
            _identification(listed, issuer, value, kind)


def _identification(parent: ET.Element, issuer: str, value: str, kind: str) -> None:
    one = add(parent, "identification", refType=f"basic_{kind}")
    add(one, "issuer", issuer)
    add(one, "value", solid(value))
    worded(one, "name", re.sub("([A-Z])", lambda letter: f" {letter[1].lower()}", kind))


def _person(parent: ET.Element, person: Person, *, signs: bool) -> None:
    worded(add(parent, "person"), "name", person.name)
    add(parent, "role", solid(person.role))
    add(parent, "mainSigner", "true" if signs else "false")


def _measurement(parent: ET.Element, document: Document, stage: str) -> None:
    worded(parent, "name", f"Measurement results{f', {stage}' if stage else ''}")
    methods = add(parent, "usedMethods")
    method = add(methods, "usedMethod", refType="basic_calibrationMethod")
    worded(method, "name", document.method.name)
    if document.method.sentences:
        worded(method, "description", " ".join(document.method.sentences))
    for reference in document.method.references:
        add(method, "reference", solid(reference))
    uncertainty = add(methods, "usedMethod", refType="basic_methodMeasurementUncertainty")
    worded(uncertainty, "name", "Measurement uncertainty")
    worded(uncertainty, "description", *words.uncertainty(document))
    add(uncertainty, "norm", "JCGM 100:2008")
    software = add(add(parent, "usedSoftware"), "software")
    worded(software, "name", "calibration-rig")
    add(software, "release", _release(document))
    if document.equipment:
        instruments = add(parent, "measuringEquipments")
        for one in document.equipment:
            _instrument(add(instruments, "measuringEquipment"), one)
    conditions = add(parent, "influenceConditions")
    for condition in (one for one in document.conditions if one.stage == stage):
        _condition(add(conditions, "influenceCondition"), condition, stage)
    if not len(conditions):
        none = add(conditions, "influenceCondition")
        worded(none, "name", "Ambient conditions")
        worded(
            add(none, "data"),
            "text",
            "The run recorded no temperature, humidity or pressure beside those in the model of the results.",
        )
    results = add(parent, "results")
    for n, table in enumerate(document.tables):
        if table.stage == stage:
            items = [f"item{i}" for i, one in enumerate(document.items) if table.sensor in ("", one.name)]
            judged = any((one.sensor, one.stage) == (table.sensor, stage) for one in document.statements)
            _result(add(results, "result", id=f"result{n}" if judged else "", refId=" ".join(items)), table)
    for budget in (one for one in document.budgets if one.stage == stage):
        items = [f"item{i}" for i, one in enumerate(document.items) if budget.sensor in ("", one.name)]
        _budget(add(results, "result", refId=" ".join(items)), budget)
    evidence = [one for one in document.evidence if one.stage == stage]
    if evidence:
        metadata = add(parent, "measurementMetaData")
        for run in evidence:
            about = add(metadata, "metaData")
            text = f"Run {run.run_id} of {run.observations} observations: {run.file}, {run.records} records"
            hashed = "head hash"
            if not run.run_id:
                text, hashed = f"Table of {run.observations} observations, without a run file: {run.file}", "SHA-256"
            worded(about, "name", "Run file" if run.run_id else "Table")
            worded(about, "declaration", f"{text}, {hashed} {run.head}")


def _budget(parent: ET.Element, budget: Budget) -> None:
    """The standard uncertainty of a result by each influence, and by all of them."""
    worded(parent, "name", f"{budget.sensor}: uncertainty budget of {budget.label}".removeprefix(": "))
    left = f" {words.count(budget.left, 'smaller contribution')} not listed." if budget.left else ""
    worded(parent, "description", f"Standard uncertainties of the result, by each influence and combined.{left}")
    data = add(parent, "data")
    for one in budget.contributions:
        told = f"{one.source}; type {one.kind}; degrees of freedom {one.df}; share {100 * one.share:.1f} %"
        _standard(data, one.label, told, one.standard, budget.unit)
    told = f"degrees of freedom {budget.df}; k {budget.k}; expanded uncertainty {budget.expanded}"
    _standard(data, "combined standard uncertainty", told, budget.combined, budget.unit)


def _standard(data: ET.Element, name: str, told: str, value: str, unit: str) -> None:
    quantity = add(data, "quantity")
    worded(quantity, "name", name)
    worded(quantity, "description", told)
    add_real(quantity, value, unit)


def _external(parent: ET.Element, document: Document, source: str, ones: Sequence[External]) -> None:
    """Results of one certificate of an external provider, apart from those of the laboratory."""
    worded(parent, "name", f"Results of an external provider, {source}")
    worded(parent, "description", " ".join(words.EXTERNAL))
    method = add(add(parent, "usedMethods"), "usedMethod", refType="basic_calibrationMethod")
    worded(method, "name", "Method of the external provider, as its certificate states it")
    condition = add(add(parent, "influenceConditions"), "influenceCondition")
    worded(condition, "name", "Ambient conditions")
    worded(add(condition, "data"), "text", "As the certificate of the external provider states them.")
    results = add(parent, "results")
    for one in ones:
        items = [f"item{i}" for i, item in enumerate(document.items) if item.name == one.sensor]
        result = add(results, "result", refId=" ".join(items))
        worded(result, "name", f"{one.sensor}: {one.label}, by an external provider, {one.laboratory}")
        if one.used_for:
            worded(result, "description", f"Used for results of this laboratory: {one.used_for}")
        quantity = add(
            add(result, "data"), "quantity"
        )  # without the refType of measured values: who asks for those gets none of others
        worded(quantity, "name", one.label)
        add_real(quantity, one.value, one.unit, one if one.expanded else None)


def _instrument(parent: ET.Element, one: Equipment) -> None:
    worded(parent, "name", one.name)
    if one.date is not None:
        due = "" if one.due is None else f", due {one.due.isoformat()}"
        by = ", ".join(filter(None, (one.laboratory, one.accreditation)))
        worded(parent, "description", f"Certificate {one.certificate} of {by}, {one.date.isoformat()}{due}")
    if one.maker:
        worded(add(parent, "manufacturer"), "name", one.maker)
    if one.model:
        add(parent, "model", solid(one.model))
    numbers = [
        ("manufacturer", one.serial, "serialNumber"),
        ("calibrationLaboratory", one.asset, "measurementEquipmentNumber"),
    ]
    numbers.append(("other", one.certificate, "certificateNumber"))
    _numbers(parent, numbers)


_STATUS = {"as found": "beforeAdjustment", "as left": "afterAdjustment"}


def _condition(parent: ET.Element, condition: Condition, stage: str) -> None:
    worded(parent, "name", condition.label)
    if not condition.name:
        worded(parent, "description", words.BY_RECORD.format(condition.label))
    if stage in _STATUS:
        add(parent, "status", _STATUS[stage])
    data = add(parent, "data")
    three = {"Min": condition.minimum, "Mean": condition.mean, "Max": condition.maximum}
    for end, text in ((end, text) for end, text in three.items() if text):
        quantity = add(data, "quantity", refType=f"basic_condition{end}")
        worded(quantity, "name", {"Min": "minimum", "Mean": "mean", "Max": "maximum"}[end])
        add_real(quantity, text, condition.unit)


def _result(parent: ET.Element, table: ResultTable) -> None:
    worded(parent, "name", f"{table.sensor}: {table.title}" if table.sensor else table.title)
    if table.notes:
        worded(parent, "description", " ".join(table.notes))
    data = add(parent, "data")
    if not table.at:
        for one in table.results:
            quantity = add(data, "quantity", refType="basic_measuredValue")
            worded(quantity, "name", one.label)
            add_real(quantity, one.value, one.unit, one)
        return
    series = add(data, "list", refType="basic_resultTable")
    for n, column in enumerate(table.at):
        quantity = add(series, "quantity", refType="basic_nominalValue")
        worded(quantity, "name", column.label)
        add_list(quantity, [one.at[n] for one in table.results], column.unit)
    for label in dict.fromkeys(one.label for one in table.results):
        rows = [one for one in table.results if one.label == label]
        if len(rows) != len(table.results) or len({one.unit for one in rows}) > 1:
            raise ValueError(f"{table.title}: every setting needs one {label} in one unit")
        quantity = add(series, "quantity", refType="basic_measuredValue")
        worded(quantity, "name", label)
        add_list(quantity, [one.value for one in rows], rows[0].unit, rows)
