"""Budgets of pressure transducers with the effects that a trace finds, and the model error of causes that look alike.

An effect that is a function of pressure and temperatures becomes terms of the model, in every transducer. Any other is
in no calibration, and stays in the scatter. Where the data cannot separate an effect from others, the results by every
one of them are as good, and their rms difference from those by the named one is a line of its own.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property

import numpy as np

from fitter.arrays import FloatArray
from fitter.budget import TypeA
from fitter.errors import FitError
from fitter.trace.found import Explanation
from procedures.budgeting import alike
from procedures.pressure.budget import Point, PressureEvaluation, Transducer
from procedures.pressure.data import WholePlotData
from procedures.pressure.trace import WholePlotTrace

Terms = tuple[str, ...]


class TracedEvaluation(PressureEvaluation):
    """All transducers of a run, by the declared model with traced effects and GLS."""

    def __init__(self, data: WholePlotData, model: str, at: Sequence[Point], trace: WholePlotTrace) -> None:
        self._model, self._points = model, at
        found = {one.effect for sensor in trace.sensors.values() for one in sensor.effects if one.stratum != "noise"}
        self._classes = {name: known for name, known in trace.explanations.items() if name in found}
        self._terms = {
            name: _terms(next(one for one in known if one.effect == name)) for name, known in self._classes.items()
        }
        self._concerned = {
            name: {s for s, one in trace.sensors.items() if any(e.effect == name for e in one.effects)}
            for name in found
        }
        super().__init__(data, model, at, _extra(self._terms))

    @cached_property
    def _moved(self) -> Sequence[tuple[str, str, FloatArray | None]]:
        """Effect, other cause, and (m,) how far the results by that one are away; None if it gives none."""
        found = []
        for name, known in self._classes.items():
            for other in (one for one in known if one.alias and one.effect != name):
                terms = {**self._terms, name: _terms(other)}
                if _extra(terms) == _extra(self._terms):
                    continue
                try:
                    every = PressureEvaluation(self._data, self._model, self._points, _extra(terms)).each
                    parts = [self._part(name, *pair) for pair in zip(self.each, every, strict=True)]
                    moved = np.concatenate(parts)
                except FitError:
                    moved = np.array([np.nan])
                found.append((name, other.effect, moved if np.isfinite(moved).all() else None))
        return found

    def _part(self, name: str, own: Transducer, other: Transducer) -> FloatArray:
        moved = _difference(own, other)
        return moved if own.name in self._concerned[name] else np.zeros_like(moved)

    def model_errors(self) -> Iterator[TypeA]:
        """See `Evaluation`."""
        by_named: dict[str, list[tuple[str, FloatArray]]] = {}
        for named, member, moved in self._moved:
            if moved is not None:
                by_named.setdefault(named, []).append((member, moved))
        yield from (alike(named, members) for named, members in by_named.items())

    def notes(self) -> Iterable[str]:
        """See `Evaluation`."""
        yield from super().notes()
        for name, terms in self._terms.items():
            if terms:
                yield f"with the effect {name}, as terms of the model: {', '.join(terms)}"
            else:
                yield f"{name} is no function of pressure and temperatures: it is in the scatter, not in the model"
        for named, member, moved in self._moved:
            if moved is None:
                yield f"no number covers {member} in place of {named}: it does not determine the results"


def _terms(one: Explanation) -> Terms:
    """Formulas of an explanation; () if it is no function of pressure and temperatures."""
    formulas = [str(getattr(candidate.term, "formula", "") or "") for candidate in one.terms]
    return tuple(dict.fromkeys(formulas)) if all(formulas) else ()


def _extra(terms: Mapping[str, Terms]) -> Terms:
    return tuple(dict.fromkeys(term for one in terms.values() for term in one))


def _difference(own: Transducer, other: Transducer) -> FloatArray:
    """(m,) results by another model, less those by the own; a coefficient that one of them has not differs by 0."""
    theirs = dict(zip(other.terms, other.fitted.tolist(), strict=True))
    kept = own.fitted.tolist()
    coefficients = [theirs.get(name, value) - value for name, value in zip(own.terms, kept, strict=True)]
    mine, found = own.values(own.fitted, own.readings), other.values(other.fitted, own.readings)
    return np.concatenate([coefficients, found[len(theirs) :] - mine[len(kept) :]])
