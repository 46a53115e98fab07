"""Calibrations of a run's sensors with the effects that a trace finds: `rig fit RUN --traced`.

An effect that is a function of the factors becomes a term of the model. Any other (of time, order, direction, or a
recorded quantity) is fitted and then left out: its contribution by the trace is taken off the outputs, so that the
calibration is that of a sensor at rest, half-way through the run.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from fitter.arrays import FloatArray
from fitter.effects.entry import Entry
from procedures.general.confirming import usable_term
from procedures.general.effects.of_time import WARM_UP
from procedures.general.effects.time_columns import lag, previous
from procedures.general.of_runs import Asked, RunFitted, fit_run, noted_of, trace_run
from procedures.general.together import TIME
from procedures.general.trace import FoundTableEffect, TableTrace


def fit_traced(asked: Asked, leave_out: Sequence[str], own: Sequence[Entry]) -> RunFitted:
    """Trace every sensor, and fit its model with what was found.

    Raises:
        DataError: as for a fit and a trace.
    """
    traced, table = trace_run(asked, own), asked.table
    order = np.argsort(table.columns[TIME], kind="stable")
    columns, terms, notes = dict(table.columns), dict[str, list[str]](), dict[str, list[str]]()
    for output, one in traced.each.items():
        told = notes.setdefault(output, [])
        for effect in one.trace.added:
            told.append(_doubt(effect))
            usable = [usable_term(label, table.factors) for label in effect.terms]
            if all(usable):
                terms.setdefault(output, []).extend(f"I({label})" for label in usable)
                told.append(f"{effect.effect} is in the calibration: {', '.join(effect.terms)}")
                continue
            read = np.array(columns[output], np.float64)
            read[order] -= _contribution(one.trace, effect)
            columns[output] = read
            told.append(
                f"{effect.effect} was fitted and is left out of the calibration: it is no function of the factors. "
                f"Intervals take its size as known"
            )
    for output in traced.not_traced:
        notes[output] = ["it was not traced: its declared model is not linear in its coefficients"]
    fitted = fit_run(replace(asked, table=replace(table, columns=columns)).adding(terms), leave_out)
    return noted_of(fitted, {output: [note for note in told if note] for output, told in notes.items()})


def _doubt(effect: FoundTableEffect) -> str:
    """A sentence about what is open in a name; "" if nothing is."""
    said = [f"it is doubtful: {effect.doubtful}"] if effect.doubtful else []
    said += [f"these data cannot separate it from {', '.join(effect.aliases)}"] if effect.aliases else []
    return f"{effect.effect}: {'; '.join(said)}; intervals do not cover that" if said else ""


def _contribution(trace: TableTrace, effect: FoundTableEffect) -> FloatArray:
    """(n,) the contribution of an effect beyond that in use, in order of time."""
    judge, chosen = trace.search.judge, trace.search.chosen
    blocks: Iterator[FloatArray] = (
        judge.candidates[j].term.columns for j in chosen if judge.candidates[j].effect.name == effect.effect
    )
    columns = np.hstack(list(blocks))
    kind = next(c.effect.kind for c in judge.candidates if c.effect.name == effect.effect)
    name = next(c.effect.columns[0] for c in judge.candidates if c.effect.name == effect.effect)
    if kind.terms is lag:  # at rest a lag is its setting
        v = trace.variables[name]
        columns = columns - (v - v.mean())[:, None]
        columns = columns - columns[:1]
    elif kind.terms is not previous and kind.name != WARM_UP.name and effect.family != "direction":
        columns = columns - columns.mean(axis=0)
    return np.asarray(columns @ np.array(effect.coefficients))
