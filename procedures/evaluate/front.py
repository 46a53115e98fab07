"""The first screen of a report of a trace: one picture and one table for all sensors."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rig.procedures.evaluate.before_after import Compared, compared

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from rig.fitter.trace.outcome import Outcome

_BAR = 0.3
_LONGEST = 1.3
"""End of the scale: an error that grows more is cut there, and the table has the number."""


def firsts(outcomes: Sequence[Outcome]) -> tuple[list[str], list[list[Compared | None]]]:
    """The first error of every sensor, and that of rows left out: labels, and each sensor's rows, None for none."""
    every = [[row for row in compared(one) if not row.in_reports] for one in outcomes]
    wanted = [row.label for rows in every for row in rows if row is rows[0] or row.label.startswith("left-out error")]
    labels = list(dict.fromkeys(wanted))
    return labels, [[next((row for row in rows if row.label == one), None) for one in labels] for rows in every]


def front(outcomes: Sequence[Outcome], sensors: Mapping[str, Any]) -> dict[str, Any]:
    """Values of `front.html.j2`.

    Args:
        outcomes: one per sensor.
        sensors: JSON of each.
    """
    labels, rows = firsts(outcomes)
    return {
        "labels": labels,
        "rows": [
            {
                "sensor": one.sensor,
                "verdict": one.verdict,
                "cells": [None if row is None else (row.before, row.after if one.findings else "") for row in cells],
                "named": list(_named(sensors[one.sensor])),
                "open": list(_open(sensors[one.sensor])),
            }
            for one, cells in zip(outcomes, rows, strict=True)
        ],
        "figure": _picture(outcomes, rows),
    }


def _named(sensor: Mapping[str, Any]) -> Iterator[str]:
    for effect in sensor["effects"]:
        if not effect["doubtful"]:
            yield " or ".join([effect["effect"], *effect["aliases"]])


def _open(sensor: Mapping[str, Any]) -> Iterator[str]:
    for effect in sensor["effects"]:
        if effect["doubtful"]:
            yield f"{' or '.join([effect['effect'], *effect['aliases']])}, doubtful"
    yield from (f"without a name: {rest['where']}" for rest in sensor["unnamed"])


def _picture(outcomes: Sequence[Outcome], rows: Sequence[Sequence[Compared | None]]) -> Figure | None:
    """Bars: the first error of each sensor in which something was found, as a share of that before; None without one.

    A sensor with nothing found has a grey bar alone: as it was, and not worse than the others.
    """
    first = [next((row for row in each if row is not None), None) for each in rows]
    shares = [row.share if row is not None and one.findings else None for one, row in zip(outcomes, first, strict=True)]
    if all(share is None for share in shares):
        return None
    from rig.procedures.present.pictures import legend_below, plots  # noqa: PLC0415 - matplotlib takes a second to import

    figure, axes = plots(1, 1, height=0.9 + _BAR * len(shares))
    axis, places = axes[0, 0], range(len(shares))
    figure.subplots_adjust(left=0.18)
    axis.barh(places, [1.0] * len(shares), color="0.85", height=0.7, label="before")
    ends = [min(share or 0.0, _LONGEST) for share in shares]
    axis.barh(places, ends, color="C0", height=0.7, label="after, where something was found")
    axis.set_yticks(list(places), [one.sensor for one in outcomes], fontsize=8)
    axis.set_xlim(0.0, _LONGEST)
    axis.set_xlabel("standard error: after, where before is 1", fontsize=9)
    axis.tick_params(labelsize=8)
    axis.invert_yaxis()
    handles, names = axis.get_legend_handles_labels()
    legend_below(figure, handles, names, 2)
    return figure
