"""Issue a certificate: its number, its amendment, and all its forms, written once."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rig.certificate.files import (
    Before,
    amended,
    amendment,
    check_free,
    check_number,
    issuing,
    next_number,
    number_of_amendment,
    write_once,
)
from rig.errors import RunFileError, UsageError
from rig.extras import needed

if TYPE_CHECKING:
    from rig.certificate.document import Document
    from rig.results.certificate import Asked, Made


@dataclass(frozen=True)
class Issue:
    """How a certificate is issued.

    Attributes:
        out: folder of the files.
        number: of the certificate; "" for the next by the scheme of the settings.
        amends: number of the certificate that it replaces; "" for none.
        because: reason of the amendment.
        template: own template of the page.
        paper: size of a page, instead of that of the settings.
        key: private key that signs the XML; None to leave it without a signature.
        certificate: X.509 certificate of the key.
        schema: PTB's schema, by which the XML is checked; None for no check.
    """

    out: Path
    number: str = ""
    amends: str = ""
    because: str = ""
    template: Path | None = None
    paper: str = ""
    key: Path | None = None
    certificate: Path | None = None
    schema: Path | None = None

    def __post_init__(self) -> None:
        if (self.key is None) != (self.certificate is None):
            raise UsageError("a signature needs both: --key KEY.pem and --key-certificate CERTIFICATE.pem")


@dataclass(frozen=True, eq=False)
class Issued:
    """An issued certificate and its files; and numbers of earlier issues that were cut and are discarded."""

    document: Document
    files: tuple[Path, ...]
    discarded: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """JSON values: the document, and its files by form."""
        return {**self.document.to_json(), "files": {path.suffix[1:]: str(path) for path in self.files}}


def check_extras(how: Issue) -> None:
    """Refuse before the work what would fail after it: an extra that is not installed. Raises `UsageError`."""
    needed("typst", "certificate")
    if how.key is not None:
        needed("signxml.xades", "dcc")
    if how.schema is not None:
        needed("lxml.etree", "dcc")


def issue(made: Made, how: Issue) -> Issued:
    """Write all forms of a certificate, once.

    Raises:
        UsageError: an extra is missing, the number exists, nothing was amended, a unit is unknown, or the disk refuses.
        ConfigurationError: the template cannot be used.
    """
    with issuing(how.out) as discarded:
        return replace(_issued(made, how), discarded=tuple(discarded))


def _issued(made: Made, how: Issue) -> Issued:
    from rig.certificate.as_dcc import dcc  # noqa: PLC0415 - where a certificate is written
    from rig.certificate.html import html  # noqa: PLC0415
    from rig.certificate.pdf import pdf  # noqa: PLC0415

    before = amended(how.out, check_number(how.amends)) if how.amends else None
    document = replace(made.document, number=_number(made, how, before))
    if how.paper:
        document = replace(document, paper=_paper(how.paper))
    if before is not None:
        document = replace(document, amends=amendment(before, document.to_json(), how.because))
    own = made.folder / made.settings.template if made.settings.template else None
    fonts = made.folder / made.settings.fonts if made.settings.fonts else None
    paper = pdf(document, how.template or own, fonts)
    xml = dcc(document, paper)
    if how.schema is not None:
        _check(xml, how.schema)
    if how.key is not None and how.certificate is not None:
        xml = _signed(xml, how.key, how.certificate)
    told = json.dumps(document.to_json(), indent=2, ensure_ascii=False, allow_nan=False, default=str)
    forms = {"pdf": paper, "html": html(document).encode(), "xml": xml, "json": told.encode()}
    return Issued(document, tuple(write_once(how.out, document.number, forms)))


def _number(made: Made, how: Issue, before: Before | None) -> str:
    if how.number:
        check_free(how.out, check_number(how.number))
        return how.number
    if before is not None:
        return number_of_amendment(how.out, before.original[0])
    return next_number(how.out, made.settings.number, made.document.dates.issued)


def _paper(name: str) -> Any:
    if name not in ("a4", "letter"):
        raise UsageError(f"--paper {name}: a4 or letter")
    return name


def _check(xml: bytes, schema: Path) -> None:
    from rig.dcc.schema import schema_errors  # noqa: PLC0415

    errors = schema_errors(xml, schema)
    if errors:
        raise RunFileError(f"the XML is not valid by {schema}, which is a defect of rig: {'; '.join(errors)}")


def _signed(xml: bytes, key: Path, certificate: Path) -> bytes:
    from rig.dcc.signature import signed  # noqa: PLC0415

    return signed(xml, key, certificate)


def all_files(asked: Asked, how: Issue) -> Iterable[Path | None]:
    """Every file that is read, so that none is overwritten."""
    yield from (*asked.runs, asked.equipment, asked.settings, *asked.confirmed_by)
    yield from (how.template, how.key, how.certificate, how.schema)
