"""Results of sensors that are calibrated one by one, each by its own fit: what budgets of such kinds have in common."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import cached_property
from typing import Protocol

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.budget import TypeA
from rig.fitter.errors import FitError
from rig.procedures.evaluate.budgeting import SCATTER, Evaluation, Results, Shift, no_error, together
from rig.procedures.evaluate.reversibility import line_of


class Calibrated(Protocol):
    """One sensor of a run, with its calibration."""

    @property
    def name(self) -> str:
        """Its output's column."""

    @property
    def uses(self) -> Collection[str]:
        """Columns that its calibration depends on: settings of its model, and its output."""

    @property
    def terms(self) -> Sequence[str]:
        """Names of its coefficients."""

    @property
    def fitted(self) -> FloatArray:
        """(k,) coefficients of its calibration."""

    def coefficients(self, moved: Mapping[str, FloatArray]) -> FloatArray:
        """(k,) coefficients with additions to columns that it uses."""

    @property
    def readings(self) -> FloatArray:
        """(p,) outputs at the points; none if the points are not given for its model."""

    @property
    def places(self) -> Sequence[Mapping[str, float]]:
        """Settings at each of the (p,) points."""

    def values(self, coefficients: FloatArray, readings: FloatArray) -> FloatArray:
        """Its results: coefficients, outputs, and inferred values of (p,) readings."""

    def named(self) -> Iterator[tuple[str, str]]:
        """Name and unit of every result."""

    def scatter(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(m, m) covariance of its results; (m,) degrees of freedom; (m,) variances by the fit alone."""

    @property
    def reversibility(self) -> tuple[FloatArray, FloatArray] | None:
        """(2, m) its results of rising and of falling series, less its results, and (m,) the variance of half of their
        difference; None if they do not differ.
        """


class EvaluationBySensor(Evaluation):
    """All sensors of a run, each by its own fit."""

    @property
    @abstractmethod
    def each(self) -> Sequence[Calibrated]:
        """The sensors, in the order of the results."""

    scatter = SCATTER
    """Name and source of the covariance by the fit."""

    def reversibility(self) -> Iterator[TypeA]:
        """Differences between rising and falling series, as covariances of the results, which are half-way between."""
        ends = np.cumsum([len(list(one.named())) for one in self.each])
        for one, end in zip(self.each, ends.tolist(), strict=True):
            if (found := one.reversibility) is not None:
                sides, variance = found
                places = (end - sides.shape[1], ends[-1] - end)
                yield line_of(one.name, np.pad(sides, ((0, 0), places)), np.pad(variance, places))

    def coefficients(self, columns: Mapping[str, FloatArray]) -> Mapping[str, FloatArray]:
        """(k,) coefficients of the calibration by sensor, with additions to columns."""
        found = {}
        for one in self.each:
            mine = {name: moved for name, moved in columns.items() if name in one.uses}
            found[one.name] = one.coefficients(mine) if mine else one.fitted
        return found

    def at_rest(self) -> Mapping[str, FloatArray]:
        """(n,) output of each observation by the model alone, by sensor."""
        return super().modelled()

    def modelled(self) -> Mapping[str, FloatArray]:
        """(n,) output of each observation by the model, with all effects that it has or leaves out, by sensor."""
        off = self.aside()
        return {name: values + off.get(name, 0.0) for name, values in self.at_rest().items()}

    def inferred(self, output: str, readings: FloatArray) -> FloatArray:
        """(p,) inferred values of readings of one output at the points."""
        one = next(one for one in self.each if one.name == output)
        return one.values(one.fitted, readings)[-len(readings) :]

    def evaluate(self, shift: Shift) -> FloatArray:
        """(m,) values of the results with changed inputs."""
        coefficients = self.coefficients(shift.columns)
        found = []
        for one in self.each:
            readings = one.readings
            if len(readings) and shift.in_use is not no_error:
                readings = readings + shift.in_use(one.name, readings)
            found.append(one.values(coefficients[one.name], readings))
        return np.concatenate(found)

    @cached_property
    def results(self) -> Results:
        """Results of the columns as they are. Raises `FitError` if a result is not determined at its point."""
        named = [(name, unit, one.name) for one in self.each for name, unit in one.named()]
        values = self.evaluate(Shift())
        if not np.isfinite(values).all():
            lost = named[int(np.flatnonzero(~np.isfinite(values))[0])][0]
            raise FitError(f"{lost}: it is not determined there; choose another point with --at")
        names, units, sensors = zip(*named, strict=True)
        parts = [one.scatter() for one in self.each]
        type_a = TypeA(together([p[0] for p in parts]), np.concatenate([p[1] for p in parts]), *self.scatter)
        at = [place for one in self.each for place in _places(one)]
        return Results(names, units, values, type_a, sensors, np.concatenate([p[2] for p in parts]), tuple(at))


def difference(own: Calibrated, other: Calibrated) -> FloatArray:
    """(m,) results of a sensor by another model, less its own; a coefficient that one of them has not differs by 0."""
    theirs, kept = dict(zip(other.terms, other.fitted.tolist(), strict=True)), own.fitted.tolist()
    coefficients = [theirs.get(name, value) - value for name, value in zip(own.terms, kept, strict=True)]
    mine = own.values(own.fitted, own.readings)[len(kept) :]
    found = other.values(other.fitted, own.readings)[len(theirs) :]
    return np.concatenate([coefficients, found[: len(mine)] - mine])


def _places(one: Calibrated) -> Iterator[Mapping[str, float]]:
    """Settings of each of its results: none of coefficients, then those of the points, for every sort of result."""
    k, every = len(one.fitted), len(list(one.named()))
    yield from ({} for _ in range(k))
    if one.places:
        yield from (place for _ in range((every - k) // len(one.places)) for place in one.places)
