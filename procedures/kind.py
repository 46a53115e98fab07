"""A kind of calibration: all that only it knows, behind one class. What is the same for every kind asks through it.

A kind is a folder (here, or a third party's) and an entry point of the group `rig.kinds` that names an instance of a
class made of `Kind` (docs/kinds.md):

    [project.entry-points."rig.kinds"]
    pitch-roll = "procedures.attitude.kind:KIND"

Methods import what they need themselves: few commands need the fitter, and none should wait for it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence, Set
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any, Protocol

from pydantic import BaseModel

from fitter.arrays import FloatArray
from fitter.effects.entry import Entry
from fitter.effects.own import Grammar
from fitter.errors import FitError
from procedures.acceptance import Verdict
from procedures.advice import Advice
from procedures.charting import Charting
from procedures.conduct import Conduct
from procedures.confirming import Confirming
from procedures.errors import BrokenKind, DataError
from procedures.expected import Columns, Expecting
from procedures.further_runs import Limits, Variation
from procedures.inference import Inference
from procedures.precision import Precision
from procedures.results import Compared, Fitted, Options, Source, Traced
from procedures.run_list import RunList
from procedures.settings import Acceptance, WarningSettings
from procedures.table import Reader, Table
from procedures.unused import Unused

GROUP = "rig.kinds"


class Procedure(Protocol):
    """A checked `procedure.toml`, whatever its kind."""

    @property
    def kind(self) -> str:
        """Name of its kind."""

    @property
    def name(self) -> str:
        """What a person calls it."""

    @property
    def seed(self) -> int:
        """Of every random choice in the order."""

    @property
    def replications(self) -> int:
        """Passes over the design."""

    @property
    def warnings(self) -> WarningSettings:
        """Early warnings while it runs."""

    @property
    def acceptance(self) -> Acceptance:
        """When a finished calibration is fit for use."""

    @property
    def design(self) -> BaseModel:
        """What is visited."""

    def model_dump(self, *, mode: str, exclude_none: bool) -> dict[str, Any]:
        """As its file has it."""

    @property
    def conduct(self) -> Conduct:
        """How the run is carried out."""

    def expand(self) -> RunList:
        """Every point of the run, in order."""


class Kind(ABC):
    """What is asked of a kind. What is not abstract has an answer for a kind that has nothing to say there."""

    @property
    @abstractmethod
    def name(self) -> str:
        """As procedures and results name it."""

    @property
    @abstractmethod
    def title(self) -> str:
        """What it calibrates, for headings and messages: "attitude sensors"."""

    @property
    def settings(self) -> type[BaseModel] | None:
        """The procedure file, whose instances are a `Procedure`; None where nothing of the kind is run on a bench."""
        return None

    @property
    def bench_factors(self) -> Sequence[str]:
        """Factors for which a bench file may say which instrument sets them."""
        return ()

    @property
    @abstractmethod
    def described(self) -> str:
        """Its tables in one sentence, for who has another."""

    @property
    def asked_by(self) -> Set[str]:
        """Options that ask for this kind whatever the table's columns are."""
        return frozenset()

    @property
    def fit_options(self) -> type[Options]:
        """Options of `rig fit` that only it has."""
        return Options

    @property
    def trace_options(self) -> type[Options]:
        """Options of `rig trace` that only it has."""
        return Options

    @abstractmethod
    def fit(
        self, source: Source, options: Any, *, leave_out: Sequence[str], own: Sequence[Entry], keep: bool
    ) -> Fitted:
        """Fit the declared model to every sensor.

        Args:
            source: a run or a table.
            options: as this kind declares them.
            leave_out: "gross" for the rows that the search for gross errors names, or row numbers of the file.
            own: effects of the laboratory, of any kind.
            keep: whether the result is to be used as a calibration.

        Raises:
            DataError: the table lacks something, or its rows do not determine the model.

        """

    @abstractmethod
    def trace(self, source: Source, options: Any, *, own: Sequence[Entry]) -> Traced:
        """Trace what the declared model lacks; arguments and errors as for `fit`."""

    @property
    def infer_options(self) -> type[Options]:
        """Options of `rig infer` that only it has."""
        return Options

    @property
    def in_use(self) -> str:
        """How its calibrations are used, a paragraph for the help of `rig infer` that follows `title`."""
        return ""

    @abstractmethod
    def calibration_of(self, given: Mapping[str, Any]) -> Any:
        """The calibration in what `rig fit --out` wrote. Raises what indexing and converting texts of others raises."""

    def notes_of(self, given: Mapping[str, Any]) -> tuple[str, ...]:
        """What is to be said with every use of a calibration file, and is not in the calibration's own notes."""
        return ()

    @abstractmethod
    def infer(self, calibration: Any, read: Reader, options: Any, other: Callable[[Path], Reader]) -> Inference:
        """Infer what a calibration is of.

        Args:
            calibration: as `calibration_of` gives it.
            read: the table of outputs; values may be missing in it.
            options: as this kind declares them.
            other: reads a file that an option names.

        Raises:
            DataError: a column is missing, or a value cannot be used.

        """

    def confirming(self, traced: Any) -> Confirming | None:
        """A run that it traced, as the first of two; None where no further run can be made."""
        return None

    def charting(self) -> Charting:
        """Control charts of its sensors. Raises `DataError` where none are made."""
        raise DataError(f"control charts are not made of {self.title}")

    def expecting(self, calibration: Any) -> Expecting:
        """What a calibration, as `calibration_of` gives it, expects the sensors of a bench to read.

        Raises:
            FitError: it says nothing of a bench.

        """
        raise FitError(f"a calibration of {self.title} does not say what the sensors of a bench should read")

    def model_columns(self, columns: Columns, declared: Mapping[str, Any]) -> FloatArray | None:
        """What the outputs are combinations of in the declared model, for residuals of a run that is going on.

        Args:
            columns: quantities of n observations.
            declared: `[model]` of the procedure.

        Returns:
            (n, k); None where the quantities are those of another kind of run.

        """
        return None

    def unused(self, table: Table) -> Unused:
        """Columns of a table that fits and traces do not look at."""
        return Unused()

    @property
    def own_effects(self) -> Grammar | None:
        """How a laboratory writes effects of its own; None where it cannot."""
        return None

    def recognises(self, columns: Collection[str]) -> bool:
        """Whether a table that does not say of which kind it is, is of this one by its columns."""
        return False

    def check_design(self, procedure: Any, run_list: RunList) -> None:  # noqa: B027 - most refuse none
        """Refuse a design that cannot estimate what the procedure declares. Raises `FitError`."""

    def precision(self, procedure: Any, run_list: RunList) -> Precision:
        """Predicted precision of the calibration. Raises `FitError` where the design does not determine the model."""
        return Precision()

    def advice(self, procedure: Any, axes: Sequence[str], usage_deg: float | None) -> Sequence[Advice]:
        """Recommendations held against a procedure, for sensors along these axes.

        Raises:
            FitError: a range of usage is given, and this kind knows of none.

        """
        if usage_deg is not None:
            raise FitError(f"--usage says nothing of {self.title}, kind {self.name}")
        return ()

    def compare(
        self,
        procedures: Sequence[Any],
        names: Sequence[str],
        axes: Collection[str],
        usage: float | None,
        hours: Sequence[float],
    ) -> Compared:
        """Procedures side by side.

        Args:
            procedures: of this kind.
            names: what each is called.
            axes: of the bench's sensors.
            usage: range of use asked for.
            hours: bench time of each.

        Raises:
            DataError: this kind does not compare designs.

        """
        raise DataError(f"procedures of kind {self.name} are not compared")

    def judge(self, procedure: Any, table: Table) -> Sequence[Verdict]:
        """Every sensor of a complete run against the procedure's limit; none without one. Raises `DataError`."""
        return ()

    def further_runs(self, procedure: Any, limits: Limits, *, chamber: bool) -> Iterator[Variation]:
        """Runs to follow a procedure, grouped by what they change, each group from the smallest to the largest.

        Args:
            procedure: that of the run that was traced.
            limits: of the bench, by quantity.
            chamber: whether the bench holds the sensors' temperature.

        """
        return iter(())


@cache
def kinds() -> Mapping[str, Kind]:
    """Every kind that is installed, by name, ours first.

    Raises:
        BrokenKind: an entry point of `rig.kinds` cannot be loaded or names no kind, or two have one name.

    """
    found: dict[str, Kind] = {}
    points = {point.value: point for point in entry_points(group=GROUP)}  # one package may be found on two paths
    for point in sorted(points.values(), key=lambda p: (not p.value.startswith("procedures."), p.name)):
        if point.name in found:
            raise BrokenKind(
                f"two packages have a kind of calibration {point.name!r}: remove one of them{_whose(point)}"
            )
        try:
            kind = point.load()
        except Exception as error:
            why = f"{type(error).__name__}: {error}"
            raise BrokenKind(f"the kind of calibration {point.name!r} cannot be used: {why}{_whose(point)}") from error
        if not isinstance(kind, Kind):
            raise BrokenKind(f"{point.value} is no kind of calibration, which its package calls it{_whose(point)}")
        found[point.name] = kind
    return found


def _whose(point: EntryPoint) -> str:
    """The package of an entry point, to end a message."""
    return "" if point.dist is None else f" (package {point.dist.name} {point.dist.version})"


def kind_of(procedure: Procedure) -> Kind:
    """The kind of a procedure."""
    return kinds()[procedure.kind]


def kind_of_table(table: Table) -> Kind | None:
    """The kind that a table says it is of, or that knows its columns; None where no kind does.

    Raises:
        DataError: several kinds know the columns, or the kind that the table names is not installed.

    """
    if table.kind:
        if table.kind not in kinds():
            names = ", ".join(kinds())
            raise DataError(f"{table.source} is of kind {table.kind!r:.80}, which is not installed; there are {names}")
        return kinds()[table.kind]
    found = [kind for kind in kinds().values() if kind.recognises(table.columns.keys())]
    if len(found) > 1:
        what = " and of ".join(kind.title for kind in found)
        raise DataError(f"{table.source} has columns of {what}: leave out those of one ({found[0].described})")
    return found[0] if found else None
