"""Budgets of pressure transducers with the effects that a trace finds, and the model error of causes that look alike.

An effect that is a function of pressure and temperatures becomes terms of the model, in every transducer. One of time,
direction or memory is in no calibration: what the trace says it adds to each reading is taken off the outputs, so that
results are those at rest, half-way between both sides, and in the mean over the run for an effect of time. A function
of pressure and temperatures that has no formula, such as a stop that is near, stays in the outputs, and what the model
leaves of it is a line of each output. Where the data cannot separate an effect from others, the results by every one of
them are as good, and their rms difference from those by the named one is a line of its own.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.budget import TypeA
from rig.fitter.errors import FitError
from rig.fitter.trace.found import Explanation
from rig.procedures.evaluate.budget_by_sensor import difference
from rig.procedures.evaluate.budgeting import alike
from rig.procedures.pressure.budget import Point, PressureEvaluation, Transducer
from rig.procedures.pressure.data import WholePlotData
from rig.procedures.pressure.effects.scene import PressureEffect
from rig.procedures.pressure.trace import WholePlotTrace

Terms = tuple[str, ...]
_PASSING = ("elapsed_s", "since_s", "pressure_side", "previous_pressure_psia")
"""What effects are drawn against that are not there at rest."""
_SAME = 0.01
"""Share of the range in which pressures are the same."""
_ENDS = ("warm-up", "outlying-whole-plot")
"""Effects in time that are over, or not there, in most of the run: at rest is without them, not in their mean."""


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
        without = {name for name, terms in self._terms.items() if not terms}
        passing = {name for name in without if _named(trace, name).against in _PASSING}
        self._off = {name: _off(name, trace, data) for name in passing}
        self._held = {name: _state(name, trace) for name in passing}
        self._stays = {name: _added(name, trace) for name in without - passing}
        outputs = dict(data.outputs)
        for by_sensor in self._off.values():
            for sensor, mV in by_sensor.items():
                outputs[sensor] = outputs[sensor] - mV
        self._data = replace(data, outputs=outputs)
        super().__init__(self._data, model, at, _extra(self._terms))
        sided = [by for name, by in self._off.items() if _named(trace, name).against == "pressure_side"]
        for i, one in enumerate(self._each):
            if mine := [by[one.name] for by in sided if one.name in by]:
                self._each[i] = replace(one, by_side=np.sum(mine, axis=0))

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

    def aside(self) -> Mapping[str, FloatArray]:
        """See `Evaluation`."""
        found: dict[str, FloatArray] = {}
        for sensor, mV in (pair for by in self._off.values() for pair in by.items()):
            found[sensor] = found.get(sensor, np.zeros(len(mV))) + mV
        return found

    def holds(self) -> Mapping[str, Mapping[str, str]]:
        """See `Evaluation`."""
        found: dict[str, dict[str, str]] = {one.name: {} for one in self._each}
        for name, by in self._off.items():
            for sensor in by:
                found[sensor][name] = self._held[name]
        return found

    def _part(self, name: str, own: Transducer, other: Transducer) -> FloatArray:
        moved = difference(own, other)
        return moved if own.name in self._concerned[name] else np.zeros_like(moved)

    def model_errors(self) -> Iterator[TypeA]:
        """Differences between models that the run cannot separate, as covariances of the results."""
        yield from alike(self._moved)
        for name, added in self._stays.items():
            left = [_left(one, added.get(one.name), self._data) for one in self.each]
            yield TypeA(np.diag(np.concatenate(left) ** 2), np.inf, f"model: {name}", "trace of the run", "B")

    def notes(self) -> Iterable[str]:
        """Sentences about the scatter."""
        yield from super().notes()
        for name, terms in self._terms.items():
            if terms:
                yield f"with the effect {name}, as terms of the model: {', '.join(terms)}"
            elif name in self._stays:
                yield f"{name} has no formula: it is no term of the model, and outputs have a line for what that leaves"
            else:
                size = max(float(np.max(np.abs(mV))) for mV in self._off[name].values())
                yield (
                    f"{name} is no function of pressure and temperatures: it was taken off the outputs at the size "
                    f"that the trace found, up to {size:.3g} mV; results hold {self._held[name]}"
                )
        for named, member, moved in self._moved:
            if moved is None:
                yield f"no number covers {member} in place of {named}: it does not determine the results"


def _named(trace: WholePlotTrace, name: str) -> PressureEffect:
    """The effect of the catalogue."""
    found: PressureEffect = next(one for one in trace.explanations[name] if one.effect == name).terms[0].effect
    return found


def _added(name: str, trace: WholePlotTrace) -> Mapping[str, FloatArray]:
    """(n,) what an effect adds to the readings of each transducer, mV."""
    pairs = ((sensor, e) for sensor, one in trace.sensors.items() for e in one.effects if e.effect == name)
    return {sensor: e.contribution_mV for sensor, e in pairs}


def _of_time(name: str, trace: WholePlotTrace) -> bool:
    """Whether an effect goes on in time: results hold for its mean over the run."""
    one = _named(trace, name)
    return name not in _ENDS and (one.against == "elapsed_s" or one.source == "time")


def _state(name: str, trace: WholePlotTrace) -> str:
    """For which state results hold without an effect, in words."""
    if _of_time(name, trace):
        return "for its mean over the run"
    return "half-way between both directions" if _named(trace, name).against == "pressure_side" else "at rest"


def _off(name: str, trace: WholePlotTrace, data: WholePlotData) -> Mapping[str, FloatArray]:
    """(n,) the part of it that is not there at rest; of an effect of time, off its mean at each pressure.

    Every whole plot has the same pressures, so a straight line over the pressure is that mean.
    """
    found = _added(name, trace)
    if not _of_time(name, trace):
        return found
    line = np.column_stack([np.ones(len(data)), data.pressure_psia])
    return {sensor: mV - line @ np.linalg.lstsq(line, mV, rcond=None)[0] for sensor, mV in found.items()}


def _left(one: Transducer, added: FloatArray | None, data: WholePlotData) -> FloatArray:
    """(m,) size in each result of what the model leaves of an effect: rms over readings at the nearest pressure."""
    k, p = len(one.fitted), len(one.at)
    found = np.zeros(k + 2 * p)
    if added is None:
        return found
    columns = one.fit.problem.formula.columns(one.fit.problem.data.table)[1]
    left = added - columns @ np.linalg.lstsq(columns, added, rcond=None)[0]
    for i, pressure in enumerate(one.at[:, 0].tolist()):
        away = np.abs(data.pressure_psia - pressure)
        near = away <= away.min() + _SAME * float(np.ptp(data.pressure_psia))
        found[k + i] = np.sqrt(np.mean(left[near] ** 2))
        found[k + p + i] = found[k + i] / abs(float(one.slope[i]))
    return found


def _terms(one: Explanation) -> Terms:
    """Formulas of an explanation; () if it is no function of pressure and temperatures."""
    formulas = [str(getattr(candidate.term, "formula", "") or "") for candidate in one.terms]
    return tuple(dict.fromkeys(formulas)) if all(formulas) else ()


def _extra(terms: Mapping[str, Terms]) -> Terms:
    return tuple(dict.fromkeys(term for one in terms.values() for term in one))
