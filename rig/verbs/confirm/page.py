"""The report of a confirmation: the remaining explanation, and both models on a run that neither has used."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from rig.by_kind import known
from rig.files.atomic import write_whole
from rig.fitter.confirm import Confirmation
from rig.fitter.trace.outcome import Figure as View
from rig.procedures.evaluate.results import Page
from rig.procedures.present.effect_plots import draw
from rig.tables.table_of_run import run_table
from rig.verbs.confirm import Confirmed, chance, sentences, sizes, unfit
from rig.verbs.page import render

_DRAWN = 3
"""Maximum number of sensors drawn per effect; those with the largest effect."""


def write_confirm_report(path: Path, confirmed: Confirmed) -> None:
    """Write a self-contained HTML report, completely or not at all. Raises `UsageError` if the disk refuses."""
    text = confirm_report(confirmed)
    write_whole(path, lambda file: file.write(text))


def confirm_report(confirmed: Confirmed) -> str:
    """The report as HTML; its provenance is that of the further run."""
    errors = confirmed.judged.errors
    contents = {
        "first": confirmed.first.path.name,
        "unit": "" if any(confirmed.named(name) != name for name in errors) else confirmed.unit,
        "sentences": list(sentences(confirmed)),
        "taken_out": confirmed.own,
        "errors": shown_errors(confirmed),
        "answers": shown_answers(confirmed),
    }
    table = run_table(confirmed.path)
    span_s = 3600.0 * confirmed.bench_h
    return render(Page("rig.verbs", "confirm.html.j2", table, span_s, known(table).unused(table).to_json(), contents))


def shown_errors(confirmed: Confirmed) -> list[list[str]]:
    """Rows of a table: sensor, error of the declared model on the further runs, with the effects, and of a row."""
    return [
        [confirmed.named(name), *(f"{confirmed.inferred(e, v):.3g}" for v in (e.before, e.after, e.sigma))]
        for name, e in confirmed.judged.errors.items()
    ]


def shown_answers(confirmed: Confirmed) -> list[dict[str, Any]]:
    """Every effect with its explanations, their evidence, and plots of the further runs, for a template."""
    told = confirmed.to_json()["effects"]
    return [_answer(confirmed, a, json) for a, json in zip(confirmed.answers, told, strict=True)]


def _answer(confirmed: Confirmed, answer: Confirmation, told: dict[str, Any]) -> dict[str, Any]:
    adds = {name: rest for (effect, name), rest in confirmed.judged.adds.items() if effect == answer.effect}
    most = sorted((name for name, rest in adds.items() if np.any(rest)), key=lambda name: -float(np.ptp(adds[name])))
    return {
        **told,
        "members": [
            {
                "effect": m.effect,
                "holds": m.holds,
                "behind": f"{m.sigmas:.1f}",
                "p_changed": f"{m.p_changed:.2g}",
                "shown": f"{m.shown:.1f} (limit {m.limit:.1f}), p {chance(m.p_shown)}",
                "fits": "yes" if m.fits else f"no: {unfit(m)}",
                "sizes": sizes(m) or ["not determined by this run"],
            }
            for m in answer.members
        ],
        "plots": [
            {
                "alt": f"{name}: this run minus the prediction by the first; without {answer.effect}; with all effects",
                "figure": _plot(confirmed, answer, name),
            }
            for name in most[:_DRAWN]
        ],
    }


def _plot(confirmed: Confirmed, answer: Confirmation, sensor: str) -> Figure:
    """Residuals of the further run without and with one effect, over the variable of its best explanation."""
    against, judged = answer.members[0].against, confirmed.judged
    variables = {**confirmed.first.confirming.variables(), "elapsed_s": ("bench time / h", 1 / 3600.0)}
    values = confirmed.recorded(against) if against in variables else None
    label, scale = variables["elapsed_s" if values is None else against]
    values = confirmed.recorded("elapsed_s") if values is None else values
    assert values is not None
    values = values[judged.kept] * scale
    error = judged.errors[sensor]
    unit, scale = confirmed.first.confirming.drawn
    adds = confirmed.inferred(error, judged.adds[answer.effect, sensor]) * scale
    return draw(View(values, label, confirmed.inferred(error, error.residual_after) * scale, adds, unit))
