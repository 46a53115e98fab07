"""The page of an item: its certificates, and the drift of its results as pictures, drawn as `rig chart` draws them."""

from __future__ import annotations

import io
import re
import threading
from collections.abc import Mapping, Sequence
from datetime import UTC, date, datetime
from typing import Any

import numpy as np

from rig.archive import Lab, history
from rig.archive.answers import Due, History
from rig.errors import RigError
from rig.fitter.errors import FitError
from rig.lab import Laboratory

MOST_CHARTS = 6
_DAYS = 365.25
_INKS = ("#000000", "#262626", "#8c8c8c", "#737373", "#4d4d4d")
"""Greys of our charts, which become the colour of the page's text: light in the dark."""
_ATTRIBUTES = re.compile(r' style="([^"]*)"')
_GRID = "#ebebeb"
_lock = threading.Lock()  # matplotlib's fonts are not for several threads at once


def item_page(lab: Lab, key: str) -> dict[str, Any]:
    """Contents of the page of an item. Raises `UsageError` if no certificate is of it."""
    found = history(lab, key)
    dates = [date.fromisoformat(one["ended"]) for one in found.certificates]
    rows = []
    for what in dict.fromkeys(value["what"] for every in found.values for value in every):
        picked = [(day, _last_state(every, what)) for day, every in zip(dates, found.values, strict=True)]
        there = [(day, value) for day, value in picked if value is not None]
        rows.append({"what": what, "values": [_cells(day, value) for day, value in there], "svg": ""})
        if len(rows) <= MOST_CHARTS:
            rows[-1]["svg"] = _chart(what, there, found.due)
    return {
        "key": key,
        "name": found.thing.name,
        "certificates": _certificates(found),
        "results": rows,
        "due": found.due,
    }


def _last_state(every: Sequence[Mapping[str, Any]], what: str) -> Mapping[str, Any] | None:
    """The value of a result on a certificate: as left, if it was adjusted."""
    same = sorted((one for one in every if one["what"] == what), key=lambda one: not one["left"])
    return same[0] if same else None


def _certificates(found: History) -> list[dict[str, Any]]:
    rows = [
        {key: one[key] for key in ("number", "ended", "customer", "path", "simulated")} for one in found.certificates
    ]
    return rows[::-1]


def _cells(day: date, value: Mapping[str, Any]) -> dict[str, str]:
    low, high = ("" if value[end] is None else f"{value[end]:.6g}" for end in ("lower", "upper"))
    return {
        "day": day.isoformat(),
        "value": f"{value['value']:.6g}",
        "standard": f"{value['standard']:.2g}",
        "tolerance": f"{low} to {high}" if low or high else "",
        "unit": value["unit"],
    }


def _chart(what: str, there: Sequence[tuple[date, Mapping[str, Any]]], due: Due | None) -> str:
    """The drift of a result as SVG for a page; "" for fewer than two days."""
    from rig.fitter.history import chart  # noqa: PLC0415 - matplotlib and scipy take a second to import
    from rig.fitter.history.charted import Charted  # noqa: PLC0415
    from rig.fitter.history.series import Series  # noqa: PLC0415
    from rig.procedures.evaluate.charting import Shown  # noqa: PLC0415
    from rig.procedures.present.pictures import grid, legend_below  # noqa: PLC0415
    from rig.verbs.chart.page import draw_dates, draw_history  # noqa: PLC0415

    days = list(dict(there))
    if len(days) < 2:
        return ""
    each = dict(there)
    years = np.array([(day - days[0]).days / _DAYS for day in days])
    values = np.array([float(each[day]["value"]) for day in days])
    variance = np.maximum([float(each[day]["standard"]) for day in days], 1e-12 * abs(values[-1]) + 1e-300) ** 2
    try:
        series = Series(years, values, variance, 1e6)
        one = (what,)
        sd = np.sqrt(variance)[:, None]
        charted = Charted(one, (series,), one, values[:, None], sd, 1.0, True, lambda w: (w[0] ** 2 * variance, 1e6))
        (drawn,) = chart(charted, np.array([[1.0]])).quantities
    except FitError:
        return ""
    with _lock:
        figure, (axis,) = grid(1, columns=1, height=3.0, width=6.4)
        reach = float(years[-1]) if drawn.trend is not None else None
        when = np.array([datetime(day.year, day.month, day.day, tzinfo=UTC).timestamp() / 86400.0 for day in days])
        last = each[days[-1]]
        draw_history(axis, drawn, Shown(what, 1.0, last["unit"] or "1"), when, days[0].isoformat(), reach)
        _tolerance(axis, last, float(values[0]))
        own = due is not None and due.drift.by == what and due.drift.on
        draw_dates(axis, {"date": due.drift.on, "at_least": due.drift.at_least} if due is not None and own else {})
        handles, labels = axis.get_legend_handles_labels()
        legend_below(figure, handles, labels, 4)
        figure.patch.set_alpha(0.0)
        axis.patch.set_alpha(0.0)
        file = io.StringIO()
        figure.savefig(file, format="svg", metadata={"Date": None, "Creator": None})
    return for_page(file.getvalue(), f"{what} over {len(days)} calibrations")


def _tolerance(axis: Any, value: Mapping[str, Any], start: float) -> None:
    for end in ("lower", "upper"):
        if value[end] is not None and np.isfinite(value[end]):
            label = "tolerance" if end == "lower" else None
            axis.axhline(value[end] - start, color="#cc5542", linewidth=0.9, linestyle="--", label=label)


def for_page(svg: str, label: str) -> str:
    """An SVG of matplotlib for a page that permits no styles in it, in the colours of its text.

    Args:
        svg: the whole file.
        label: what it shows, for those who do not see it.
    """
    inner = svg[svg.index("<svg") :]
    inner = re.sub(r"<metadata>.*?</metadata>|<style[^>]*>.*?</style>|<!--.*?-->", "", inner, flags=re.S)
    inner = _ATTRIBUTES.sub(lambda found: _as_attributes(found[1]), inner)
    for ink in _INKS:
        inner = inner.replace(f'"{ink}"', '"currentColor"')
    inner = inner.replace('"#cc0000"', '"#d9534f"')  # seen on a dark page, too
    inner = inner.replace(f'stroke="{_GRID}"', 'stroke="currentColor" stroke-opacity="0.15"')
    escaped = label.replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;")
    return re.sub(r"<svg ", f'<svg class="drift" role="img" aria-label="{escaped}" ', inner, count=1)


def _as_attributes(style: str) -> str:
    pairs = (one.partition(":")[::2] for one in style.split(";") if ":" in one)
    return "".join(f' {name.strip()}="{value.strip()}"' for name, value in pairs if "url(" not in value)


def of_item(laboratory: Laboratory, key: str) -> dict[str, Any] | None:
    """The page of an item of a laboratory; None if no certificate is of it, or the index cannot be kept."""
    try:
        with Lab.open(laboratory.folder, database=laboratory.database) as lab:
            return item_page(lab, key)
    except RigError:
        return None
