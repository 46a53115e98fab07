"""Random certificates held to PTB's schema and Schematron, and read back: `python -m proving.certificates.campaign`.

The schema is not shipped: name it with `--schema`. The Schematron needs the extra `schematron`.
"""

from __future__ import annotations

import argparse
import io
from collections.abc import Callable
from decimal import Decimal
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


def violations(seed: int, checks: list[Check], *, paper: bool) -> list[str]:
    """All that is wrong with the certificate of a seed."""
    document = Random(seed, IN_FONTS if paper else ALPHABETS).document()
    xml = dcc(document)
    found = [one for check in checks for one in check(xml)] + not_read_back(document, xml)
    return found + (not_on_paper(document) if paper else [])


def main() -> int:
    """Exit code 1 if anything is wrong with any certificate."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--count", type=int, default=1000)
    options.add_argument("--first", type=int, default=0, help="first seed")
    options.add_argument("--schema", type=Path, help="PTB's schema 3.2.0; without it only the Schematron is checked")
    options.add_argument("--paper", type=int, default=20, help="every so many certificates are printed, too; 0: none")
    asked = options.parse_args()
    checks = [rules(), *([by_schema(asked.schema)] if asked.schema else [])]
    wrong = 0
    for seed in range(asked.first, asked.first + asked.count):
        found = violations(seed, checks, paper=bool(asked.paper) and seed % asked.paper == 0)
        wrong += bool(found)
        for one in found[:5]:
            print(f"seed {seed}: {one}")
    how = "schema and Schematron" if asked.schema else "Schematron"
    print(f"{asked.count} certificates by {how}, read back: {wrong} with something wrong")
    return int(wrong > 0)


if __name__ == "__main__":
    raise SystemExit(main())
