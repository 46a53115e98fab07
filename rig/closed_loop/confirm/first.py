"""The run that was traced, with all that a run after it needs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fitter.confirm import Question, Together, questions_of
from procedures.attitude.data import AttitudeData
from procedures.attitude.together import AttitudeTogether
from procedures.kind import Procedure
from procedures.pressure.data import WholePlotData
from procedures.pressure.together import WholePlotTogether
from rig.closed_loop import AttitudeTraced, Traced, trace_table
from rig.config import BenchConfig
from rig.errors import UsageError
from rig.plans import plan_of
from rig.run_file.reader import RunReader
from rig.tables import attitude_data, run_table, whole_plot_data

DAY_S = 86400.0


@dataclass(frozen=True, eq=False)
class First:
    """A run that was traced.

    Attributes:
        path: the run file.
        traced: what was found in it.
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
        return DAY_S * float(np.ceil((self.traced.data.elapsed_s.max() + 3600.0) / DAY_S))

    def beside(self, later: AttitudeData | WholePlotData, after_s: float) -> Together:
        """This run and a later one of its kind, `after_s` from its start."""
        if isinstance(self.traced, AttitudeTraced):
            assert isinstance(later, AttitudeData)
            return AttitudeTogether.of(self.traced.trace, self.traced.data, later, after_s)
        assert isinstance(later, WholePlotData)
        return WholePlotTogether.of(self.traced.trace, self.traced.data, later, after_s)


def open_traced(path: Path, model: str | None = None, *, temperature: bool | None = None) -> First:
    """Trace a run.

    Args:
        path: its run file.
        model: whole plots: the declared model, if not the full second order.
        temperature: attitude: whether the declared model has temperature in it; as the run's procedure has it if None.

    Raises:
        UsageError: it is no run file, or its rows do not determine the declared model.

    """
    if path.suffix == ".csv":
        raise UsageError(
            f"{path} is no run file: a further run is made on the bench of the first, which its file holds"
        )
    table = run_table(path)
    with RunReader.open(path) as reader:
        documents, run, began_utc_s = reader.documents(), reader.about(), reader.genesis().utc_s
    plan = plan_of(documents, dry=run.runs_dry, stored=True)
    traced = trace_table(table, model, temperature=temperature)
    return First(
        path=path,
        traced=traced,
        questions=questions_of(traced.trace),
        documents=documents,
        procedure=plan.procedure,
        bench=plan.bench,
        dry=plan.dry,
        began_utc_s=began_utc_s,
        world_s=run.world_start_s or 0.0,
    )


def read_later(first: First, path: Path) -> tuple[AttitudeData | WholePlotData, float]:
    """A later run, and how long after the start of the first it began, s.

    Raises:
        UsageError: it is of another kind, came before the first, or one of them is simulated and the other is not.

    """
    table = run_table(path)
    if table.kind != first.traced.table.kind:
        raise UsageError(f"{path} is a {table.kind} run and {first.path} a {first.traced.table.kind} run")
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
    data = attitude_data(table) if isinstance(first.traced, AttitudeTraced) else whole_plot_data(table)
    return data, after_s
