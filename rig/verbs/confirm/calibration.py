"""A calibration with effects confirmed by a follow-up run: `rig fit RUN --confirmed-by LATER`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from rig.by_kind import known
from rig.errors import UsageError
from rig.fitter.confirm import Confirmation, Hypothesis, Member
from rig.procedures.evaluate.confirming import SETTLED, ConfirmedFit
from rig.procedures.evaluate.results import Options
from rig.procedures.tables.table import Table
from rig.tables.table_of_run import run_table
from rig.verbs.confirm.answers import Confirmed, evidence, judge
from rig.verbs.confirm.first import First, open_traced


def fit_confirmed(
    run: Path, later: Sequence[Path], options: Options, read: Callable[[Path], Table] = run_table
) -> ConfirmedFit:
    """The calibration of a run with the causes confirmed by later ones.

    Args:
        run: the traced run.
        later: the judging runs.
        options: of `rig fit`, as declared by the run's kind; those that `rig trace` also has are passed to the trace.
        read: gives the table of a run file, such as one with the corrections of certificates.

    Raises:
        UsageError: one is not a run file, or they do not belong together.
        rig.procedures.errors.DataError: an option is not permitted here.
    """
    if any(path.suffix == ".csv" for path in (run, *later)):
        raise UsageError("--confirmed-by takes two run files: tables have no bench and no time")
    given = options.model_dump(exclude_unset=True)
    traced = {name: given[name] for name in ("formula", "temperature", "response", "ignore") if name in given}
    first = open_traced(run, read, later, **traced)
    return with_confirmed(first, judge(first, *later), options)


def with_confirmed(first: First, confirmed: Confirmed, options: Options) -> ConfirmedFit:
    """The calibration of the first run with the remaining explanations of every effect; see `fit_confirmed`."""
    record = provenance(first, confirmed)
    fitted = first.confirming.calibrated(confirmed.answers, first.questions, record, options)
    for effect in record["effects"]:
        del effect["told"]
        if shared := first.shared(effect["named"]):
            effect["used"] += f". {shared}"
    return fitted


def settled_as(first: First, told: Confirmed | None, holds: Mapping[str, Hypothesis]) -> ConfirmedFit:
    """The calibration as it would be if further runs settled some effects, for a forecast.

    Args:
        first: the traced run.
        told: its judgement by the further runs so far; None without one.
        holds: by effect, the explanation that would be left of it; others are as `told` says.

    Raises:
        rig.fitter.errors.FitError: the run does not determine such a model.
        rig.procedures.errors.DataError: the same.
    """
    known_of = {one.effect: one for one in told.answers} if told is not None else {}
    answers = [
        Confirmation(one.effect, (_as_shown(holds[one.effect]),), holder=holds[one.effect].terms, question=one)
        if one.effect in holds
        else known_of.get(one.effect, Confirmation(one.effect, ()))
        for one in first.questions
    ]
    effects: Any = [{"named": one.effect, "verdict": one.verdict, "told": one.effect, "used": ""} for one in answers]
    options = known(first.traced.table).fit_options()
    return first.confirming.calibrated(answers, first.questions, {"effects": effects}, options)


def _as_shown(one: Hypothesis) -> Member:
    """An explanation as a further run that settles it would show it."""
    size = {"coefficients": (1.0,), "intervals": ((0.5, 1.5),), "together": (1.0,), "intervals_together": ((0.5, 1.5),)}
    of_run = {"p_changed": 1.0, "shown": math.inf, "expected": math.inf, "p_shown": 0.0, "limit": one.limit(math.inf)}
    more: dict[str, Any] = {**size, **of_run, "missed": math.inf, "fits": True, "sizes": {}, "against": ""}
    return Member(one.effect, one.causes, 0.0, terms=(one.effect,), **more)


def provenance(first: First, confirmed: Confirmed) -> dict[str, Any]:
    """Both runs, and for every effect the verdict, the used explanation and the evidence, as JSON values."""
    told = confirmed.to_json()["effects"]
    return {
        "run_id": first.traced.table.provenance["run_id"],
        "by_run_id": ", ".join(run_table(path).provenance["run_id"] for path in confirmed.paths),
        "effects": [
            {
                "named": answer.effect,
                "verdict": answer.verdict,
                "holds": list(answer.holding),
                "told": _verdict(answer),
                "used": _used(answer),
                "evidence": evidence(answer) or one["sentence"],
                "members": one["members"],
            }
            for answer, one in zip(confirmed.answers, told, strict=True)
        ],
    }


def _verdict(answer: Confirmation) -> str:
    if answer.verdict == "replaced":
        return f"{answer.effect}: replaced by {answer.holding[0]} by the follow-up run"
    return f"{answer.effect}: {answer.verdict} by the follow-up run"


def _used(answer: Confirmation) -> str:
    """Sentence about an effect's class in the calibration."""
    if answer.verdict in SETTLED:
        return f"{_verdict(answer)}; the calibration has {answer.holding[0]} alone"
    if answer.verdict == "undecided":
        return f"{_verdict(answer)}; intervals cover {', '.join(answer.holding)}"
    if answer.verdict == "not shown":
        return f"{_verdict(answer)}; intervals cover every cause that the first run cannot separate"
    return (
        f"{_verdict(answer)}: none of its causes holds in both runs; the calibration uses the first run, intervals "
        "cover every cause that it cannot separate and may still be invalid"
    )
