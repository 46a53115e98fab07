"""The report of a confirmation: which explanation holds, and both models on a run that neither has seen."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from fitter.confirm.judge import Confirmation
from fitter.trace.outcome import Figure
from procedures.attitude.parameters import SCALE, UNIT
from procedures.effect_plots import draw
from rig.atomic import write_whole
from rig.closed_loop.confirm.answers import Confirmed, chance, sentences, sizes
from rig.report.frame import render
from rig.tables.observations import run_table

_VARIABLES = {
    "pitch_deg": ("pitch / deg", 1.0),
    "roll_deg": ("roll / deg", 1.0),
    "sensor_temperature_degC": ("sensor temperature / degC", 1.0),
    "sse_temperature_degC": ("electronics temperature / degC", 1.0),
    "pressure_psia": ("pressure / psia", 1.0),
    "elapsed_s": ("bench time / h", 1 / 3600.0),
}
"""What residuals of the further run are drawn over: label and scale."""
_DRAWN = 3
"""Sensors drawn for each effect, those that show most of it."""


def write_confirm_report(path: Path, confirmed: Confirmed) -> None:
    """Write a self-contained HTML report, whole or not at all. Raises `UsageError` if the disk refuses."""
    text = confirm_report(confirmed)
    write_whole(path, lambda file: file.write(text))


def confirm_report(confirmed: Confirmed) -> str:
    """The report as HTML; its provenance is that of the further run."""
    told, errors = confirmed.to_json(), confirmed.judged.errors
    return render(
        "confirm.html.j2",
        run_table(confirmed.path),
        span_s=float(np.ptp(confirmed.data.elapsed_s)),
        first=confirmed.first.path.name,
        unit=confirmed.unit,
        sentences=list(sentences(confirmed)),
        taken_out=confirmed.own,
        errors=[
            [name, *(f"{confirmed.inferred(e, v):.3g}" for v in (e.before, e.after, e.sigma))]
            for name, e in errors.items()
        ],
        answers=[_answer(confirmed, a, json) for a, json in zip(confirmed.answers, told["effects"], strict=True)],
    )


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
                "sizes": sizes(m) or ["this run does not tell"],
            }
            for m in answer.members
        ],
        "plots": [
            {
                "alt": f"{name}: this run less what the first predicts, without {answer.effect} and with all effects",
                "png": _plot(confirmed, answer, name),
            }
            for name in most[:_DRAWN]
        ],
    }


def _plot(confirmed: Confirmed, answer: Confirmation, sensor: str) -> str:
    """Residuals of the further run without and with one effect, over the variable its best explanation goes by."""
    against, data, judged = answer.members[0].against, confirmed.data, confirmed.judged
    name = against if against in _VARIABLES and hasattr(data, against) else "elapsed_s"
    label, scale = _VARIABLES[name]
    values = np.asarray(getattr(data, name), np.float64)[judged.kept] * scale
    error = judged.errors[sensor]
    unit, scale = (UNIT, SCALE) if confirmed.unit == "deg" else ("mpsi", 1e3)
    adds = confirmed.inferred(error, judged.adds[answer.effect, sensor]) * scale
    return draw(Figure(values, label, confirmed.inferred(error, error.residual_after) * scale, adds, unit))
