"""`rig certificate`: a certificate of one run, or of two runs before and after an adjustment."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fitter.errors import FitError
from procedures.errors import DataError
from rig.certificate import about, assembly
from rig.certificate.document import Dates, Document, Stage
from rig.certificate.files import (
    amended,
    amendment,
    check_free,
    check_number,
    next_number,
    number_of_amendment,
    write_once,
)
from rig.certificate.settings import CertificateSettings, read_settings
from rig.closed_loop.budget import RunBudget, budget_of, run_with_register
from rig.dcc.extras import needed
from rig.errors import RigError, RunFileError, UsageError
from rig.register import DOCUMENT
from rig.results.data import Data
from rig.run_file.reader import RunReader
from rig.run_file.state import RunState, read_state
from rig.run_file.verification import verify_file

if TYPE_CHECKING:
    from fitter.trace.outcome import Outcome
    from rig.closed_loop.confirm import Confirmed

SETTINGS = "certificate.toml"
_STAGES: Mapping[int, tuple[Stage, ...]] = {1: ("",), 2: ("as found", "as left")}


class Refused(UsageError):
    """No certificate is made, for these reasons."""

    def __init__(self, runs: Sequence[Path], reasons: Sequence[str]) -> None:
        self.reasons = tuple(dict.fromkeys(reasons))
        listed = "\n".join(f"- {one}" for one in self.reasons)
        names = " and ".join(map(str, runs))
        super().__init__(f"no certificate is made of {names}; {len(self.reasons)} reasons:\n{listed}")


@dataclass(frozen=True)
class Asked:
    """The contents of a certificate, as asked for.

    Attributes:
        runs: one run file, or two: as found, as left.
        issued: date of issue.
        equipment: another register than the one kept with the runs.
        settings: certificate.toml; None for that in the working folder.
        confirmed_by: later runs that confirm effects of the last run.
        calibrated_by: instead of that of the settings.
        approved_by: instead of that of the settings.
        adjustment: between as found and as left, a sentence.
        today: the certificate of a real run is not dated after it; None if that is not asked.
    """

    runs: tuple[Path, ...]
    issued: date
    equipment: Path | None = None
    settings: Path | None = None
    confirmed_by: tuple[Path, ...] = ()
    calibrated_by: str = ""
    approved_by: str = ""
    adjustment: str = ""
    today: date | None = None


@dataclass(frozen=True, eq=False)
class Made:
    """A certificate, not yet written.

    Attributes:
        document: all of it, with `NUMBER` as its number.
        settings: of the laboratory.
        folder: of the settings, for its template.
        budgets: of each run.
    """

    document: Document
    settings: CertificateSettings
    folder: Path
    budgets: tuple[RunBudget, ...]


@dataclass
class _Run:
    """One run, as far as it could be read."""

    path: Path
    stage: Stage
    state: RunState
    records: int
    register: str | None = None
    budget: RunBudget | None = None
    outcomes: Sequence[Outcome] = ()
    confirmed: Confirmed | None = None
    heads: Mapping[Path, str] = field(default_factory=dict)


def make(asked: Asked) -> Made:
    """A certificate as data.

    Raises:
        Refused: with all reasons why none is made.
        UsageError: there are not one or two runs.
        ConfigurationError: the settings cannot be read.
    """
    if len(asked.runs) not in _STAGES:
        raise UsageError(f"a certificate is made of one run, or of two (as found, as left), not of {len(asked.runs)}")
    given = asked.settings or Path(SETTINGS)
    settings = read_settings(given) if asked.settings is not None or given.exists() else CertificateSettings()
    reasons: list[str] = []
    runs = [
        _read(path, stage, asked, settings, reasons)
        for path, stage in zip(asked.runs, _STAGES[len(asked.runs)], strict=True)
    ]
    whole = [one for one in runs if one is not None]
    document = _document(whole, asked, settings, given, reasons) if whole else None
    if reasons or document is None:
        raise Refused(asked.runs, reasons)
    return Made(document, settings, given.parent, tuple(one.budget for one in whole if one.budget is not None))


def _read(path: Path, stage: Stage, asked: Asked, settings: CertificateSettings, reasons: list[str]) -> _Run | None:
    """A run, verified, budgeted and traced; None if it cannot be read at all."""
    found = verify_file(path)
    if not found.whole:
        reasons.append(f"{path} is not verified: {found.findings[0]}; see rig verify")
        return None
    with RunReader.open(path) as reader:
        run = _Run(path, stage, read_state(reader), found.records, reader.documents().get(DOCUMENT))
    if run.state.ended != "complete":
        reasons.append(f"{path} is not complete: {run.state.remaining} points are missing; rig resume {path}")
    try:
        of = run_with_register(path, asked.equipment)
        if of.register.example and not of.table.simulated:
            reasons.append(f"the register {of.register.name!r} has example values: state those of your equipment")
        run.budget = budget_of(
            of,
            at=settings.at,
            same_meter=settings.same_meter,
            probability=settings.probability,
            shapes=assembly.shapes(settings.probability),
        )
        reasons.extend(_of_budget(run.budget, settings))
        later = asked.confirmed_by if path == asked.runs[-1] else ()
        verified = [verify_file(one) for one in later]
        broken = [(one, v.findings[0]) for one, v in zip(later, verified, strict=True) if not v.whole]
        reasons.extend(f"{one} is not verified: {finding}; see rig verify" for one, finding in broken)
        if broken:
            return run
        run.heads = {one: v.head for one, v in zip(later, verified, strict=True)}
        run.outcomes, run.confirmed = _traced(path, later, quick="quick" in of.kind.trace_options.model_fields)
        reasons.extend(_doubts(run))
    except (RigError, DataError, FitError) as error:
        reasons.extend(str(error).splitlines())
    return run


def _of_budget(budget: RunBudget, settings: CertificateSettings) -> Iterator[str]:
    for point in budget.outside:
        yield f"{point}; correct `at`"
    for name in assembly.repeatability_only(budget):
        yield f"{name}: its uncertainty is repeatability only; state the errors of its instruments in the register"
    table = budget.of.table
    for column in budget.unstated:
        if column in table.outputs or column in table.factors:
            yield f"{column}: the register states no error of what reads or sets it; add what its certificate says"
    yield from assembly.without_result(budget, settings)


def _traced(path: Path, later: Sequence[Path], *, quick: bool) -> tuple[Sequence[Outcome], Confirmed | None]:
    """Effects of a run, and what later runs say about them together.

    The findings are those of a whole trace; where the kind has a quick one, errors that a certificate does not have are
    not computed.
    """
    options = {"quick": True} if quick else {}
    if not later:
        return Data(path).trace(**options).traced.outcomes, None
    from rig.closed_loop.confirm import judge, open_traced  # noqa: PLC0415 - few certificates have it

    first = open_traced(path, **options)
    return first.traced.outcomes, judge(first, *later)


def _doubts(run: _Run) -> Iterator[str]:
    for sensor, one in assembly.doubtful(run.outcomes, run.confirmed):
        yield (
            f"{sensor}: the name of effect {one.effect} is doubtful: {one.doubtful}; confirm it by a further run "
            f"(rig confirm {run.path}), then --confirmed-by"
        )


def _document(
    runs: Sequence[_Run], asked: Asked, settings: CertificateSettings, given: Path, reasons: list[str]
) -> Document | None:
    """The whole document; None if a run has no budget. Missing fields become reasons."""
    budgets = [one.budget for one in runs if one.budget is not None]
    if not budgets:
        return None
    of, missing = [one.of for one in budgets], about.Missing()
    origin = about.Origin(str(asked.equipment or DOCUMENT), str(given), given.parent)
    items, known = about.items(of, settings, origin, missing)
    calibrated, approved = about.people(of[-1], settings, origin, missing, asked.calibrated_by, asked.approved_by)
    laboratory = about.laboratory(of[-1].register, settings, origin, missing)
    place = settings.place or ", ".join(laboratory.party.address)
    if len(asked.runs) > 1:
        missing.reasons.extend(_of_two(budgets, asked.adjustment))
    with_budget = [(one, one.budget) for one in runs if one.budget is not None]
    try:
        statements = [s for one, b in with_budget for s in assembly.statements(b, one.stage, settings)]
    except FitError as error:
        statements = []
        missing.reasons.append(f"no statement of conformity: {error}; correct [decision] in {origin.settings}")
    evidence = tuple(about.evidence(b.of, one.records, one.stage) for one, b in with_budget)
    document = Document(
        number=NUMBER,
        simulated=any(one.table.simulated for one in of),
        laboratory=laboratory,
        customer=about.customer(known, settings, origin, missing),
        items=items,
        place=place,
        dates=Dates(
            max((one.received for one in known if one.received is not None), default=None),
            min(one.began for one in evidence),
            max(one.ended for one in evidence),
            asked.issued,
        ),
        calibrated_by=calibrated,
        approved_by=approved,
        method=about.method(of[-1], settings, origin, missing),
        conditions=tuple(c for one, b in with_budget for c in assembly.conditions(b, one.stage)),
        equipment=about.equipment(of),
        tables=tuple(t for one, b in with_budget for t in assembly.tables(b, one.stage)),
        budgets=tuple(x for one, b in with_budget for x in assembly.budgets(b, one.stage, settings.annex)),
        evidence=evidence,
        statements=tuple(statements),
        effects=tuple(
            e for one, b in with_budget for e in assembly.effects(b, one.outcomes, one.confirmed, one.stage, one.heads)
        ),
        adjustment=asked.adjustment.strip() if len(runs) > 1 else "",
        deviations=tuple(
            d
            for one, b in with_budget
            for d in about.deviations(b.of, one.state, one.stage, (one.register, asked.equipment))
        ),
        notes=tuple(dict.fromkeys(n for _, b in with_budget for n in assembly.notes(b))),
        next_due=settings.next_due,
        remarks=settings.remarks,
        paper=settings.paper,
    )
    reasons.extend(missing.reasons)
    received = document.dates.received
    if received is not None and received > document.dates.began:
        reasons.append(
            f"received on {received}, after the run began on {document.dates.began}: correct sensors.*.received"
        )
    if document.dates.issued < document.dates.ended and not document.simulated:
        reasons.append(f"issued on {document.dates.issued}, before the run ended on {document.dates.ended}")
    if asked.today is not None and document.dates.issued > asked.today and not document.simulated:
        reasons.append(f"issued on {document.dates.issued}, and today is {asked.today} (UTC): correct --issued")
    return document


def _of_two(budgets: Sequence[RunBudget], adjustment: str) -> Iterator[str]:
    """Reasons why two runs are not as found and as left."""
    if not adjustment.strip():
        yield "two runs are as found and as left: say what was adjusted between them, --adjustment"
    if len(budgets) < 2:
        return
    found, left = (one.of.table for one in budgets)
    if found.provenance["run_id"] == left.provenance["run_id"]:
        yield "both files are of the same run: name the run as found, and the run as left"
    elif found.provenance["began_utc"] > left.provenance["began_utc"]:
        yield "the first run is later than the second: name the run as found first"
    if set(found.outputs.values()) != set(left.outputs.values()):
        yield "the two runs have other sensors: as found and as left are of the same ones"


NUMBER = "(no number)"
"""The number of a document that is not issued yet."""


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


@dataclass(frozen=True, eq=False)
class Issued:
    """An issued certificate and its files."""

    document: Document
    files: tuple[Path, ...]

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
    from rig.certificate.as_dcc import dcc  # noqa: PLC0415 - where a certificate is written
    from rig.certificate.html import html  # noqa: PLC0415
    from rig.certificate.pdf import pdf  # noqa: PLC0415

    document = replace(made.document, number=_number(made, how))
    if how.paper:
        document = replace(document, paper=_paper(how.paper))
    if how.amends:
        document = replace(document, amends=amendment(amended(how.out, how.amends), document.to_json(), how.because))
    own = made.folder / made.settings.template if made.settings.template else None
    fonts = made.folder / made.settings.fonts if made.settings.fonts else None
    paper = pdf(document, how.template or own, fonts)
    xml = dcc(document, paper)
    if how.schema is not None:
        _check(xml, how.schema)
    if how.key is not None:
        xml = _signed(xml, how)
    told = json.dumps(document.to_json(), indent=2, ensure_ascii=False, allow_nan=False, default=str)
    forms = {"pdf": paper, "html": html(document).encode(), "xml": xml, "json": told.encode()}
    return Issued(document, tuple(write_once(how.out, document.number, forms)))


def _number(made: Made, how: Issue) -> str:
    if how.number:
        check_free(how.out, check_number(how.number))
        return how.number
    if how.amends:
        return number_of_amendment(how.out, check_number(how.amends))
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


def _signed(xml: bytes, how: Issue) -> bytes:
    from rig.dcc.signature import signed  # noqa: PLC0415

    if how.key is None or how.certificate is None:
        raise UsageError("a signature needs both: --key KEY.pem and --key-certificate CERTIFICATE.pem")
    return signed(xml, how.key, how.certificate)


def all_files(asked: Asked, how: Issue) -> Iterable[Path | None]:
    """Every file that is read, so that none is overwritten."""
    yield from (*asked.runs, asked.equipment, asked.settings, *asked.confirmed_by)
    yield from (how.template, how.key, how.certificate, how.schema)
