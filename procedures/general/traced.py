"""Calibrations of a run's sensors with the effects that a trace finds: `rig fit RUN --traced`.

An effect that is a function of the factors becomes a term of the model. Any other (of time, order, direction, or a
recorded quantity) is fitted and then left out: its contribution by the trace is taken off the outputs, so that the
calibration is that of a sensor at rest, half-way through the run.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fitter.arrays import FloatArray
from fitter.effects.entry import Entry
from procedures.general.confirming import usable_term
from procedures.general.effects.of_time import WARM_UP
from procedures.general.effects.time_columns import lag, previous
from procedures.general.of_runs import Asked, RunFitted, fit_run, noted_of, trace_run
from procedures.general.together import TIME
from procedures.general.trace import FoundTableEffect, TableTrace


@dataclass(frozen=True, eq=False)
class Part:
    """Part of an effect in a calibration.

    Attributes:
        terms: of the model, if it is a function of the factors; () otherwise.
        off: (n,) contribution that is taken off the output otherwise, in order of time; zero for a term.
    """

    terms: tuple[str, ...]
    off: FloatArray


@dataclass(frozen=True, eq=False)
class WithEffects:
    """A run with the effects that a trace finds.

    Attributes:
        asked: the run: outputs without effects that are left out, models with the terms of the others.
        notes: sentences about the effects, by output.
        others: output, effect, another cause that the data cannot separate from it, and the run with that one.
    """

    asked: Asked
    notes: Mapping[str, list[str]]
    others: tuple[tuple[str, str, str, Asked], ...]


def fit_traced(asked: Asked, leave_out: Sequence[str], own: Sequence[Entry]) -> RunFitted:
    """Trace every sensor, and fit its model with what was found.

    Raises:
        DataError: as for a fit and a trace.
    """
    found = with_effects(asked, own)
    return noted_of(fit_run(found.asked, leave_out), found.notes)


def with_effects(asked: Asked, own: Sequence[Entry], *, covered: bool = False) -> WithEffects:
    """Trace every sensor of a run.

    Args:
        asked: the run.
        own: effects of the laboratory.
        covered: whether intervals will cover the other causes.

    Raises:
        DataError: as for a trace.
    """
    traced = trace_run(asked, own)
    parts: dict[str, dict[str, Part]] = {output: {} for output in asked.models}
    notes: dict[str, list[str]] = {output: [] for output in asked.models}
    replaced: list[tuple[str, str, str, Part]] = []
    for output, one in traced.each.items():
        for effect in one.trace.added:
            part = _part(asked, one.trace, _candidates(one.trace, effect), np.array(effect.coefficients))
            parts[output][effect.effect] = part
            notes[output] += [told for told in (_doubt(effect, covered=covered), _used(effect, part)) if told]
            replaced += [(output, effect.effect, *other) for other in _others(asked, one.trace, effect)]
    for output in traced.not_traced:
        notes[output] = ["it was not traced: its declared model is not linear in its coefficients"]
    others = (
        (output, name, member, _run_with(asked, {**parts, output: {**parts[output], name: part}}))
        for output, name, member, part in replaced
    )
    return WithEffects(_run_with(asked, parts), notes, tuple(others))


def _run_with(asked: Asked, parts: Mapping[str, Mapping[str, Part]]) -> Asked:
    table = asked.table
    order = np.argsort(table.columns[TIME], kind="stable")
    columns = dict(table.columns)
    for output, by_effect in parts.items():
        columns[output] = np.array(columns[output], np.float64)
        for part in by_effect.values():
            columns[output][order] -= part.off
    terms = {output: [term for part in by.values() for term in part.terms] for output, by in parts.items()}
    return replace(asked, table=replace(table, columns=columns)).adding(terms)


def _used(effect: FoundTableEffect, part: Part) -> str:
    if part.terms:
        return f"{effect.effect} is in the calibration: {', '.join(effect.terms)}"
    return (
        f"{effect.effect} was fitted and is left out of the calibration: it is no function of the factors. Intervals "
        f"take its size as known"
    )


def _doubt(effect: FoundTableEffect, *, covered: bool) -> str:
    """A sentence about what is open in a name; "" if nothing is."""
    said = [f"it is doubtful: {effect.doubtful}"] if effect.doubtful else []
    said += [f"these data cannot separate it from {', '.join(effect.aliases)}"] if effect.aliases else []
    open_ = "" if covered else "; intervals do not cover that"
    return f"{effect.effect}: {'; '.join(said)}{open_}" if said else ""


def _candidates(trace: TableTrace, effect: FoundTableEffect) -> tuple[int, ...]:
    judge, chosen = trace.search.judge, trace.search.chosen
    return tuple(j for j in chosen if judge.candidates[j].effect.name == effect.effect)


def _others(asked: Asked, trace: TableTrace, effect: FoundTableEffect) -> Iterator[tuple[str, Part]]:
    """Every other cause of an effect that the data cannot separate from it, and what it is in the calibration."""
    judge, chosen = trace.search.judge, trace.search.chosen
    problem, mine = judge.problem, _candidates(trace, effect)
    beside = problem.model([j for j in chosen if j not in mine])
    for rival in judge.rivals(chosen, effect.effect):
        if not rival.alias or rival.effect == effect.effect or set(rival.terms) & set(chosen):
            continue
        columns = np.hstack([beside, problem.of(rival.terms)])
        fitted = np.asarray(np.linalg.lstsq(columns, problem.y, rcond=None)[0], np.float64)
        yield rival.effect, _part(asked, trace, rival.terms, fitted[beside.shape[1] :])


def _part(asked: Asked, trace: TableTrace, candidates: Sequence[int], coefficients: FloatArray) -> Part:
    """An effect in the calibration, by its candidates; its contribution beyond that in use is taken off if it is no
    function of the factors.
    """
    judge, columns = trace.search.judge, trace.search.judge.problem.of(candidates)
    labels = [label for j in candidates for label in judge.candidates[j].term.labels]
    usable = [usable_term(label, asked.table.factors) for label in labels]
    if all(usable):
        return Part(tuple(f"I({label})" for label in usable), np.zeros(len(columns)))
    effect = judge.candidates[candidates[0]].effect
    if effect.kind.terms is lag:  # at rest a lag is its setting
        v = trace.variables[effect.columns[0]]
        columns = columns - (v - v.mean())[:, None]
        columns = columns - columns[:1]
    elif effect.kind.terms is not previous and effect.kind.name != WARM_UP.name and effect.family != "direction":
        columns = columns - columns.mean(axis=0)
    return Part((), np.asarray(columns @ coefficients))
