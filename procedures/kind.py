"""A kind of calibration: all its specific code behind one class, used by the common code.

A kind is a folder (here, or a third party's) and an entry point of the group `rig.kinds` that names an instance of a
class made of `Kind` (docs/how_to/kinds.md):

    [project.entry-points."rig.kinds"]
    pitch-roll = "rig.procedures.attitude.kind:KIND"

Few commands need the fitter, and the others should not wait for it: a member that is a function of the kind's package
is declared with `lazily`, and other methods contain their imports.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence, Set
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

from rig.fitter.errors import FitError
from rig.procedures.errors import DataError
from rig.procedures.evaluate.results import Compared, Fitted, Options, Source, Traced
from rig.procedures.plan.precision import Precision
from rig.procedures.tables.unused import Unused

if TYPE_CHECKING:  # they load what few commands need
    from pydantic import BaseModel

    from rig.fitter.arrays import FloatArray
    from rig.fitter.effects.history import Laboratory
    from rig.fitter.effects.own import Grammar
    from rig.procedures.evaluate.acceptance import Verdict
    from rig.procedures.evaluate.budgeting import Evaluation, Expected
    from rig.procedures.evaluate.charting import Charting
    from rig.procedures.evaluate.confirming import Confirming
    from rig.procedures.evaluate.inference import Inference
    from rig.procedures.plan.advice import Advice
    from rig.procedures.plan.conduct import Conduct
    from rig.procedures.plan.expected import Columns, Expecting
    from rig.procedures.plan.further_runs import Limits, Variation
    from rig.procedures.plan.run_list import RunList
    from rig.procedures.plan.settings import Acceptance, WarningSettings
    from rig.procedures.tables.table import Reader, Table
    from rig.procedures.tables.unknown_table import UnknownTable
    from rig.procedures.tables.within import Within


class Procedure(Protocol):
    """A checked `procedure.toml` of any kind."""

    @property
    def kind(self) -> str:
        """Name of its kind."""

    @property
    def name(self) -> str:
        """Its name for people."""

    @property
    def seed(self) -> int:
        """Seed of every random choice in the order."""

    @property
    def replications(self) -> int:
        """Number of passes over the design."""

    @property
    def warnings(self) -> WarningSettings:
        """Early warnings while it runs."""

    @property
    def acceptance(self) -> Acceptance:
        """Acceptance limits of a finished calibration."""

    @property
    def design(self) -> BaseModel:
        """Its design."""

    def model_dump(self, *, mode: str, exclude_none: bool) -> dict[str, Any]:
        """The design as in its file."""

    @property
    def conduct(self) -> Conduct:
        """Execution of the run."""

    def expand(self) -> RunList:
        """Every point of the run, in order."""


@runtime_checkable
class Completed(Protocol):
    """A procedure that is completed when a run is planned: with files beside it, or with the result of a search."""

    @property
    def files(self) -> Sequence[str]:
        """Names of the files beside it that it needs."""

    def completed(self, texts: Mapping[str, str]) -> dict[str, Any] | None:
        """Values of its file with all it needs, from the texts of the files; None if it has all. Raises ValueError."""


class _Lazy:
    def __init__(self, place: str) -> None:
        self._module, _, self._name = place.partition(":")

    def __set_name__(self, owner: type[Kind], name: str) -> None:
        self._package = owner.__module__.rpartition(".")[0]

    def __get__(self, kind: Kind | None, owner: type[Kind]) -> Any:
        return getattr(import_module(f"{self._package}.{self._module}"), self._name)


def lazily(place: str) -> Any:
    """A member of a kind that stands in another module of its package, imported when it is asked for.

    Args:
        place: "module:name", in the package of the kind; the name is a function with the arguments of the method of
            `Kind`, or what the property of `Kind` gives.
    """
    return _Lazy(place)


class Kind(ABC):
    """Functions of a kind. Methods that are not abstract have a default for kinds without that function."""

    @property
    @abstractmethod
    def name(self) -> str:
        """Its name in procedures and results."""

    @property
    @abstractmethod
    def title(self) -> str:
        """Its subject, for headings and messages: "attitude sensors"."""

    @property
    def settings(self) -> type[BaseModel] | None:
        """The model of procedure files, whose instances are a `Procedure`; None if the kind has no runs on a bench."""
        return None

    @property
    def bench_factors(self) -> Sequence[str]:
        """Factors whose instrument a bench file may name."""
        return ()

    @property
    @abstractmethod
    def described(self) -> str:
        """Its tables in one sentence, for users with another table."""

    @property
    def asked_by(self) -> Set[str]:
        """Options that select this kind for any columns of the table."""
        return frozenset()

    @property
    def fit_options(self) -> type[Options]:
        """Options of `rig fit` for this kind only."""
        return Options

    @property
    def trace_options(self) -> type[Options]:
        """Options of `rig trace` for this kind only."""
        return Options

    @abstractmethod
    def fit(self, source: Source, options: Any, *, leave_out: Sequence[str], own: Laboratory, keep: bool) -> Fitted:
        """Fit the declared model to every sensor.

        Args:
            source: a run or a table.
            options: as declared by this kind.
            leave_out: "gross" for the rows that the search for gross errors names, or row numbers of the file.
            own: effects of the laboratory, of any kind.
            keep: whether the result will be used as a calibration.

        Raises:
            DataError: columns or values are missing, or the rows do not determine the model.
        """

    @abstractmethod
    def trace(self, source: Source, options: Any, *, own: Laboratory) -> Traced:
        """Find effects missing in the declared model; arguments and errors as for `fit`."""

    @property
    def infer_options(self) -> type[Options]:
        """Options of `rig infer` for this kind only."""
        return Options

    @property
    def in_use(self) -> str:
        """Use of its calibrations, a paragraph after `title` in the help of `rig infer`."""
        return ""

    @abstractmethod
    def calibration_of(self, given: Mapping[str, Any]) -> Any:
        """The calibration from the JSON of `rig fit --out`. Raises the errors of indexing and converting unknown
        values.
        """

    def notes_of(self, given: Mapping[str, Any]) -> tuple[str, ...]:
        """Sentences for every use of a calibration file that are not in the calibration's own notes."""
        return ()

    @abstractmethod
    def infer(self, calibration: Any, read: Reader, options: Any, other: Callable[[Path], Reader]) -> Inference:
        """Infer the measured quantities of a calibration.

        Args:
            calibration: from `calibration_of`.
            read: the table of outputs; values may be missing in it.
            options: as declared by this kind.
            other: reads a file that an option names.

        Raises:
            DataError: a column is missing, or a value cannot be used.
        """

    def for_readings(self, calibration: Any, within: Mapping[str, Within], count: float) -> Any:
        """A calibration from `calibration_of` for readings in use that are the mean of another number of them.

        Args:
            calibration: of outputs.
            within: the readings of its run, by output.
            count: number of readings in use.

        Raises:
            DataError: their scatter is not known, or this kind cannot say.
        """
        raise DataError(
            f"--readings: the error of a reading of {self.title} is not known by the number of its readings; give the "
            "mean of as many as a point of the run has"
        )

    def confirming(self, traced: Any) -> Confirming | None:
        """A run that it traced, as the first of two; None if no further run is possible."""
        return None

    def cannot_confirm(self, table: Table, options: Any) -> str:
        """Why no further run can confirm the findings in a run, and what to do instead; "" where one can.

        It is asked before the run is traced.

        Args:
            table: the run.
            options: of the trace, as declared by this kind.
        """
        if type(self).confirming is Kind.confirming:
            return f"no further run is made of {self.title}: make another run by `rig run`, and trace that by itself"
        return ""

    def expected(self, procedure: Any, run_list: RunList, sensors: Mapping[str, str]) -> Expected:
        """A run as it is planned, for a forecast of total uncertainties.

        Args:
            procedure: of the run.
            run_list: every point of it.
            sensors: axis of every sensor by the column of its output; "" for none.

        Raises:
            DataError: nothing is known of the outputs before they are read.
        """
        raise DataError(f"total uncertainties are not forecast for {self.title}: outputs are not known before the run")

    def with_coefficients(self, calibration: Any, coefficients: Mapping[str, FloatArray]) -> Any:
        """A calibration from `calibration_of` with other coefficients (k,) by sensor, as `Evaluation.coefficients`
        gives them.
        """
        raise DataError(f"calibrations of {self.title} have no total uncertainties")

    def placed(self, columns: Columns, constants: Mapping[str, float]) -> Columns:
        """The recorded columns with corrections by constants of the place, as for `evaluation`."""
        return columns

    @property
    def budget_options(self) -> type[Options]:
        """Options of `rig budget` for this kind only."""
        return Options

    def evaluation(
        self, table: Table, options: Any, at: Sequence[Mapping[str, float]], constants: Mapping[str, float]
    ) -> Evaluation:
        """The evaluation of a table, for uncertainty budgets.

        Args:
            table: with corrected columns.
            options: as declared by this kind.
            at: points at which outputs and inferred quantities are given, by quantity; empty for those of this kind.
            constants: of the place, by name, as in `rig.procedures.evaluate.stated.PlaceConstant`.

        Raises:
            DataError: there are no budgets, or a point or the table cannot be used.
        """
        raise DataError(f"uncertainty budgets are not made of {self.title}")

    def charting(self) -> Charting:
        """Control charts of its sensors. Raises `DataError` if there are none."""
        raise DataError(f"control charts are not made of {self.title}")

    def expecting(self, calibration: Any) -> Expecting:
        """Expected readings of the sensors of a bench by a calibration from `calibration_of`.

        Raises:
            FitError: it does not describe sensors of a bench.
        """
        raise FitError(f"a calibration of {self.title} does not say what the sensors of a bench should read")

    def declared_of(self, declared: Mapping[str, Any], sensor: str) -> Mapping[str, Any]:
        """`[model]` of the procedure as it is for one sensor of the bench, by name."""
        return declared

    def model_columns(self, columns: Columns, declared: Mapping[str, Any]) -> FloatArray | None:
        """Columns of the declared model of the outputs, for residuals of a running run.

        Args:
            columns: quantities of n observations.
            declared: the model of these sensors, from `declared_of`.

        Returns:
            (n, k); None for quantities of another kind of run.
        """
        return None

    def unused(self, table: Table) -> Unused:
        """Columns of a table that fits and traces do not use."""
        return Unused()

    @property
    def own_effects(self) -> Grammar | None:
        """Grammar of a laboratory's own effects; None if they are not possible."""
        return None

    def explained(self, topic: str) -> str:
        """Markdown for `rig explain effects` (its catalogue) and `rig explain models`; "" for none."""
        return ""

    def recognises(self, columns: Collection[str]) -> bool:
        """Whether a table without a declared kind is of this one, by its columns."""
        return False

    def look(self, source: Source, table: Table) -> UnknownTable | None:
        """Likely roles of the columns of a table that nobody has described, and options to begin with.

        Args:
            source: the file, as commands read it.
            table: the same with all columns and rows; NaN and "" for missing values.

        Returns:
            None if tables of this kind have fixed columns.
        """
        return None

    def check_design(self, procedure: Any, run_list: RunList) -> None:  # noqa: B027 - most refuse none
        """Refuse a design that cannot estimate what the procedure declares. Raises `FitError`."""

    def precision(self, procedure: Any, run_list: RunList) -> Precision:
        """Predicted precision of the calibration. Raises `FitError` if the design does not determine the model."""
        return Precision()

    def advice(self, procedure: Any, axes: Sequence[str], usage_deg: float | None) -> Sequence[Advice]:
        """Recommendations applied to a procedure, for sensors along these axes.

        Raises:
            FitError: a range of use is given, and this kind has none.
        """
        if usage_deg is not None:
            raise FitError(f"--usage does not apply to {self.title}, kind {self.name}")
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
            names: name of each.
            axes: of the bench's sensors.
            usage: requested range of use.
            hours: bench time of each.

        Raises:
            DataError: this kind does not compare designs.
        """
        raise DataError(f"procedures of kind {self.name} are not compared")

    def judge(self, procedure: Any, table: Table) -> Sequence[Verdict]:
        """Every sensor of a complete run compared with the procedure's limit; none without one. Raises `DataError`."""
        return ()

    def further_runs(self, procedure: Any, limits: Limits, *, chamber: bool) -> Iterator[Variation]:
        """Runs to follow a procedure, grouped by what they change, each group from the smallest to the largest.

        Args:
            procedure: that of the traced run.
            limits: of the bench, by quantity.
            chamber: whether the bench controls the sensors' temperature.
        """
        return iter(())
