"""Uncertainty budgets of a kind's results: the whole evaluation as a function of recorded columns."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.budget import TypeA
from rig.procedures.errors import DataError

if TYPE_CHECKING:
    from rig.fitter.trace.outcome import Outcome
    from rig.procedures.evaluate.stated import PlaceConstant
    from rig.procedures.tables.table import Columns, Table

Reading = Callable[[str, FloatArray], FloatArray]
"""Error of readings in use: name of an output's column and its (n,) values, to (n,) additions."""


def no_error(_: str, values: FloatArray) -> FloatArray:
    """Readings in use without error."""
    return np.zeros_like(values)


@dataclass(frozen=True, eq=False)
class Shift:
    """A change of the inputs of an evaluation.

    Attributes:
        columns: (n,) additions to recorded columns.
        in_use: additions to readings in use.
        constants: new values of constants of the place.
    """

    columns: Mapping[str, FloatArray] = field(default_factory=dict)
    in_use: Reading = no_error
    constants: Mapping[str, float] = field(default_factory=dict)


Shifts = Callable[[float], Shift]
"""The change of the inputs for an error of so many standard uncertainties."""


@dataclass(frozen=True, eq=False)
class Results:
    """Names and units of m results, their values, and their scatter.

    Attributes:
        names: of the results, each once.
        units: of the results.
        values: (m,).
        type_a: covariance by statistics of the run; that of inferred values includes the scatter of one reading in use.
        sensors: sensor of each result; "" for those of several.
        of_fit: (m,) part of the variance that more observations make smaller.
        at: settings at the point of each result, by column; none for a coefficient. () where a kind does not say.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    values: FloatArray
    type_a: TypeA
    sensors: tuple[str, ...]
    of_fit: FloatArray
    at: tuple[Mapping[str, float], ...] = ()


NOT_COVERED = ": intervals of rig infer do not cover it"
SCATTER = ("scatter of readings", "the run")
"""Name and source of the covariance by the fit and, for inferred values, by one reading in use."""
OF_PLOTS = ("scatter of whole plots and readings", "the run")
"""The same where whole plots have errors of their own."""


def together(parts: Sequence[FloatArray]) -> FloatArray:
    """(m, m) covariance of all results, from those of sensors that are independent."""
    size = sum(len(one) for one in parts)
    found, start = np.zeros((size, size)), 0
    for one in parts:
        found[start : start + len(one), start : start + len(one)] = one
        start += len(one)
    return found


def alike(others: Iterable[tuple[str, str, FloatArray | None]]) -> Iterator[TypeA]:
    """Model errors of causes that data cannot separate: all equally likely, so the rms difference from the named one.

    Args:
        others: the cause by which the results are, another one that data cannot tell from it, and (m,) how far the
            results by that one are from these; None if it gives none.
    """
    by_named: dict[str, list[tuple[str, FloatArray]]] = {}
    for named, member, moved in others:
        if moved is not None:
            by_named.setdefault(named, []).append((member, moved))
    for named, members in by_named.items():
        covariance = np.sum([np.outer(moved, moved) for _, moved in members], axis=0) / (len(members) + 1)
        names = " or ".join(member for member, _ in members)
        yield TypeA(covariance, np.inf, f"model: {named}, or {names}", "trace of the run", "B")


@dataclass(frozen=True)
class Expected:
    """A run as it is planned, with outputs of sensors as they are expected.

    Attributes:
        table: its observations, with the expected scatter.
        meter: whether outputs have the size of the sensors'; otherwise errors of their meter cannot be forecast.
        assuming: the assumptions, a sentence.
    """

    table: Table
    meter: bool
    assuming: str


class Evaluation(ABC):
    """The evaluation of one table, from its recorded columns to results."""

    @property
    @abstractmethod
    def columns(self) -> Columns:
        """The recorded columns that it uses, corrected."""

    def lack(self, column: str) -> Sequence[str]:
        """Outputs whose results do not depend on a column, if those of others do; () if all do, or none."""
        return ()

    @property
    @abstractmethod
    def results(self) -> Results:
        """Results of the columns as they are."""

    @abstractmethod
    def evaluate(self, shift: Shift) -> FloatArray:
        """(m,) values of the results with changed inputs."""

    @abstractmethod
    def coefficients(self, columns: Mapping[str, FloatArray]) -> Mapping[str, FloatArray]:
        """(k,) coefficients of the calibration by sensor, with additions to columns."""

    def residuals(self, columns: Mapping[str, FloatArray]) -> Mapping[str, FloatArray]:
        """(n,) residuals of the fit by sensor, with additions to columns; none where scatter needs no repeats."""
        return {}

    def modelled(self) -> Mapping[str, FloatArray]:
        """(n,) output of each observation by the model, with all effects that it has or leaves out, by sensor."""
        return {name: self.columns[name] - left for name, left in self.residuals({}).items()}

    def aside(self) -> Mapping[str, FloatArray]:
        """(n,) part of `modelled` that is of effects that are left out of the results, by sensor."""
        return {}

    def holds(self) -> Mapping[str, Mapping[str, str]]:
        """For which state results hold where an effect is left out of them, in words, by sensor and effect."""
        return {}

    def explain(self, expected: Mapping[str, float]) -> None:  # noqa: B027 - most have no repeats
        """Say before anything else what sum of squares stated errors leave in the residuals, by sensor."""

    def stored(self) -> Any:
        """The calibration to use with these results, as JSON values, if it is not that of the fit; None if it is."""
        return None

    @property
    @abstractmethod
    def settings(self) -> Mapping[str, IntArray]:
        """(n,) number of the setting of each observation, from 0, by the column of a factor; "" for points of all."""

    @property
    @abstractmethod
    def replication(self) -> IntArray:
        """(n,) number of the replication of each observation, from 0."""

    def of_place(self, constant: PlaceConstant) -> Iterable[tuple[str, Shifts]]:
        """Independent errors, with one standard uncertainty each, from a constant of the place; none if it is not used.

        The first word distinguishes several errors of one constant.
        """
        return ()

    def charted(self, sensor: str) -> tuple[str, FloatArray]:
        """Unit of a sensor's errors in its control chart, and (p,) its output at the points per such a unit.

        Raises:
            DataError: this kind does not say.
        """
        raise DataError("--after-days: drift of sensors in use is not known for this kind of calibration")

    def model_errors(self) -> Iterable[TypeA]:
        """Differences between models that the run cannot separate, as covariances of the results."""
        return ()

    def reversibility(self) -> Iterable[TypeA]:
        """Differences between rising and falling series, as covariances of the results, which are half-way between."""
        return ()

    def elsewhere(self, used: Collection[str]) -> Sequence[Evaluation]:
        """This evaluation with quantities outside `used` as they were in some rows of the run; itself if none are.

        Results by a model that has only the `used` ones hold at all of these.
        """
        return (self,)

    def grids(self) -> Mapping[str, tuple[str, Sequence[Mapping[str, float]]]]:
        """By output, the quantity that a reading determines, and points along it at which lines of the budget that are
        no change of coefficients are kept for the use of a calibration; {} where a kind keeps none.
        """
        return {}

    @property
    def outcomes(self) -> Sequence[Outcome]:
        """Outcomes of the trace, if the model has its effects, and the kind has `grids`."""
        return ()

    def moved_to(self, at: Sequence[Mapping[str, float]]) -> Evaluation:
        """This evaluation at other points; only of a kind that has `grids`."""
        raise NotImplementedError

    def kept_variance(self, output: str) -> FloatArray:
        """(p,) variance of values inferred from an output at the points, by the calibration alone that is kept."""
        raise NotImplementedError

    def notes(self) -> Iterable[str]:
        """Sentences about the scatter."""
        return ()

    def hints(self) -> Iterable[str]:
        """Sentences for the person who asks for a budget: which results are not there, and what would state them."""
        return ()

    def described(self, sensor: str) -> str:
        """How a sensor's output follows from its coefficients, a sentence; "" if it is not said."""
        return ""

    def not_kept(self) -> Iterable[str]:
        """Sentences about lines of the budget that a calibration file cannot keep for its use."""
        return (f"{one.name}{NOT_COVERED}" for one in self.reversibility())
