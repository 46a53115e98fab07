"""Findings of a loop, from its first run and from all runs together: events with words and figures."""

from __future__ import annotations

from typing import Any

from rig.by_kind import fit_table
from rig.fitter.errors import FitError
from rig.loop.decide import open_words
from rig.procedures.errors import DataError
from rig.run_file.events.loops import LoopFound
from rig.verbs.confirm import Confirmed, First, sentences


def found_by_first(first: First, runs: int = 1) -> LoopFound:
    """Gross errors, verdict and effects by sensor, and what the data of these runs cannot distinguish."""
    outcomes = first.traced.outcomes
    words = [f"{gross} gross errors"] if (gross := _gross(first)) else []
    by_verdict: dict[str, list[str]] = {}
    for one in outcomes:
        named = ", ".join(found.effect for found in one.named)
        by_verdict.setdefault(f"{one.verdict}{f' by {named}' if named else ''}", []).append(one.sensor)
    words += [f"{', '.join(sensors)}: {verdict}" for verdict, sensors in by_verdict.items()]
    words += [open_words(first)] if first.questions else []
    holds = {q.effect: " or ".join(m.effect for m in q.members if not m.near) for q in first.questions}
    return LoopFound(
        after=runs, words="; ".join(words), verdicts={one.sensor: str(one.verdict) for one in outcomes}, holds=holds
    )


def found_by_later(told: Confirmed, runs: int) -> LoopFound:
    """Verdict on every effect, and the error of both models on the further runs."""
    errors = told.judged.errors.items()
    return LoopFound(
        after=runs,
        words=" ".join(sentences(told)),
        verdicts={one.effect: one.verdict for one in told.answers},
        holds={one.effect: " or ".join(one.holding) for one in told.answers},
        before=_finite({name: told.inferred(one, one.before) for name, one in errors}),
        with_effects=_finite({name: told.inferred(one, one.after) for name, one in errors}),
        unit=told.unit,
    )


def _finite(values: dict[str, Any]) -> dict[str, float]:
    return {name: float(value) for name, value in values.items() if abs(value) < float("inf")}


def _gross(first: First) -> int:
    """Number of gross errors that a fit of the declared model finds; 0 if it cannot be fitted."""
    try:
        fitted = fit_table(first.traced.table).to_json()
    except (DataError, FitError):
        return 0
    sensors = fitted.get("sensors") or {"": fitted}
    rows: set[Any] = set()
    for one in sensors.values():
        rows |= {str(row) for row in (one.get("gross_errors") or {}).get("rows", ())}
    return len(rows)
