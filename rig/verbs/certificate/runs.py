"""A run of a certificate, as far as it can be read: verified, traced and budgeted, with all reasons against it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rig.effects import laboratory_effects
from rig.errors import RigError
from rig.fitter.effects.history import NOTHING
from rig.fitter.errors import FitError
from rig.procedures.errors import DataError
from rig.procedures.present.shell import confirming, shell_word
from rig.register import DOCUMENT, KnownConditions, check_surroundings, stopping
from rig.run_file.read.reader import RunReader
from rig.run_file.state.state import RunState, read_state
from rig.run_file.verify.verification import verify_file
from rig.runs.plans import CONFORMITY
from rig.tables import is_run
from rig.verbs.budget.evaluation import Checked, OfRun, RunBudget, checked_run, shapes_at
from rig.verbs.budget.found import Found, budget_with, found_in
from rig.verbs.certificate import conformity
from rig.verbs.certificate import parts_in_numbers as assembly
from rig.verbs.certificate.measured import Stage
from rig.verbs.certificate.settings import CertificateSettings
from rig.verbs.data.of_table import OfTable, Said, checked_table, gross_errors, without_size

if TYPE_CHECKING:
    from rig.fitter.trace.outcome import Outcome
    from rig.verbs.certificate.request import CertificateRequest
    from rig.verbs.confirm import Confirmed


@dataclass(frozen=True)
class Added:
    """A replication that was added to a run: its file, its state, and the number of its records."""

    path: Path
    state: RunState
    records: int


@dataclass
class CertifiedRun:
    """One run, as far as it could be read; a table has no state. `added` are replications that were added to it."""

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
    ignored: tuple[str, ...] = ()
    heads: Mapping[Path, str] = field(default_factory=dict)
    stated: bool = False
    said: tuple[str, ...] = ()
    added: tuple[Added, ...] = ()


def read_run(
    path: Path, stage: Stage, asked: CertificateRequest, settings: CertificateSettings, reasons: list[str]
) -> CertifiedRun | None:
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
    run = CertifiedRun(path, stage, state, found.records, dry, documents.get(DOCUMENT), documents.get(CONFORMITY))
    if state.ended != "complete":
        reasons.append(f"{path} is not complete: {state.remaining} points are missing; rig resume {shell_word(path)}")
    later, added = (asked.confirmed_by, asked.added) if path == asked.runs[-1] else ((), ())
    run.added = tuple(_added(added, reasons))
    if len(run.added) < len(added):
        return run
    with _noted(reasons):
        _checked(run, asked, reasons)
    if state.ended == "complete":  # the effects of half a run are others in a moment
        with _noted(reasons):
            _trace(run, later, asked, reasons)
    with _noted(reasons):
        _budget(run, asked, settings, reasons)
    return run


def _added(paths: Sequence[Path], reasons: list[str]) -> Iterator[Added]:
    """Replications that were added, as far as they are whole and complete."""
    for path in paths:
        found = verify_file(path)
        if not found.whole:
            reasons.append(f"{path} is not verified: {found.findings[0]}; see rig verify")
            continue
        with RunReader.open(path) as reader:
            state = read_state(reader)
        if state.ended != "complete":
            missing = f"{state.remaining} points are missing; rig resume {shell_word(path)}"
            reasons.append(f"{path} is not complete: {missing}")
            continue
        yield Added(path, state, found.records)


def _read_table(
    path: Path, stage: Stage, asked: CertificateRequest, settings: CertificateSettings, reasons: list[str]
) -> CertifiedRun | None:
    """Read a CSV table like a run: the settings say what a run file would."""
    given, own = asked.settings_file, settings.table
    if own is None:
        reasons.append(
            f"{path} is no run file, and {given} has no [table]: it says when the table was measured, its models, and "
            "what gives its columns (docs/how_to/certificate.md)"
        )
        return None
    if path == asked.runs[-1]:
        reasons.extend(f"{one}: --confirmed-by is for runs; {path} is a table" for one in asked.confirmed_by)
    run = CertifiedRun(path, stage)
    said = Said(own.began, own.ended or own.began, own.models, own.given_by, str(given), own.room)
    with _noted(reasons):
        _take(run, checked_table(path, said, asked.equipment, given.parent), asked, reasons)
    if run.of is not None:
        with _noted(reasons):
            kind, source = run.of.kind, OfTable(run.of.table)
            fitted = kind.fit(source, kind.fit_options(), leave_out=(), own=NOTHING, keep=False)
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


def _checked(run: CertifiedRun, asked: CertificateRequest, reasons: list[str]) -> None:
    more = [one.path for one in run.added]
    _take(run, checked_run(run.path, asked.equipment, more), asked, reasons)


def _take(run: CertifiedRun, checked: Checked, asked: CertificateRequest, reasons: list[str]) -> None:
    reasons.extend(checked.reasons)
    run.of, run.stated = replace(checked.of, told=replace(checked.of.told, stated=asked.room)), checked.stated
    with _noted(reasons):
        stated = KnownConditions(stated=asked.room)
        check_surroundings(run.of.register, run.of.config, {}, stated, str(asked.equipment or DOCUMENT))
    run.said += checked.untold
    if run.of.register.example and not run.of.table.simulated:
        reasons.append(f"the register {run.of.register.name!r} has example values: state those of your equipment")


def _budget(run: CertifiedRun, asked: CertificateRequest, settings: CertificateSettings, reasons: list[str]) -> None:
    """Budgets by the rule of `budget_with`."""
    if run.of is None:
        return
    more: dict[str, Any] = {
        "at": settings.at,
        "same_meter": settings.same_meter,
        "probability": settings.probability,
        "shapes": shapes_at(settings.probability),
    }
    run.budget = budget_with(run.of, Found(run.outcomes, run.confirmed, run.ignored), more, traced=asked.traced)
    reasons.extend(_of_budget(run.budget, settings, str(asked.settings_file), stated=run.stated))


def _trace(run: CertifiedRun, later: Sequence[Path], asked: CertificateRequest, reasons: list[str]) -> None:
    verified = [verify_file(one) for one in later]
    broken = [(one, v.findings[0]) for one, v in zip(later, verified, strict=True) if not v.whole]
    reasons.extend(f"{one} is not verified: {finding}; see rig verify" for one, finding in broken)
    if broken or run.of is None:
        return
    told = {"ignore": list(asked.ignore)} if asked.ignore else {}
    run.heads = {one: v.head for one, v in zip(later, verified, strict=True)}
    found = found_in(run.of, run.path, later, asked.equipment, **told)
    run.outcomes, run.confirmed, run.ignored = found.outcomes, found.confirmed, found.ignored
    reasons.extend(_doubts(run))


def _of_budget(budget: RunBudget, settings: CertificateSettings, where: str, *, stated: bool) -> Iterator[str]:
    for point in budget.outside:
        yield f"{point}; correct `at`"
    yield from conformity.without_result(budget, settings, where)
    if not stated:
        return
    if said := assembly.repeatability_only(budget):
        yield f"{said}; state the errors of the instruments in the register"
    yield from stopping(budget.unstated, budget.of.table.outputs, budget.of.table.factors, budget.of.stated.lacking)


def _doubts(run: CertifiedRun) -> Iterator[str]:
    """One reason for all effects and sensors with the same doubt and the same next run."""
    told = {} if run.confirmed is None else {one.effect: one.verdict for one in run.confirmed.answers}
    names = {} if run.of is None else run.of.table.outputs
    alike: dict[tuple[str, str], list[tuple[str, str]]] = {}
    for sensor, one in assembly.doubtful(run.outcomes, run.confirmed):
        why = one.doubtful or "", _next_run(run, told.get(one.effect, ""))
        alike.setdefault(why, []).append((names.get(sensor, sensor), one.effect))
    for (doubt, next_run), pairs in alike.items():
        sensors, effects = (dict.fromkeys(names) for names in zip(*pairs, strict=True))
        of = f"the name of effect {next(iter(effects))} is" if len(effects) == 1 else "names of effects are"
        which = "" if len(effects) == 1 else f" ({', '.join(effects)})"
        yield f"{', '.join(sensors)}: {of} doubtful{which}: {doubt}; {next_run}"


def _next_run(run: CertifiedRun, verdict: str) -> str:
    """What to run next for a doubtful name, by the verdict of the further runs that were given; "" without any."""
    dry, confirm = " --dry" if run.dry else "", confirming(run.path, run.ignored)
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
