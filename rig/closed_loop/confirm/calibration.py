"""A calibration with what a follow-up run confirmed: `rig fit RUN --confirmed-by LATER`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fitter.confirm.judge import Confirmation
from procedures.attitude.evaluate import AttitudeTraced, fit_attitude_table
from procedures.pressure.evaluate import WholePlotFitted, fit_whole_plots
from rig.closed_loop.confirm.answers import Confirmed, evidence, judge
from rig.closed_loop.confirm.first import First, open_traced
from rig.errors import UsageError
from rig.tables.observations import run_table

SETTLED = ("confirmed", "replaced")
"""Verdicts that leave one explanation, and show it."""


def confirmed_by(
    run: Path, later: Path, model: str | None = None, *, temperature: bool | None = None
) -> tuple[First, Confirmed]:
    """A run, traced, and what a follow-up run tells of it. Arguments and errors as for `open_traced` and `judge`."""
    if run.suffix == ".csv" or later.suffix == ".csv":
        raise UsageError("--confirmed-by takes two run files: tables do not say on which bench and when they were made")
    first = open_traced(run, model, temperature=temperature)
    return first, judge(first, later)


def fit_attitude_confirmed(first: First, confirmed: Confirmed) -> dict[str, Any]:
    """The calibration of the first run with the causes that the follow-up run confirmed; JSON-ready.

    Where it left several, intervals cover those; where it settled nothing, all that the first run cannot separate.
    """
    traced = first.traced
    assert isinstance(traced, AttitudeTraced)
    allowed = {a.effect: a.holding for a in confirmed.answers if a.verdict in (*SETTLED, "undecided")}
    result = fit_attitude_table(
        traced.table, traced=True, temperature=traced.temperature, found=traced.trace, allowed=allowed
    )
    record = provenance(first, confirmed)
    kept = result["calibration"]
    kept["notes"] = [*kept["notes"], *(effect["used"] for effect in record["effects"])]
    return result | {"confirmed_by": record}


def fit_whole_plots_confirmed(
    first: First, confirmed: Confirmed, model: str, options: Mapping[str, Any]
) -> tuple[WholePlotFitted, dict[str, Any]]:
    """The calibration of the first run with the terms of the causes confirmed, and where they come from.

    Args:
        first: the run that was traced.
        confirmed: what the follow-up run told.
        model: the declared model.
        options: further ones of `fit_whole_plots`.

    """
    record, terms = provenance(first, confirmed), list(options.get("add", ()))
    for answer, effect in zip(confirmed.answers, record["effects"], strict=True):
        effect["terms"] = _terms(first, answer) if answer.verdict in SETTLED else []
        terms += [term for term in effect["terms"] if term not in terms]
        if answer.verdict not in SETTLED:
            effect["used"] = f"{_verdict(answer)}: nothing was added to the calibration for it"
        elif not effect["terms"]:
            effect["used"] = (
                f"{_verdict(answer)}; it is no function of pressure and temperatures: the calibration does not have it"
            )
    fitted = fit_whole_plots(first.traced.table, model, **{**options, "add": tuple(terms)})
    return fitted, record


def _terms(first: First, answer: Confirmation) -> list[str]:
    """Formulas of the cause that holds, as `rig fit --add` takes them; [] if it has none."""
    question = next(q for q in first.questions if q.effect == answer.effect)
    member = next(m for m in question.members if m.effect == answer.holding[0])
    formulas = [str(getattr(candidate.term, "formula", "")) for candidate in member.terms]
    return list(dict.fromkeys(formulas)) if all(formulas) else []


def provenance(first: First, confirmed: Confirmed) -> dict[str, Any]:
    """Both runs, and of every effect the verdict, what is used, and the evidence; JSON-ready."""
    told = confirmed.to_json()["effects"]
    return {
        "run_id": first.traced.table.provenance["run_id"],
        "by_run_id": run_table(confirmed.path).provenance["run_id"],
        "effects": [
            {
                "named": answer.effect,
                "verdict": answer.verdict,
                "holds": list(answer.holding),
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
    """What of an effect's class the calibration has, for a reader of it."""
    if answer.verdict in SETTLED:
        return f"{_verdict(answer)}; the calibration has {answer.holding[0]} alone"
    if answer.verdict == "undecided":
        return f"{_verdict(answer)}; intervals cover {', '.join(answer.holding)}"
    if answer.verdict == "not shown":
        return f"{_verdict(answer)}; intervals cover every cause that the first run cannot separate"
    return (
        f"{_verdict(answer)}: none of its causes holds in both runs; the calibration rests on the first run, intervals "
        "cover every cause that it cannot separate and may still not hold"
    )
