"""Budgets of general runs with the effects that a trace finds, and the model error of causes that look alike.

As for attitude sensors: an effect is a term of the model, or is held at its size and off the outputs. Where the data
cannot separate its cause from others, the results by every one of them are as good, and their rms difference from those
by the named one is a line of its own.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.budget import TypeA
from rig.fitter.errors import FitError
from rig.fitter.trace.outcome import Outcome
from rig.procedures.evaluate.budget_by_sensor import difference
from rig.procedures.evaluate.budgeting import NOT_COVERED, alike
from rig.procedures.general.budget import GeneralEvaluation
from rig.procedures.general.of_runs import RunModels, recorded, trace_run
from rig.procedures.general.traced import WithEffects, with_effects
from rig.procedures.tables.table import Table

ROWS = 24
"""Rows at whose settings effects are evaluated, where no declared result says at which it holds."""


class TracedEvaluation(GeneralEvaluation):
    """All sensors of a run, each by its declared model with traced effects."""

    def __init__(
        self,
        table: Table,
        at: Sequence[Mapping[str, float]],
        found: WithEffects | None = None,
        ignore: Sequence[str] = (),
    ) -> None:
        self._recorded = table
        self._found = _traced(table, ignore) if found is None else found
        self._points = _with_means(table, at)
        super().__init__(self._found.asked.table, self._points, self._found.asked.models)
        off, slopes, by_side = self._found.off, self._found.slopes, self._found.by_side
        self._each = [
            replace(one, beside=off.get(one.name), slopes=slopes.get(one.name), by_side=by_side.get(one.name))
            for one in self._each
        ]

    @property
    def outcomes(self) -> Sequence[Outcome]:
        """Outcomes of the trace, if the model has its effects, and the kind has `grids`."""
        return self._found.outcomes

    def aside(self) -> Mapping[str, FloatArray]:
        """See `Evaluation`."""
        return {output: each.sum(axis=1) for output, each in self._found.off.items()}

    def holds(self) -> Mapping[str, Mapping[str, str]]:
        """See `Evaluation`."""
        return self._found.holds

    def moved_to(self, at: Sequence[Mapping[str, float]]) -> TracedEvaluation:
        """This evaluation at other points."""
        return TracedEvaluation(self._recorded, at, self._found)

    @cached_property
    def _moved(self) -> Sequence[tuple[str, str, str, FloatArray | None]]:
        """Output, effect, other cause, and (m,) how far the results by that one are away; None if it gives none."""
        base, sensors = self.results, {one.name: one for one in self.each}
        found = []
        for output, named, member, asked in self._found.others:
            moved = np.zeros(len(base.values))
            own, model = sensors[output], asked.models[output]
            if (
                model.formula is not None and own.variable is not None
            ):  # of more variables a reading determines the same
                model = model.model_copy(update={"abscissa": own.variable})
            try:
                (other,) = GeneralEvaluation(asked.table, self._points, {output: model}).each
                if not other.has_points:
                    raise FitError("the points do not give every variable of the other model")
                moved[np.array(base.sensors) == output] = difference(own, other)
            except FitError:
                moved[:] = np.nan
            found.append((output, named, member, moved if np.isfinite(moved).all() else None))
        return found

    def elsewhere(self, used: Collection[str]) -> Sequence[TracedEvaluation]:
        """This evaluation with quantities outside `used` as they were in some rows of the run; itself if there
        are none. At some rows, evenly along the quantities, in their order.
        """
        names = {name for one in self._each for name in one.calibration.formula.names}
        free = sorted(name for name in names if name not in used and name in self._table.columns)
        if not free:
            return (self,)
        order = np.lexsort([self._table.columns[name] for name in free])
        rows = order[np.linspace(0, len(order) - 1, min(ROWS, len(order))).astype(int)]
        found = []
        for row in rows.tolist():
            there = copy(self)
            for made in ("results", "_moved"):
                there.__dict__.pop(made, None)
            values = {name: float(self._table.columns[name][row]) for name in free}
            there._each = [
                replace(one, at={n: np.full_like(at, values[n]) if n in values else at for n, at in one.at.items()})
                for one in self._each
            ]
            found.append(there)
        return found

    def model_errors(self) -> Iterator[TypeA]:
        """Differences between models that the run cannot separate, as covariances of the results."""
        return alike((f"{output}, {named}", member, moved) for output, named, member, moved in self._moved)

    def notes(self) -> Iterable[str]:
        """Sentences about the scatter."""
        yield from super().notes()
        for output, told in self._found.notes.items():
            yield from (f"{output}: {note}" for note in told)
        for output, named, member, moved in self._moved:
            if moved is None:
                yield f"{output}: no number covers {member} in place of {named}: it does not determine the results"

    def not_kept(self) -> Iterable[str]:
        """Sentences about lines of the budget that a calibration file cannot keep for its use."""
        yield from super().not_kept()
        yield from (f"{one.name}{NOT_COVERED}" for one in self.model_errors())


def _traced(table: Table, ignore: Sequence[str]) -> WithEffects:
    """The run with the effects that its trace finds."""
    asked = RunModels.of(table)
    assert asked is not None  # a run's own outputs
    return with_effects(asked, trace_run(asked, validate=False, ignore=ignore), covered=True)


def _with_means(table: Table, at: Sequence[Mapping[str, float]]) -> list[Mapping[str, float]]:
    """Points with the means of recorded quantities that they do not give."""
    means = {name: float(f"{table.columns[name].mean():.4g}") for name in recorded(table)}
    return [{**means, **one} for one in at]
