"""The run that was traced, with all that a run after it needs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fitter.confirm import Question, questions_of
from procedures.confirming import Confirming
from procedures.kind import Procedure, kind_of
from rig.closed_loop import Traced, known, trace_table
from rig.config import BenchConfig
from rig.errors import UsageError
from rig.plans import plan_of
from rig.run_file.reader import RunReader
from rig.tables import run_table

DAY_S = 86400.0


@dataclass(frozen=True, eq=False)
class First:
    """A run that was traced.

    Attributes:
        path: the run file.
        traced: what was found in it.
        confirming: what its kind knows of a further run.
        questions: an effect found each.
        documents: texts of its files.
        procedure: what was run.
        bench: on which bench.
        dry: whether on twins.
        began_utc_s: when.
        world_s: a dry run: how old its world was at the start.

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

    @property
    def simulated(self) -> bool:
        """Whether no real instrument was involved."""
        return self.traced.table.simulated

    @property
    def later_s(self) -> float:
        """Seconds from its start to the same hour of a later day, when it is over."""
        return DAY_S * float(np.ceil((self.confirming.data.elapsed_s.max() + 3600.0) / DAY_S))


def check_run_file(path: Path) -> None:
    """Refuse a table. Raises `UsageError`."""
    if path.suffix == ".csv":
        raise UsageError(
            f"{path} is no run file: a further run is made on the bench of the first, which its file holds"
        )


def open_traced(path: Path, **options: Any) -> First:
    """Trace a run.

    Args:
        path: its run file.
        options: of `rig trace` that the run's kind declares.

    Raises:
        UsageError: it is no run file, or its rows do not determine the declared model.

    """
    check_run_file(path)
    table = run_table(path)
    with RunReader.open(path) as reader:
        documents, run, began_utc_s = reader.documents(), reader.about(), reader.genesis().utc_s
    plan = plan_of(documents, dry=run.runs_dry, stored=True)
    traced, kind = trace_table(table, **options), kind_of(plan.procedure)
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
        world_s=run.world_start_s or 0.0,
    )


def read_later(first: First, path: Path) -> tuple[Any, float]:
    """A later run, and how long after the start of the first it began, s.

    Raises:
        UsageError: it is of another kind, came before the first, or one of them is simulated and the other is not.

    """
    table = run_table(path)
    kind, of_first = known(table).name, known(first.traced.table).name
    if kind != of_first:
        raise UsageError(f"{path} is a {kind} run and {first.path} a {of_first} run")
    if not table.provenance["complete"]:
        raise UsageError(f"{path} is not complete: rig resume {path}, then judge by it")
    if table.provenance["bench"] != first.traced.table.provenance["bench"]:
        raise UsageError(
            f"{path} was made on bench {table.provenance['bench']}, {first.path} on "
            f"{first.traced.table.provenance['bench']}: what a head or a line does is confirmed on the same bench"
        )
    with RunReader.open(path) as reader:
        simulated, began_utc_s = reader.about().simulated, reader.genesis().utc_s
    if simulated != first.simulated:
        raise UsageError(
            f"one of {first.path} and {path} is simulated, the other is not: they cannot be judged together"
        )
    after_s = began_utc_s - first.began_utc_s
    if path.resolve() == first.path.resolve():
        raise UsageError(f"{path} is the run that was traced: what confirms an effect has to come after it")
    if after_s <= 0:
        dry = "; a dry run begins at its world's epoch: give the world of the later one a later `epoch`"
        raise UsageError(
            f"{path} began at the time of {first.path} or before it: what confirms an effect has to come after it"
            f"{dry if first.dry else ''}"
        )
    return first.confirming.later(table), after_s
