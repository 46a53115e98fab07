"""The traced run, with everything that a further run needs."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rig.bench.config import BenchConfig, parse_toml
from rig.by_kind import Traced, known, trace_table
from rig.errors import UsageError
from rig.files.toml_text import toml_text
from rig.fitter.confirm import Later, Question, questions_of
from rig.fitter.effects.manual_changes import Done
from rig.options_of_kinds import chosen
from rig.procedures.evaluate.confirming import Confirming
from rig.procedures.kind import Procedure
from rig.procedures.kinds import kind_of
from rig.procedures.present.shell import confirming, shell_word
from rig.procedures.tables.table import Table
from rig.run_file.events.by_hand import DoneByHand
from rig.run_file.read.reader import RunReader
from rig.runs.plans import plan_of
from rig.tables import FileSource
from rig.tables.table_of_run import run_table

DAY_S = 86400.0


@dataclass(frozen=True, eq=False)
class First:
    """A traced run.

    Attributes:
        path: the run file.
        traced: result of the trace.
        confirming: functions of its kind for further runs.
        questions: one per effect found; after further runs those that they leave open.
        documents: texts of its files.
        procedure: its procedure.
        bench: its bench.
        dry: whether it used twins.
        began_utc_s: time of its begin.
        world_s: age of its simulated world at the begin.
        read: gives the table of a run file, that of later runs, too.
        begins_s: seconds from its begin to that of the next further run; None for the same time of a later day.
        most_h: longest bench time of a further run, hours.
        ignore: columns that its trace did not look at.
    """

    path: Path
    traced: Traced
    confirming: Confirming
    questions: tuple[Question, ...]
    documents: Mapping[str, str]
    procedure: Procedure
    bench: BenchConfig
    dry: bool
    began_utc_s: float
    world_s: float
    read: Callable[[Path], Table] = run_table
    begins_s: float | None = None
    most_h: float = math.inf
    ignore: tuple[str, ...] = ()

    @property
    def command(self) -> str:
        """The command that confirms what was found in it, to which options are added."""
        return confirming(self.path, self.ignore)

    @property
    def simulated(self) -> bool:
        """Whether no real instrument was involved."""
        return self.traced.table.simulated

    def shared(self, effect: str) -> str:
        """That all sensors have an effect alike, and what would tell them from what they share; "" if not."""
        return next((f.shared for one in self.traced.outcomes for f in one.findings if f.effect == effect), "")

    @property
    def later_s(self) -> float:
        """Seconds from its begin to that of the next run: the same time of a later day, after its end and that of
        further runs, unless `begins_s` says another time.
        """
        if self.begins_s is not None:
            return self.begins_s
        last = Later(self.confirming.data, 0.0)
        last = max((last, *self.confirming.earlier), key=lambda run: run.after_s)
        return DAY_S * float(np.ceil((last.after_s + last.data.elapsed_s.max() + 3600.0) / DAY_S))


def check_run_file(path: Path) -> None:
    """Refuse a table. Raises `UsageError`."""
    if path.suffix == ".csv":
        raise UsageError(
            f"{path} is not a run file: a further run needs the bench of the first, which only a run file contains"
        )


def check_way(path: Path, *, dry: bool, rehearsed: bool, world: bool) -> None:
    """Refuse a further run on another sort of bench than that of the first run: it is known before the trace.

    Args:
        path: the first run.
        dry: whether simulated instruments are permitted.
        rehearsed: whether the further run is made on them.
        world: whether their world file is given.

    Raises:
        UsageError: it is no run file, one is simulated and the other is not, or the world of the first is not known.
    """
    check_run_file(path)
    with RunReader.open(path) as reader:
        run, has_world = reader.about(), "world.toml" in reader.documents()
    if run.runs_dry and not dry:
        raise UsageError(f"{path} is a dry run; a run that confirms it must be a dry run too: add --dry")
    if rehearsed and not run.simulated:
        raise UsageError(
            f"{path} was made on real instruments: simulated readings do not describe it. Omit --dry, or "
            f"rehearse with --write FILE and `rig run FILE --dry`"
        )
    if rehearsed and not (run.runs_dry or has_world or world):
        raise UsageError(
            f"{path} was made over `rig sim`, and does not hold its world: name the world file that was given to "
            f"`rig sim` with --world; in another world nothing that was found needs to hold"
        )


_TRACED: ContextVar[dict[tuple[Any, ...], Traced] | None] = ContextVar("traces", default=None)


@contextmanager
def traces_kept() -> Iterator[None]:
    """A context in which the same columns of the same run file, with the same options, are traced once; also those of
    a context around it.
    """
    token = _TRACED.set({} if (kept := _TRACED.get()) is None else kept)
    try:
        yield
    finally:
        _TRACED.reset(token)


def _traced(path: Path, table: Table, options: Mapping[str, Any]) -> Traced:
    kept = _TRACED.get()
    if kept is None:
        return trace_table(table, **options)
    columns = hashlib.sha256()
    for name, values in table.columns.items():
        columns.update(name.encode() + values.tobytes())
    key = path.resolve(), columns.digest(), repr(sorted(options.items()))
    if key not in kept:
        kept[key] = trace_table(table, **options)
    return kept[key]


CONFIRMS = "confirms.toml"
"""Document of a further run: what was told to the trace that it confirms."""


def told_to_trace(first: First) -> dict[str, str]:
    """That document, by its name; {} if nothing was told."""
    if not first.ignore:
        return {}
    return {CONFIRMS: toml_text({"run": first.traced.table.provenance["run_id"], "ignore": list(first.ignore)})}


def ignored_by(later: Iterable[Path]) -> tuple[str, ...]:
    """Columns that were ignored by the trace that these further runs were made to confirm, as they have recorded it."""
    found: dict[str, None] = {}
    for path in later:
        with RunReader.open(path) as reader:
            told = parse_toml(reader.documents().get(CONFIRMS, ""), f"{path} ({CONFIRMS})")
        found |= dict.fromkeys(told.get("ignore", ()))
    return tuple(found)


def open_traced(
    path: Path, read: Callable[[Path], Table] = run_table, /, later: Sequence[Path] = (), **options: Any
) -> First:
    """Trace a run.

    Args:
        path: its run file.
        read: gives the table of a run file.
        later: further runs that will judge it; columns that their confirmation ignored are ignored, unless options say
            which.
        options: of `rig trace` that the run's kind declares. Without the error on rows left out, unless they have
            `quick=False`: further runs are the better test of what was found.

    Raises:
        UsageError: it is no run file, or its rows do not determine the declared model.

    """
    check_run_file(path)
    table = read(path)
    with RunReader.open(path) as reader:
        documents, run, began_utc_s = reader.documents(), reader.about(), reader.genesis().utc_s
    plan = plan_of(documents, dry=run.runs_dry, stored=True)
    kind = kind_of(plan.procedure)
    if "quick" in kind.trace_options.model_fields:
        options.setdefault("quick", True)
    if "ignore" in kind.trace_options.model_fields and not options.get("ignore") and (ignored := ignored_by(later)):
        options["ignore"] = list(ignored)
    reason = kind.cannot_confirm(table, kind.trace_options(**options))
    if reason:
        raise UsageError(f"{path}: {reason}")
    traced, live = _traced(path, table, options), plan.bench.live
    confirming = kind.confirming(traced)
    if confirming is None:
        raise UsageError(f"{path}: no further run is made of {kind.title}")
    return First(
        path=path,
        traced=traced,
        confirming=confirming,
        questions=questions_of(confirming.found),
        documents=documents,
        procedure=plan.procedure,
        bench=plan.bench,
        dry=plan.dry,
        began_utc_s=began_utc_s,
        world_s=began_utc_s - live.epoch_utc if live is not None else run.world_start_s or 0.0,
        read=read,
        ignore=tuple(options.get("ignore") or ()),
    )


def open_asked(path: Path, given: Mapping[str, Any], later: Sequence[Path] = ()) -> First:
    """A run, traced with those of the given options that its kind declares; `later` and errors as for `open_traced`."""
    check_run_file(path)
    _, options = chosen(FileSource(path), given, lambda kind: kind.trace_options)
    return open_traced(path, later=later, **options.model_dump(exclude_unset=True))


def read_later(first: First, path: Path, *, anywhen: bool = False) -> Later:
    """A later run; with `anywhen` also an earlier one, as if it had been made as long after.

    Raises:
        UsageError: it has another kind, began before the first, or only one of them is simulated.
    """
    table = first.read(path)
    kind, of_first = known(table).name, known(first.traced.table).name
    if kind != of_first:
        raise UsageError(
            f"{path} is a {kind} run and {first.path} a {of_first} run: name a run of the same kind on the same bench; "
            f"{first.command} --list shows those that would confirm it"
        )
    if not table.provenance["complete"]:
        raise UsageError(f"{path} is not complete: rig resume {shell_word(path)}, then repeat this command")
    if table.provenance["bench"] != first.traced.table.provenance["bench"]:
        raise UsageError(
            f"{path} was made on bench {table.provenance['bench']}, {first.path} on "
            f"{first.traced.table.provenance['bench']}: effects of a head or a line are confirmed on the same bench; "
            f"{first.command} --list shows the runs that would confirm them"
        )
    with RunReader.open(path) as reader:
        simulated, began_utc_s = reader.about().simulated, reader.genesis().utc_s
        changes = [
            (record.event.change, record.elapsed_s)
            for record in reader.records(DoneByHand.kind)
            if isinstance(record.event, DoneByHand)
        ]
    if simulated != first.simulated:
        raise UsageError(
            f"one of {first.path} and {path} is simulated, the other is not: they cannot be judged together"
        )
    after_s = began_utc_s - first.began_utc_s
    if path.resolve() == first.path.resolve():
        raise UsageError(f"{path} is the traced run itself: name a later one, made by {first.command}")
    if after_s == 0 or (after_s < 0 and not anywhen):
        before = "" if anywhen else " or before it: a confirming run must be later"
        dry = "; a dry run begins at its world's epoch: give the world of the later one a later `epoch`"
        raise UsageError(f"{path} began at the time of {first.path}{before}{dry if first.dry else ''}")
    data = first.confirming.later(table)
    done = tuple(Done(word, data.elapsed_s > at_s, first.confirming.anew(word)) for word, at_s in changes)
    return Later(data, abs(after_s), done)
