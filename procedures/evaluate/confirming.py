"""A traced run as the first of two: functions to plan a further run, to judge by it, and to use it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.confirm import Confirmation, Later, Question, Together
from rig.fitter.effects.entry import Entry
from rig.fitter.effects.manual_changes import Done
from rig.procedures.evaluate.budgeting import Evaluation
from rig.procedures.evaluate.results import Fitted, Page
from rig.procedures.plan.further_runs import Variation
from rig.procedures.plan.run_list import RunList
from rig.procedures.present.blocks import Block
from rig.procedures.present.effects_shown import show_confirmed
from rig.procedures.tables.table import Table

SETTLED = ("confirmed", "replaced")
"""Verdicts that leave one explanation and confirm it."""


@dataclass(frozen=True, eq=False)
class Confirming(ABC):
    """A kind's knowledge of a traced run.

    Attributes:
        traced: the run.
        earlier: further runs that were already made.
        stands_degC: setting at which the environment stands before a further run, so that it need not settle again;
            None if it does not.
        unit: of what is inferred: errors are said in it.
        output_unit: of the outputs.
        per_slope: conversion of an error of the output over the slope to `unit`.
        drawn: unit of plots, and its number per `unit`.
        caution: note about the accuracy of expected standard errors between two explanations; "" if they are accurate.
    """

    traced: Any
    earlier: tuple[Later, ...] = ()
    stands_degC: float | None = None

    unit: ClassVar[str]
    output_unit: ClassVar[str]
    per_slope: ClassVar[float]
    drawn: ClassVar[tuple[str, float]]
    caution: ClassVar[str] = ""

    def unit_for(self, output: str) -> str:
        """Unit in which errors of one output are said."""
        return self.unit

    def after(self, earlier: Sequence[Later]) -> Self:
        """This run as one that comes after further ones."""
        return replace(self, earlier=tuple(earlier))

    def at_rest(self, degC: float | None) -> Self:
        """This run as one after which the environment stands at a setting."""
        return replace(self, stands_degC=degC)

    def settling_s(self, variation: Variation) -> float:
        """Time for which the environment settles before the first point of a further run, seconds."""
        environment = getattr(variation.procedure, "environment", None)
        if environment is None or (self.stands_degC == environment.setpoint_degC and not variation.touched):
            return 0.0
        return float(environment.dwell_s)

    @property
    def found(self) -> Any:
        """The findings, a `rig.fitter.confirm.question.Traced`."""
        return self.traced.trace

    @property
    def data(self) -> Any:
        """Observations of the run."""
        return self.traced.data

    @abstractmethod
    def own_words(self, *, realigned: bool) -> str:
        """Parameters estimated from the further run itself for its prediction, in words; "" if there are none."""

    @abstractmethod
    def later(self, table: Table) -> Any:
        """Observations of a later run. Raises `DataError`."""

    @abstractmethod
    def together(self, later: Sequence[Later]) -> Together:
        """This run and later ones. Raises `FitError`."""

    def beside(self, later: Any, after_s: float, done: Sequence[Done] = ()) -> Together:
        """This run, the earlier further ones, and a later one with changes by a person. Raises `FitError`.

        Args:
            later: its observations.
            after_s: seconds from the begin of this run to its begin.
            done: changes, with masks over the later run's observations.
        """
        return self.together([*self.earlier, Later(later, after_s, done)])

    @abstractmethod
    def ways(
        self, variation: Variation, run_list: RunList, questions: Sequence[Question], later_s: float
    ) -> Sequence[Together]:
        """This run and a planned one, in its possible courses; its outputs are not used."""

    def anew(self, word: str) -> bool:
        """Whether the declared model has parameters of its own after a change by a person; unknown changes: yes."""
        return all(one.change.anew for effect in self.catalogue for one in effect.by_hand if one.change.word == word)

    @property
    def catalogue(self) -> Sequence[Entry]:
        """Effects that the trace looked for."""
        return ()

    def standing(self, variation: Variation) -> Variation:
        """A possible run as a person finds the bench after the earlier ones: whether something has to be turned."""
        return variation

    def suits(self, variation: Variation, first: Any, questions: Sequence[Question]) -> bool:
        """Whether all explanations say what they are in a run; a run of which one does not is not proposed.

        Args:
            variation: the run.
            first: procedure of the first run, in which they do.
            questions: with the explanations.
        """
        return True

    counts: ClassVar[Sequence[int]] = ()
    """Numbers of units that are tried if a run's points are chosen, ascending."""

    least_added: ClassVar[int] = 1
    """Minimum number of units of points that are added to the run, as one with it."""

    passes: ClassVar[Sequence[int]] = (1,)
    """Numbers of replications of chosen points that are tried."""

    def whole(self, group: Sequence[Variation], times: int) -> Variation | None:
        """The run of a group with all points that can be chosen, so many times each; None if points are not chosen."""
        return None

    def units(self, run_list: RunList) -> IntArray:
        """(n,) number of the unit of each point of a run with all of them: units are chosen together."""
        return np.arange(len(run_list))

    def chosen(self, whole: Variation, units: Sequence[int]) -> Variation:
        """The run with these units only."""
        return whole

    @abstractmethod
    def hours(self, variation: Variation, run_list: RunList) -> float:
        """Bench time of a run, hours, from that of this run."""

    @abstractmethod
    def size(self, procedure: Any) -> str:
        """Points and replications, for a table."""

    def mounting(self, procedure: Any) -> Mapping[str, float] | None:
        """How the package is turned in a run, deg about each axis; None where it is as usual, or nothing is turned."""
        return None

    @abstractmethod
    def separated_by(self, one: Entry, other: Entry) -> str:
        """The measurement that would separate two effects."""

    @abstractmethod
    def variables(self) -> Mapping[str, tuple[str, float]]:
        """Fields of observations for plots of residuals: label and scale."""

    @abstractmethod
    def calibrated(
        self, answers: Sequence[Confirmation], questions: Sequence[Question], record: dict[str, Any], options: Any
    ) -> ConfirmedFit:
        """The calibration of this run with the causes confirmed by a further run.

        Args:
            answers: one per question.
            questions: one per effect found.
            record: both runs, and the used explanation of every effect; it is completed here, and stored with the
                calibration.
            options: of `rig fit`.

        Raises:
            DataError: an option is not permitted here.
        """


@dataclass(frozen=True)
class ConfirmedFit:
    """A calibration with terms confirmed by a further run, and their source.

    Attributes:
        fitted: the calibration.
        record: both runs, and the used explanation of every effect.
        evaluation: the same model in the evaluation of the run for its budgets, by points and constants of the place
            as for `Kind.evaluation`; None where budgets have no such model.
        beyond: settled effects that the model cannot have.
    """

    fitted: Fitted
    record: dict[str, Any]
    evaluation: Callable[[Sequence[Mapping[str, float]], Mapping[str, float]], Evaluation] | None = None
    beyond: tuple[str, ...] = ()

    @property
    def without(self) -> list[str]:
        """Effects of which nothing is in the calibration."""
        left = [str(one["named"]) for one in self.record["effects"] if one["verdict"] not in SETTLED]
        return [*left, *self.beyond]

    def to_json(self) -> dict[str, Any]:
        """JSON values for `rig fit --json`."""
        return self.fitted.to_json() | {"confirmed_by": self.record}

    def blocks(self) -> Iterator[Block]:
        """Blocks for people."""
        return chain(self.fitted.blocks(), show_confirmed(self.record))

    def page(self) -> Page | None:
        """Its report; None if it has none."""
        return self.fitted.page()


def times_s(elapsed_s: FloatArray, new: NDArray[np.bool_]) -> tuple[float, float]:
    """Seconds between rows of one whole plot, and the additional time of a new one, by what a run took.

    Args:
        elapsed_s: (n,) in the order of the run.
        new: (n - 1,) whether a new whole plot begins between two rows.
    """
    steps = np.diff(elapsed_s)
    row = float(np.median(steps[~new])) if np.any(~new) else 0.0
    return row, max(float(np.median(steps[new])) - row, 0.0) if np.any(new) else 0.0


def in_words(points: int, replications: int) -> str:
    """Size of a run without whole plots."""
    return f"{points} points x {replications} replication{'' if replications == 1 else 's'}"
