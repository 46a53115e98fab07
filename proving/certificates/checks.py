"""Certificates held to PTB's schema and Schematron, and read back.

The schema is not shipped. The Schematron needs the extra `schematron`.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from decimal import Decimal
from functools import cache
from pathlib import Path
from typing import Any

from proving.certificates.documents import ALPHABETS, IN_FONTS, Random
from rig.dcc.ptb_schema import schema_errors
from rig.dcc.read_dcc import parsed
from rig.errors import UsageError
from rig.extras import needed
from rig.units.si import si_unit
from rig.verbs.certificate.as_dcc import dcc
from rig.verbs.certificate.document import Document

Check = Callable[[bytes], list[str]]


def rules() -> Check:
    """PTB's Schematron, as a check of a certificate. Raises `UsageError` without the extra."""
    validator: Any = needed("dcclib.validation", "schematron").SchematronValidator.for_dcc()

    def broken(xml: bytes) -> list[str]:
        found = validator.validate_str(xml.decode())
        said = [*found.failed_assertions, *found.successful_reports]
        return [f"Schematron: {one.text}" for one in said if one.role == "error"]

    return broken


def by_schema(schema: Path) -> Check:
    """PTB's schema, as a check of a certificate."""
    return lambda xml: [f"schema: {one}" for one in schema_errors(xml, schema)]


@cache
def checks(schema: str) -> tuple[Check, ...]:
    """By the Schematron, and by a schema if its file is given."""
    return (rules(), *([by_schema(Path(schema))] if schema else []))


def not_read_back(document: Document, xml: bytes) -> list[str]:
    """Results that are not read back with value, uncertainty, factor and probability as they were."""
    read = parsed(xml, "made.xml")
    results = [one for one in read.quantities if one.where == "results" and "basic_measuredValue" in one.ref_types]
    found = [number for one in results for number in one.numbers]
    texts = [one.text for one in results if not one.numbers]
    wrong = []
    for one in (one for table in document.tables for one in table.results):
        try:
            factor = si_unit(one.unit).factor
        except UsageError:
            text = texts.pop(0)
            if one.value not in text or one.expanded not in text:
                wrong.append(f"read back: {one.value} ± {one.expanded} is {text!r}")
            continue
        number = found.pop(0)
        asked = [float(Decimal(text) * factor) for text in (one.value, one.expanded)]
        given = [number.value, number.expanded or 0.0]
        near = all(abs(a - g) <= 1e-7 * abs(a) for a, g in zip(asked, given, strict=True))
        if not near or (number.k, number.probability) != (float(one.k), float(one.probability)):
            wrong.append(f"read back: {one.value} ± {one.expanded} {one.unit} is {number}")
    apart = sum(", by an external provider, " in path[0] for path in (one.path for one in read.quantities))
    wrong += [] if apart == len(document.external) else [f"read back: {apart} results of external providers"]
    return wrong + [f"read back: {len(found) + len(texts)} results too many"] * bool(found or texts)


def not_on_paper(document: Document) -> list[str]:
    """Pages of the PDF without the number of the certificate, or without SIMULATED where it belongs."""
    from rig.verbs.certificate.pdf import pdf  # noqa: PLC0415 - an extra

    pages = needed("pypdf", "dev").PdfReader(io.BytesIO(pdf(document))).pages
    wanted = [document.number, *(["SIMULATED"] if document.simulated else [])]
    return [
        f"page {n}: no {word}" for n, page in enumerate(pages, 1) for word in wanted if word not in page.extract_text()
    ]


def violations(seed: int, checks: Sequence[Check], *, paper: bool) -> list[str]:
    """All that is wrong with the certificate of a seed."""
    document = Random(seed, IN_FONTS if paper else ALPHABETS).document()
    xml = dcc(document)
    found = [one for check in checks for one in check(xml)] + not_read_back(document, xml)
    return found + (not_on_paper(document) if paper else [])
