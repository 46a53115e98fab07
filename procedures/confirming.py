"""A run that was traced, as the first of two: what it takes to plan a further run, to judge by it, and to use it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from fitter.arrays import FloatArray
from fitter.confirm import Confirmation, Question, Together
from fitter.confirm.question import Traced
from fitter.effects.entry import Entry
from procedures.further_runs import Variation
from procedures.results import Fitted
from procedures.run_list import RunList
from procedures.table import Table

SETTLED = ("confirmed", "replaced")
"""Verdicts that leave one explanation, and show it."""


class Observations(Protocol):
    """Observations of any kind."""

    def __len__(self) -> int: ...

    @property
    def elapsed_s(self) -> FloatArray:
        """(n,) since the start of the run."""


class Confirming(Protocol):
    """What a kind knows of a run that was traced in it.

    Attributes:
        unit: of what is inferred: errors are said in it.
        output_unit: of the outputs.
        per_slope: an error of the output over the slope, in `unit`.
        drawn: unit of plots, and how many of them one `unit` is.
        caution: what to count on of expected standard errors between two explanations; "" where they come as promised.

    """

    unit: str
    output_unit: str
    per_slope: float
    drawn: tuple[str, float]
    caution: str

    @property
    def found(self) -> Traced:
        """What was found."""

    @property
    def data(self) -> Observations:
        """Of the run."""

    def own_words(self, *, realigned: bool) -> str:
        """What is taken from the further run itself when it is predicted, in words; "" where nothing is."""

    def later(self, table: Table) -> Any:
        """Observations of a later run. Raises `DataError`."""

    def beside(self, later: Any, after_s: float) -> Together:
        """This run and a later one, `after_s` from its start. Raises `FitError`."""

    def ways(
        self, variation: Variation, run_list: RunList, questions: Sequence[Question], later_s: float
    ) -> Sequence[Together]:
        """This run and a further one as it is expected to go, in the ways that may go; its outputs mean nothing."""

    def hours(self, variation: Variation, run_list: RunList) -> float:
        """Bench time of a run, by what this one took."""

    def size(self, procedure: Any) -> str:
        """Points and replications, for a table."""

    def mounting(self, procedure: Any) -> Mapping[str, float] | None:
        """How the package is turned in a run, deg about each axis; None where it is as usual."""

    def separated_by(self, one: Entry, other: Entry) -> str:
        """The measurement that would tell two effects apart."""

    def variables(self) -> Mapping[str, tuple[str, float]]:
        """Fields of observations that residuals are drawn over: label and scale."""

    def calibrated(
        self, answers: Sequence[Confirmation], questions: Sequence[Question], record: dict[str, Any], options: Any
    ) -> Fitted:
        """The calibration of this run with the causes that a further run confirmed.

        Args:
            answers: a question each.
            questions: an effect found each.
            record: both runs, and of every effect what is used; it is completed here, and kept with the calibration.
            options: of `rig fit`.

        Raises:
            DataError: an option has no place here.

        """
