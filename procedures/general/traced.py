"""Calibrations of a run's sensors with the effects that a trace finds: `rig fit RUN --traced`.

An effect that is a function of the factors and of recorded quantities, such as a temperature, becomes a term of the
model; `rig infer` takes these quantities from the readings. Any other (of time, order, direction) is fitted and then
left out: its contribution by the trace is taken off the outputs, so that the calibration is that of a sensor at rest,
half-way through the run.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rig.fitter.arithmetic_text import parse_expression
from rig.fitter.arrays import FloatArray
from rig.fitter.effects.history import Laboratory
from rig.fitter.errors import FitError
from rig.fitter.linear import orthonormal, spanned
from rig.fitter.trace.outcome import Outcome
from rig.procedures.column_names import unit_of
from rig.procedures.general.effects.columns import less, middle, origin
from rig.procedures.general.effects.literal import arithmetic
from rig.procedures.general.effects.of_time import WARM_UP
from rig.procedures.general.effects.time_columns import lag, of_start, previous
from rig.procedures.general.of_runs import RunFitted, RunModels, RunTraced, fit_run, noted_of, recorded, trace_run
from rig.procedures.general.own_time import TIME
from rig.procedures.general.trace import FoundTableEffect, TableTrace
from rig.procedures.general.trace.estimate import of_constants
from rig.procedures.present.terms import in_words
from rig.procedures.tables.table import Table

KNOWN = "intervals of the fit itself hold in that state alone, and have no part for the error of this effect"
IN_RUN = ". In the run "
HALF_WAY = "half-way between both directions"
_NAME = re.compile(r"[^\W\d]\w*")


@dataclass(frozen=True, eq=False)
class Part:
    """Part of an effect in a calibration.

    Attributes:
        terms: of the model: the effect, if it is a function of known quantities; otherwise its value at rest.
        off: (n,) contribution that is taken off the output otherwise, in order of time; zero for a term.
        holds: for which state the calibration holds without it, in words; "" if it is in the calibration.
        slopes: (n, c) direction in which that contribution changes with each of its searched constants.
    """

    terms: tuple[str, ...]
    off: FloatArray
    holds: str = ""
    slopes: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))


@dataclass(frozen=True, eq=False)
class WithEffects:
    """A run with the effects that a trace finds.

    Attributes:
        asked: the run: outputs without effects that are left out, models with the terms of the others.
        notes: sentences about the effects, by output.
        others: output, effect, another cause that the data cannot separate from it, and the run with that one.
        off: (n, q) effects that were taken off, by output.
        slopes: (n, c) their changes with searched constants.
        by_side: (n,) the part of them that is of the direction of approach, or that these data cannot separate from it.
        outcomes: of the trace, one for each sensor.
        holds: for which state the calibration holds without an effect, in words, by output and effect.
    """

    asked: RunModels
    notes: Mapping[str, list[str]]
    others: tuple[tuple[str, str, str, RunModels], ...]
    off: Mapping[str, FloatArray]
    slopes: Mapping[str, FloatArray]
    by_side: Mapping[str, FloatArray]
    outcomes: Sequence[Outcome]
    holds: Mapping[str, Mapping[str, str]] = field(default_factory=dict)


def fit_traced(asked: RunModels, leave_out: Sequence[str], own: Laboratory, ignore: Sequence[str] = ()) -> RunFitted:
    """Trace every sensor, but not what columns to ignore say, and fit its model with what was found.

    Raises:
        DataError: as for a fit and a trace.
    """
    found = with_effects(asked, trace_run(asked, own, validate=False, ignore=ignore))
    return noted_of(fit_run(found.asked, leave_out), found.notes)


def with_effects(
    asked: RunModels, traced: RunTraced, *, covered: bool = False, only: Mapping[str, str] | None = None
) -> WithEffects:
    """A run with the effects that its trace found.

    Args:
        asked: the run.
        traced: its trace.
        covered: whether intervals will cover the other causes, and the error of what is taken off.
        only: effects, each with the cause in whose place it stands, itself or one that the data cannot separate from
            it; all effects, as they are, if None.
    """
    parts: dict[str, dict[str, Part]] = {output: {} for output in asked.models}
    notes: dict[str, list[str]] = {output: [] for output in asked.models}
    holds: dict[str, dict[str, str]] = {output: {} for output in asked.models}
    replaced: list[tuple[str, str, str, Part]] = []
    for output, one in traced.each.items():
        for effect in one.trace.added if output in parts else ():
            part = _part(asked, one.trace, _candidates(one.trace, effect), np.array(effect.coefficients))
            name = effect.effect
            others = list(_others(asked, output, one.trace, effect))
            if only is None:
                notes[output] += filter(None, [_doubt(effect, covered=covered)])
                replaced += [(output, effect.effect, *other) for other in others]
            else:
                name = only.get(effect.effect, "")
                every = {**dict(others), effect.effect: part}
                if name not in every:
                    continue
                part = every[name]
            parts[output][effect.effect] = part
            if part.holds:
                holds[output][name] = part.holds
            if not (covered and part.holds):  # a budget says for which states it holds, and how far the run was away
                notes[output].append(_used(name, part, output, asked.table, covered=covered))
    for output in traced.not_traced:
        notes[output] = ["it was not traced: its declared model is not linear in its coefficients"]
    runs = (
        (output, name, member, _run_with(asked, {**parts, output: {**parts[output], name: part}}))
        for output, name, member, part in replaced
    )
    back = np.argsort(np.argsort(asked.table.columns[TIME], kind="stable"), kind="stable")
    perhaps = {(output, name) for output, name, _, part in replaced if part.holds == HALF_WAY}
    off, slopes, by_side = {}, {}, {}
    for output, by in parts.items():
        if each := [part for part in by.values() if part.off.any()]:
            off[output] = np.column_stack([part.off for part in each])[back]
            slopes[output] = np.column_stack([part.slopes for part in each])[back]
        sided = [part.off[back] for name, part in by.items() if part.holds == HALF_WAY or (output, name) in perhaps]
        if sided:
            by_side[output] = np.asarray(np.sum(sided, axis=0))
    return WithEffects(_run_with(asked, parts), notes, tuple(runs), off, slopes, by_side, traced.outcomes, holds)


def _run_with(asked: RunModels, parts: Mapping[str, Mapping[str, Part]]) -> RunModels:
    table = asked.table
    order = np.argsort(table.columns[TIME], kind="stable")
    columns = dict(table.columns)
    for output, by_effect in parts.items():
        columns[output] = np.array(columns[output], np.float64)
        for part in by_effect.values():
            columns[output][order] -= part.off
    terms = {
        output: list(dict.fromkeys(term for part in by.values() for term in part.terms)) for output, by in parts.items()
    }
    return replace(asked, table=replace(table, columns=columns)).adding(terms)


def _used(name: str, part: Part, output: str, table: Table, *, covered: bool) -> str:
    if part.holds:
        size = f"{np.max(np.abs(part.off)):.3g} {unit_of(output)}".strip()
        state = f"{name} was fitted and taken off: the calibration holds {part.holds}; {KNOWN}"
        return f"{state}{IN_RUN}{output} was up to {size} away from that"
    terms = ", ".join(map(in_words, part.terms))
    told = f"{name} is in the {'model of the results' if covered else 'calibration'}: {terms}"
    used = [one for one in recorded(table) if any(one in _NAME.findall(term) for term in part.terms)]
    where = ", ".join(f"{one} ({np.min(table.columns[one]):.5g} to {np.max(table.columns[one]):.5g})" for one in used)
    return f"{told}; readings in use need {where}" if used else told


def _doubt(effect: FoundTableEffect, *, covered: bool) -> str:
    """A sentence about what is open in a name; "" if nothing is."""
    said = [f"it is doubtful: {effect.doubtful}"] if effect.doubtful else []
    said += [f"these data cannot separate it from {', '.join(effect.aliases)}"] if effect.aliases else []
    open_ = "" if covered else "; intervals do not cover that"
    return f"{effect.effect}: {'; '.join(said)}{open_}" if said else ""


def _candidates(trace: TableTrace, effect: FoundTableEffect) -> tuple[int, ...]:
    judge, chosen = trace.search.judge, trace.search.chosen
    return tuple(j for j in chosen if judge.candidates[j].effect.name == effect.effect)


def _others(asked: RunModels, output: str, trace: TableTrace, effect: FoundTableEffect) -> Iterator[tuple[str, Part]]:
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


def _part(asked: RunModels, trace: TableTrace, candidates: Sequence[int], coefficients: FloatArray) -> Part:
    """An effect in the calibration, by its candidates; its contribution beyond that in use is taken off if it is no
    function of known quantities.
    """
    judge, columns = trace.search.judge, trace.search.judge.problem.of(candidates)
    labels = [label for j in candidates for label in judge.candidates[j].term.labels]
    known = (*asked.table.factors, *recorded(asked.table))
    usable = [usable_term(label, known) for label in labels]
    if all(usable):
        return Part(tuple(f"I({label})" for label in usable), np.zeros(len(columns)))
    effect = judge.candidates[candidates[0]].effect
    slopes = of_constants(judge, candidates, coefficients)[0]
    terms: tuple[str, ...] = ()
    if effect.kind.terms is lag:  # at rest a lag is its setting, which the model needs
        name = effect.columns[0]
        v = trace.variables[name]
        curved = not spanned(v, orthonormal(judge.problem.declared))
        if not (curved and effect.kind.of == "setting by the clock"):  # that one is what it is away from its rest
            # what is remembered fades by itself; the lag is at rest where it is its setting
            columns = columns - np.where([of_start(label) for label in labels], 0.0, (v - middle(v))[:, None])
            at_rest = usable_term(less(name, middle(v)), known)
            terms = (f"I({at_rest})",) if at_rest and curved else ()
        holds = f"at rest, when {name} has long been what it is"
    elif effect.kind.terms is previous:
        holds = f"for a {effect.columns[0]} that was the same before"
    elif effect.kind.name == WARM_UP.name:
        holds = "long after the start"
    elif effect.family == "direction":
        holds = HALF_WAY
    else:
        settings = [trace.variables[one] for one in effect.columns if one in known]
        columns, slopes = (one - _mean_over_time(one, settings) for one in (columns, slopes))
        holds = "for its mean over the run"
    return Part(terms, np.asarray(columns @ coefficients), holds, slopes)


def _mean_over_time(columns: FloatArray, settings: Sequence[FloatArray]) -> FloatArray:
    """(n, q) what columns are at each row's setting, in the mean over the run.

    A column that is a product of a setting and of a function of time, such as that of a drifting sensitivity, keeps the
    setting: the mean of the product would be a change of the offset, and the sensitivity that of the first row.
    """
    if len(settings) != 1:
        return np.asarray(columns.mean(axis=0))
    v = settings[0] - origin(settings[0])
    there = v != 0.0
    return np.asarray(v[:, None] * np.mean(columns[there] / v[there, None], axis=0))


def usable_term(label: str, known: Sequence[str]) -> str:
    """A column of an effect as arithmetic of quantities that are known when a sensor is used; "" if it is none."""
    try:
        text = arithmetic(label)
        names = parse_expression(text).names
    except FitError:
        return ""
    return text if names and set(names) <= set(known) else ""
