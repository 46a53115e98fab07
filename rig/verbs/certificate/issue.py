"""Issue a certificate: its number, its amendment, and all its forms, written once."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rig.errors import RunFileError, UsageError
from rig.extras import needed
from rig.verbs.certificate.files import (
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
from rig.verbs.certificate.numbers_issued import Entry, changed_rules, numbers_issued, runs_of
from rig.verbs.certificate.numbers_issued import Issued as Earlier

if TYPE_CHECKING:
    from rig.verbs.certificate.document import Document
    from rig.verbs.certificate.request import CertificateRequest
    from rig.verbs.certificate.result import Made


SIMULATED_NUMBER = "SIM-"
"""What numbers of simulated certificates begin with, before the laboratory's scheme; they have their own count."""


@dataclass(frozen=True)
class Issue:
    """How a certificate is issued.

    Attributes:
        out: folder of the files.
        number: of the certificate; "" for the next by the scheme of the settings; of a simulated one it begins with
            `SIMULATED_NUMBER`.
        amends: number of the certificate that it replaces; "" for none.
        because: reason of the amendment, or of a second certificate of one run.
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
    with numbers_issued(made.folder / made.settings.numbers, how.out) as earlier, issuing(how.out) as discarded:
        earlier.discard(how.out, discarded)
        return replace(_issued(made, how, earlier), discarded=tuple(discarded))


def _issued(made: Made, how: Issue, earlier: Earlier) -> Issued:
    from rig.verbs.certificate.as_dcc import dcc  # noqa: PLC0415 - where a certificate is written
    from rig.verbs.certificate.html import html  # noqa: PLC0415
    from rig.verbs.certificate.pdf import pdf  # noqa: PLC0415

    before = amended(how.out, check_number(how.amends)) if how.amends else None
    document = replace(made.document, number=_number(made, how, before, earlier))
    known = earlier.of(document.number)
    if known is None:
        document = _of_same_run(document, how, before, earlier)
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
    sha256 = hashlib.sha256(forms["json"]).hexdigest()
    if known is not None:  # the same certificate again is a copy of it
        if known.sha256 != sha256:
            raise UsageError(
                f"certificate {known.number} was issued on {known.issued} in {known.folder}, and this one has other "
                f"contents: one number is one certificate; leave out --number for the next one"
            )
        return Issued(document, tuple(write_once(how.out, document.number, forms)))
    day = document.dates.issued.isoformat()
    entry = Entry(document.number, day, runs_of(document), str(how.out), sha256, how.amends)
    return Issued(document, tuple(write_once(how.out, document.number, forms, earlier.entered(entry))))


def _of_same_run(document: Document, how: Issue, before: Before | None, earlier: Earlier) -> Document:
    """The document with what it says of earlier certificates of its run.

    Raises:
        UsageError: there is one, and nothing says why there is another.
    """
    others = [one for one in earlier.of_runs(runs_of(document)) if not earlier.of_amendment(one.number)]
    said: list[str] = []
    if before is not None:
        said.append(changed_rules(before.told, document))
    elif others:
        last = others[-1]
        if not how.because.strip():
            raise UsageError(
                f"certificate {last.number} of {last.issued} in {last.folder} is of the same run: --amends "
                f"{last.number} makes one that replaces it, --because REASON a second one that says why"
            )
        names = " and ".join(f"{one.number} of {one.issued}" for one in others)
        said.append(
            f"There is another certificate of the same run, {names}. Reason for this one: {how.because.strip()}"
        )
        said.append(_rules_since(last, document))
    return replace(document, deviations=(*filter(None, said), *document.deviations))


def _rules_since(last: Entry, document: Document) -> str:
    """Whether tolerances were changed since an earlier certificate, a sentence; "" if not."""
    try:
        told = json.loads((Path(last.folder) / f"{last.number}.json").read_text(encoding="utf-8"))
        return changed_rules(told, document)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return f"Certificate {last.number} is not in {last.folder}: whether its tolerances were the same is not known."


def _number(made: Made, how: Issue, before: Before | None, earlier: Earlier) -> str:
    """The number. A simulated certificate has one of its own kind, so that no real number is missing for it."""
    simulated = made.document.simulated
    if how.number:
        check_free(how.out, check_number(how.number))
        if earlier.of(how.number) is None:  # a copy keeps the number that it has
            _check_kind(how.number, simulated=simulated)
        return how.number
    mark = SIMULATED_NUMBER if simulated else ""
    if before is not None:
        if bool(before.told.get("simulated")) != simulated:
            kind = "of a real" if simulated else "of a simulated"
            raise UsageError(
                f"certificate {how.amends} is {kind} run, and this one is not: neither replaces the other; leave out "
                f"--amends"
            )
        earlier.check_replaces(how.amends)
        original = before.original[0]
        return number_of_amendment(how.out, f"{mark}{original.removeprefix(mark)}", earlier.numbers)
    number = next_number(how.out, f"{mark}{made.settings.number}", made.document.dates.issued, earlier.numbers)
    _check_kind(number, simulated=simulated)
    return number


def _check_kind(number: str, *, simulated: bool) -> None:
    if number.startswith(SIMULATED_NUMBER) == simulated:
        return
    if simulated:
        raise UsageError(
            f"number {number} is one of the laboratory, and the run is simulated: --number {SIMULATED_NUMBER}{number}"
        )
    raise UsageError(f"number {number} is one of a simulated run, and this run is real: begin it otherwise")


def _paper(name: str) -> Any:
    if name not in ("a4", "letter"):
        raise UsageError(f"--paper {name}: a4 or letter")
    return name


def _check(xml: bytes, schema: Path) -> None:
    from rig.dcc.ptb_schema import schema_errors  # noqa: PLC0415

    errors = schema_errors(xml, schema)
    if errors:
        raise RunFileError(f"the XML is not valid by {schema}, which is a defect of rig: {'; '.join(errors)}")


def _signed(xml: bytes, key: Path, certificate: Path) -> bytes:
    from rig.dcc.signature import signed  # noqa: PLC0415

    return signed(xml, key, certificate)


def all_files(asked: CertificateRequest, how: Issue) -> Iterable[Path | None]:
    """Every file that is read, so that none is overwritten."""
    yield from (*asked.runs, asked.equipment, asked.settings, *asked.confirmed_by)
    yield from (how.template, how.key, how.certificate, how.schema)
