"""`rig certificate`: of one run, of two runs before and after an adjustment, or of tables in their place."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path

from rig.bench.config import read_text
from rig.errors import UsageError
from rig.fitter.errors import FitError
from rig.procedures.present.shell import shell_word
from rig.register import DOCUMENT, absent, needed, unrecorded
from rig.tables.table_of_run import run_table
from rig.verbs.budget.evaluation import OfRun, RunBudget
from rig.verbs.budget.found import Found
from rig.verbs.certificate import conformity, of_others
from rig.verbs.certificate import parts_in_numbers as numbers
from rig.verbs.certificate import parts_in_words as words
from rig.verbs.certificate.document import Dates, Document, Evidence
from rig.verbs.certificate.measured import Stage
from rig.verbs.certificate.request import CertificateRequest
from rig.verbs.certificate.runs import CertifiedRun, read_run
from rig.verbs.certificate.settings import CertificateSettings, read_settings
from rig.verbs.data.of_table import lacks

NUMBER = "(no number)"
"""The number of a document that is not issued yet."""
_STAGES: Mapping[int, tuple[Stage, ...]] = {1: ("",), 2: ("as found", "as left")}


class Refused(UsageError):
    """No certificate is made, for these reasons; the command ends in `ExitCode.USAGE`."""

    def __init__(self, runs: Sequence[Path], reasons: Sequence[str], kept: str = "") -> None:
        self.reasons = tuple(dict.fromkeys(reasons))
        listed = "\n".join(f"- {one}" for one in self.reasons)
        names = " and ".join(map(str, runs))
        count = "1 reason" if len(self.reasons) == 1 else f"{len(self.reasons)} reasons"
        super().__init__(f"no certificate is made of {names}; {count}:\n{listed}" + (f"\n{kept}" if kept else ""))


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


def make(asked: CertificateRequest) -> Made:
    """A certificate as data.

    Raises:
        Refused: with all reasons why none is made.
        UsageError: there are not one or two runs.
        ConfigurationError: the settings cannot be read.
    """
    if len(asked.runs) not in _STAGES:
        raise UsageError(f"a certificate is made of one run, or of two (as found, as left), not of {len(asked.runs)}")
    given = asked.settings_file
    settings = read_settings(given) if asked.settings is not None or given.exists() else CertificateSettings()
    reasons: list[str] = []
    runs = [
        read_run(path, stage, asked, settings, reasons)
        for path, stage in zip(asked.runs, _STAGES[len(asked.runs)], strict=True)
    ]
    document = _document([one for one in runs if one is not None], asked, settings, given, reasons)
    if reasons or document is None:
        raise Refused(asked.runs, reasons, "" if asked.equipment else _of_kept([one for one in runs if one], reasons))
    return Made(document, settings, given.parent, tuple(one.budget for one in runs if one and one.budget))


def _of_kept(runs: Sequence[CertifiedRun], reasons: Sequence[str]) -> str:
    """That reasons are of the register as it was when a run began, and how another is taken; "" if none is."""
    run = next((one for one in runs if one.register is not None), None)
    if run is None or not any(DOCUMENT in one or "the register" in one for one in reasons):
        return ""
    own = (run.of.config.equipment if run.of else "") or DOCUMENT
    places = [folder / own for folder in (Path(), *run.path.parents[:2])]
    said = f"{DOCUMENT} and the register are those kept in {run.path} when it began"
    file = next((one for one in places if one.is_file()), None)
    if file is None:
        return f"{said}: --equipment FILE takes a corrected one"
    now = read_text(file, "equipment").strip() == (run.register or "").strip()
    again = ", or make the dry run again" if run.dry else ""
    do = f"correct {file}; then" if now else f"{file} is different now:"
    return f"{said}; {do} --equipment {shell_word(file)} takes it{again}"


def _document(
    runs: Sequence[CertifiedRun],
    asked: CertificateRequest,
    settings: CertificateSettings,
    given: Path,
    reasons: list[str],
) -> Document | None:
    """The whole document; None if a run has no budget. Missing fields become reasons."""
    missing = words.Missing(reasons)
    origin = words.Origin(str(asked.equipment or DOCUMENT), str(given), given.parent)
    words.settled(settings, origin, missing, asked.approved_by)
    if settings.next_due is not None and settings.next_due <= asked.issued:
        reasons.append(f"next_due = {settings.next_due} is not after the date of issue, {asked.issued}: correct it")
    pairs = [(one, one.of) for one in runs if one.of is not None]
    of = [one for _, one in pairs]
    if not of:
        return None
    sensors = {name: of[-1].config.sensors.get(name) for name in of[-1].table.outputs.values()}
    reasons.extend(needed(of[-1].register, sensors, origin.register))
    items, known = words.items(of, settings)
    calibrated, approved = words.people(of[-1], settings, origin, missing, asked.calibrated_by, asked.approved_by)
    laboratory = words.laboratory(of[-1].register, settings, origin, missing)
    customer = words.customer(known, settings, origin, missing)
    place = settings.place or ", ".join(laboratory.party.address)
    evidence = tuple(told for one, of_run in pairs for told in _evidence(one, of_run))
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
        method=words.method(of[-1], settings),
        conditions=tuple(c for one, b in with_budget for c in numbers.conditions(b, one.stage)),
        holdings=tuple(h for one, b in with_budget for h in numbers.holdings(b, one.stage)),
        external=tuple(of_others.external(items, known)),
        supplied=tuple(of_others.supplied(items, known, of, settings)),
        equipment=words.equipment(of),
        tables=tuple(t for one, b in with_budget for t in numbers.tables(b, one.stage)),
        budgets=tuple(x for one, b in with_budget for x in numbers.budgets(b, one.stage, settings.annex)),
        evidence=evidence,
        statements=tuple(statements),
        effects=tuple(
            e for one, b in with_budget for e in numbers.effects(b, one.outcomes, one.confirmed, one.stage, one.heads)
        ),
        adjustment=asked.adjustment.strip() if len(runs) > 1 else "",
        deviations=(
            *(
                d
                for one, b in with_budget
                for d in (
                    (*lacks(b.of.table, b.of.config, origin.register), *one.said)
                    if one.state is None
                    else (
                        *words.deviations(b.of, one.state, one.stage, (one.register, asked.equipment)),
                        *_of_added(one, b.of),
                        *one.said,
                    )
                )
            ),
            *(
                d
                for one in runs
                if one.state is not None
                for d in conformity.since_recorded(one.conformity, settings, f" ({one.stage})" if one.stage else "")
            ),
        ),
        unstated=tuple(dict.fromkeys(d for one in of for d in absent(one.register, one.config))),
        unrecorded=tuple(dict.fromkeys(d for one in of for d in unrecorded(one.config, asked.room))),
        notes=tuple(dict.fromkeys(n for one, b in with_budget for n in numbers.notes(b, one.confirmed, one.ignored))),
        next_due=settings.next_due,
        remarks=settings.remarks,
        paper=settings.paper,
        models=tuple(
            m for one, b in with_budget for m in numbers.models(b, one.stage, Found(one.outcomes, one.confirmed))
        ),
    )


def _evidence(run: CertifiedRun, of: OfRun) -> Iterator[Evidence]:
    """The run file, and those of added replications."""
    if not run.added:
        yield words.evidence(of, run.records, run.stage)
        return
    for path, records in [(run.path, run.records), *((one.path, one.records) for one in run.added)]:
        yield words.evidence(replace(of, table=run_table(path)), records, run.stage)


def _of_added(run: CertifiedRun, of: OfRun) -> Iterator[str]:
    """That runs were added, and departures from the procedure in them."""
    if not run.added:
        return
    files = ", ".join(one.path.name for one in run.added)
    yield f"Added to it, and evaluated with it as one run, are runs of their own: {files}."
    for one in run.added:
        own = replace(of, table=run_table(one.path), corrected=())
        told = words.deviations(own, one.state, run.stage, (None, None))
        yield from (f"{one.path.name}: {sentence}" for sentence in told)


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
