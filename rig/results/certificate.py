"""`rig certificate`: of one run, of two runs before and after an adjustment, or of tables in their place."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fitter.errors import FitError
from procedures.errors import DataError
from procedures.shell import shell_word
from rig.certificate import about, assembly, conformity
from rig.certificate.document import Dates, Document, Stage
from rig.certificate.settings import CertificateSettings, read_settings
from rig.closed_loop.budget import Checked, OfRun, RunBudget, budget_of, checked_run
from rig.closed_loop.of_table import OfTable, Said, checked_table, gross_errors, lacks, without_size
from rig.closed_loop.undeclared import with_undeclared
from rig.effects import laboratory_effects
from rig.errors import RigError, UsageError
from rig.plans import CONFORMITY
from rig.register import DOCUMENT, absent
from rig.results.data import Data
from rig.run_file.reader import RunReader
from rig.run_file.state import RunState, read_state
from rig.run_file.verification import verify_file
from rig.tables import is_run

if TYPE_CHECKING:
    from fitter.trace.outcome import Outcome
    from rig.closed_loop.confirm import Confirmed

SETTINGS = "certificate.toml"
NUMBER = "(no number)"
"""The number of a document that is not issued yet."""
_STAGES: Mapping[int, tuple[Stage, ...]] = {1: ("",), 2: ("as found", "as left")}


class Refused(UsageError):
    """No certificate is made, for these reasons."""

    def __init__(self, runs: Sequence[Path], reasons: Sequence[str]) -> None:
        self.reasons = tuple(dict.fromkeys(reasons))
        listed = "\n".join(f"- {one}" for one in self.reasons)
        names = " and ".join(map(str, runs))
        count = "1 reason" if len(self.reasons) == 1 else f"{len(self.reasons)} reasons"
        super().__init__(f"no certificate is made of {names}; {count}:\n{listed}")


@dataclass(frozen=True)
class Asked:
    """The contents of a certificate, as asked for.

    Attributes:
        runs: one run file, or CSV table, or two: as found, as left.
        issued: date of issue.
        equipment: another register than the one kept with the runs.
        settings: certificate.toml; None for that in the working folder.
        confirmed_by: later runs that confirm effects of the last run.
        calibrated_by: instead of that of the settings.
        approved_by: instead of that of the settings.
        adjustment: between as found and as left, a sentence.
        traced: whether results are of the model with the effects that the trace finds, also where no further run
            confirmed them.
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
    traced: bool = False


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
    """One run, as far as it could be read; a table has no state."""

    path: Path
    stage: Stage
    state: RunState | None = None
    records: int = 0
    dry: bool = False
    register: str | None = None
    conformity: str | None = None
    of: OfRun | None = None
    budget: RunBudget | None = None
    outcomes: Sequence[Outcome] = ()
    confirmed: Confirmed | None = None
    heads: Mapping[Path, str] = field(default_factory=dict)
    stated: bool = False
    accepted: bool = False
    said: tuple[str, ...] = ()


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
    document = _document([one for one in runs if one is not None], asked, settings, given, reasons)
    if reasons or document is None:
        raise Refused(asked.runs, reasons)
    return Made(document, settings, given.parent, tuple(one.budget for one in runs if one and one.budget))


def _read(path: Path, stage: Stage, asked: Asked, settings: CertificateSettings, reasons: list[str]) -> _Run | None:
    """A run, verified, budgeted and traced; None if it cannot be read at all."""
    if not is_run(path):
        return _read_table(path, stage, asked, settings, reasons)
    found = verify_file(path)
    if not found.whole:
        reasons.append(f"{path} is not verified: {found.findings[0]}; see rig verify")
        return None
    with RunReader.open(path) as reader:
        dry, documents = reader.about().runs_dry, reader.documents()
        state = read_state(reader)
    run = _Run(path, stage, state, found.records, dry, documents.get(DOCUMENT), documents.get(CONFORMITY))
    if state.ended != "complete":
        reasons.append(f"{path} is not complete: {state.remaining} points are missing; rig resume {shell_word(path)}")
    later = asked.confirmed_by if path == asked.runs[-1] else ()
    with _noted(reasons):
        _checked(run, asked, reasons)
    if state.ended == "complete":  # the effects of half a run are others in a moment
        with _noted(reasons):
            _trace(run, later, reasons)
    with _noted(reasons):
        _budget(run, asked, settings, reasons)
    return run


def _read_table(
    path: Path, stage: Stage, asked: Asked, settings: CertificateSettings, reasons: list[str]
) -> _Run | None:
    """The same of a CSV table: the settings say what a run file would."""
    given, own = asked.settings or Path(SETTINGS), settings.table
    if own is None:
        reasons.append(
            f"{path} is no run file, and {given} has no [table]: it says when the table was measured, its models, and "
            "what gives its columns (docs/certificate.md)"
        )
        return None
    if path == asked.runs[-1]:
        reasons.extend(f"{one}: --confirmed-by is for runs; {path} is a table" for one in asked.confirmed_by)
    run = _Run(path, stage)
    said = Said(own.began, own.ended or own.began, own.models, own.given_by, str(given))
    with _noted(reasons):
        _take(run, checked_table(path, said, asked.equipment, given.parent), reasons)
    if run.of is not None:
        with _noted(reasons):
            kind, source = run.of.kind, OfTable(run.of.table)
            fitted = kind.fit(source, kind.fit_options(), leave_out=(), own=(), keep=False)
            run.outcomes = kind.trace(source, kind.trace_options(), own=laboratory_effects()).outcomes
            gross = list(gross_errors(fitted.to_json(), run.outcomes, own.keep, str(given)))
            run.said += tuple(told for kept, told in gross if kept)
            reasons.extend(told for kept, told in gross if not kept)
    unsized = list(without_size(run.outcomes, run.of.table, str(given))) if run.of else []
    reasons.extend(unsized)
    if not unsized:
        with _noted(reasons):
            _budget(run, asked, settings, reasons)
    return run


@contextmanager
def _noted(reasons: list[str]) -> Iterator[None]:
    """Lines of an error become reasons."""
    try:
        yield
    except (RigError, DataError, FitError) as error:
        reasons.extend(str(error).splitlines())


def _checked(run: _Run, asked: Asked, reasons: list[str]) -> None:
    _take(run, checked_run(run.path, asked.equipment), reasons)


def _take(run: _Run, checked: Checked, reasons: list[str]) -> None:
    reasons.extend(checked.reasons)
    run.of, run.stated = checked.of, checked.stated
    run.said += checked.untold
    if run.of.register.example and not run.of.table.simulated:
        reasons.append(f"the register {run.of.register.name!r} has example values: state those of your equipment")


def _budget(run: _Run, asked: Asked, settings: CertificateSettings, reasons: list[str]) -> None:
    """Budgets by the accepted model; otherwise by the declared one, with the size of the effects that it lacks."""
    if run.of is None:
        return
    found = tuple(dict.fromkeys(one.effect for o in run.outcomes for one in o.named if one.kind == "effect"))
    run.accepted = bool(found) and (asked.traced or assembly.all_confirmed(found, run.confirmed))
    more: dict[str, Any] = {
        "at": settings.at,
        "same_meter": settings.same_meter,
        "probability": settings.probability,
        "shapes": assembly.shapes(settings.probability),
    }
    made = budget_of(run.of, **more, options={"traced": True} if run.accepted else None)
    if found and not run.accepted:
        with_effects = budget_of(run.of, **more, options={"traced": True})
        made = with_undeclared(made, with_effects, found, more["shapes"])
    run.budget = made
    reasons.extend(_of_budget(made, settings, str(asked.settings or SETTINGS), stated=run.stated))


def _trace(run: _Run, later: Sequence[Path], reasons: list[str]) -> None:
    verified = [verify_file(one) for one in later]
    broken = [(one, v.findings[0]) for one, v in zip(later, verified, strict=True) if not v.whole]
    reasons.extend(f"{one} is not verified: {finding}; see rig verify" for one, finding in broken)
    if broken or run.of is None:
        return
    run.heads = {one: v.head for one, v in zip(later, verified, strict=True)}
    run.outcomes, run.confirmed = _traced(run.path, later, quick="quick" in run.of.kind.trace_options.model_fields)
    reasons.extend(_doubts(run))


def _of_budget(budget: RunBudget, settings: CertificateSettings, where: str, *, stated: bool) -> Iterator[str]:
    for point in budget.outside:
        yield f"{point}; correct `at`"
    yield from conformity.without_result(budget, settings, where)
    if not stated:
        return
    for name in assembly.repeatability_only(budget):
        yield f"{name}: its uncertainty is repeatability only; state the errors of its instruments in the register"
    table = budget.of.table
    for column in budget.unstated:
        if column in table.outputs or column in table.factors:
            yield f"{column}: the register states no error of what reads or sets it; add what its certificate says"


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
    told = {} if run.confirmed is None else {one.effect: one.verdict for one in run.confirmed.answers}
    for sensor, one in assembly.doubtful(run.outcomes, run.confirmed):
        doubt = f"{sensor}: the name of effect {one.effect} is doubtful: {one.doubtful}"
        yield f"{doubt}; {_next_run(run, told.get(one.effect, ''))}"


def _next_run(run: _Run, verdict: str) -> str:
    """What to run next for a doubtful name, by the verdict of the further runs that were given; "" without any."""
    dry, confirm = " --dry" if run.dry else "", f"rig confirm {shell_word(run.path)}"
    if run.confirmed is None or not verdict:
        return f"confirm it by a further run ({confirm}{dry}), then --confirmed-by"
    paths = run.confirmed.paths
    files = " and ".join(path.name for path in paths)
    by, after, given = (
        " ".join(f"--{o} {shell_word(path)}" for path in paths) for o in ("by", "after", "confirmed-by")
    )
    if verdict == "none holds":
        return (
            f"by {files} it is none of the causes that were looked for, or it changed between the runs: no certificate "
            f"is made of this run. {confirm} {by} shows why; find the cause, then calibrate again"
        )
    return (
        f"{files} did not confirm it (verdict: {verdict}): make the next run ({confirm} {after}{dry}), "
        f"then {given} --confirmed-by NEXT_RUN"
    )


def _document(
    runs: Sequence[_Run], asked: Asked, settings: CertificateSettings, given: Path, reasons: list[str]
) -> Document | None:
    """The whole document; None if a run has no budget. Missing fields become reasons."""
    missing = about.Missing(reasons)
    origin = about.Origin(str(asked.equipment or DOCUMENT), str(given), given.parent)
    about.settled(settings, origin, missing, asked.approved_by)
    if settings.next_due is not None and settings.next_due <= asked.issued:
        reasons.append(f"next_due = {settings.next_due} is not after the date of issue, {asked.issued}: correct it")
    pairs = [(one, one.of) for one in runs if one.of is not None]
    of = [one for _, one in pairs]
    if not of:
        return None
    items, known = about.items(of, settings, origin, missing)
    calibrated, approved = about.people(of[-1], settings, origin, missing, asked.calibrated_by, asked.approved_by)
    laboratory = about.laboratory(of[-1].register, settings, origin, missing)
    customer = about.customer(known, settings, origin, missing)
    place = settings.place or ", ".join(laboratory.party.address)
    evidence = tuple(about.evidence(of_run, one.records, one.stage) for one, of_run in pairs)
    simulated = any(one.table.simulated for one in of)
    dates = Dates(
        max((one.received for one in known if one.received is not None), default=None),
        min(one.began for one in evidence),
        max(one.ended for one in evidence),
        asked.issued,
    )
    reasons.extend(_of_dates(dates, None if simulated else asked.today, simulated=simulated))
    if len(asked.runs) > 1:
        reasons.extend(_of_two(of, asked.adjustment))
    with_budget = [(one, one.budget) for one in runs if one.budget is not None]
    try:
        statements = [s for one, b in with_budget for s in conformity.statements(b, one.stage, settings)]
    except FitError as error:
        statements = []
        reasons.append(f"no statement of conformity: {error}; correct [decision] in {origin.settings}")
    if len(with_budget) < len(asked.runs):
        return None
    return Document(
        number=NUMBER,
        simulated=simulated,
        laboratory=laboratory,
        customer=customer,
        items=items,
        place=place,
        dates=dates,
        calibrated_by=calibrated,
        approved_by=approved,
        method=about.method(of[-1], settings),
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
        deviations=(
            *(
                d
                for one, b in with_budget
                for d in (
                    (*lacks(b.of.table, b.of.config, origin.register), *one.said)
                    if one.state is None
                    else (*about.deviations(b.of, one.state, one.stage, (one.register, asked.equipment)), *one.said)
                )
            ),
            *(
                d
                for one in runs
                if one.state is not None
                for d in conformity.since_recorded(one.conformity, settings, f" ({one.stage})" if one.stage else "")
            ),
            *dict.fromkeys(d for one in of for d in absent(one.register, one.config)),
        ),
        notes=tuple(dict.fromkeys(n for _, b in with_budget for n in assembly.notes(b))),
        next_due=settings.next_due,
        remarks=settings.remarks,
        paper=settings.paper,
        models=tuple(
            m for one, b in with_budget for m in assembly.models(b, one.stage, one.outcomes, accepted=one.accepted)
        ),
    )


def _of_dates(dates: Dates, today: date | None, *, simulated: bool) -> Iterator[str]:
    """Dates that cannot be; a simulated run has a calendar of its own."""
    if dates.received is not None and dates.received > dates.began:
        yield f"received on {dates.received}, after the run began on {dates.began}: correct sensors.*.received"
    if dates.issued < dates.ended and not simulated:
        yield f"issued on {dates.issued}, before the run ended on {dates.ended}"
    if today is not None and dates.issued > today:
        yield f"issued on {dates.issued}, and today is {today} (UTC): correct --issued"


def _of_two(runs: Sequence[OfRun], adjustment: str) -> Iterator[str]:
    """Reasons why two runs are not as found and as left."""
    if not adjustment.strip():
        yield "two runs are as found and as left: say what was adjusted between them, --adjustment"
    if len(runs) < 2:
        return
    found, left = (one.table for one in runs)
    if found.provenance["head"] == left.provenance["head"]:
        yield "both files are of the same run: name the run as found, and the run as left"
    elif found.provenance["began_utc"] > left.provenance["began_utc"]:
        yield "the first run is later than the second: name the run as found first"
    if set(found.outputs.values()) != set(left.outputs.values()):
        yield "the two runs have other sensors: as found and as left are of the same ones"
