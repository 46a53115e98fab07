"""The report of uncertainty budgets: results, and the shares of the influences on each as bars."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from rig.by_kind import known
from rig.fitter.budget import Budgeted
from rig.fitter.rounding import rounded_df, with_error
from rig.procedures.evaluate.results import Page
from rig.procedures.present.pictures import grid
from rig.procedures.present.terms import in_words
from rig.units.si import per_term
from rig.verbs.budget.coverage import headed
from rig.verbs.budget.evaluation import RunBudget

_SHOWN = 8
"""Maximum number of influences drawn by name; the others are one bar."""
_BESIDE = 16.0
"""Pixels beside the names of the bars."""


def shares(one: Budgeted) -> Figure:
    """Shares of the influences on one result, the largest on top."""
    lines = sorted(one.contributions, key=lambda c: -abs(c.share))
    named, rest = lines[:_SHOWN], lines[_SHOWN:]
    labels = [line.name for line in named]
    values = [100.0 * line.share for line in named]
    if rest:
        labels.append(f"{len(rest)} others")
        values.append(100.0 * sum(line.share for line in rest))
    figure, (axis, *_) = grid(1, columns=1, height=0.6 + 0.3 * len(labels))
    axis.barh(range(len(labels)), values, color="#4477aa")
    axis.set_yticks(range(len(labels)), labels)
    axis.invert_yaxis()
    axis.set_xlabel("share of the variance / %")
    axis.set_xlim(min(0.0, *values), max(1.0, *values) * 1.05)
    widest = max(label.get_window_extent().width for label in axis.get_yticklabels())
    figure.subplots_adjust(left=min(0.6, (widest + _BESIDE) / figure.bbox.width))
    return figure


def budget_page(found: RunBudget, notes: Sequence[str]) -> Page:
    """The report; its provenance is that of the run."""
    table = found.of.table
    elapsed = table.columns.get("elapsed_s", np.zeros(1))
    contents = {
        "probability": f"{100 * found.budgets[0].coverage_probability:g}",
        "headed": headed(found.budgets),
        "register": found.of.register.name,
        "notes": list(notes),
        "results": [_result(one) for one in found.budgets],
    }
    unused = known(table).unused(table).to_json()
    return Page("rig.verbs", "budget.html.j2", table, float(np.ptp(elapsed)), unused, contents)


def _result(one: Budgeted) -> dict[str, Any]:
    value, expanded = with_error(one.value, one.expanded_uncertainty)
    _, standard = with_error(one.value, one.standard_uncertainty)
    lines = [
        {
            **vars(line),
            "share": f"{100 * line.share:.1f}",
            "u": f"{line.standard_uncertainty:.2g}",
            "df": rounded_df(line.df),
        }
        for line in sorted(one.contributions, key=lambda c: -abs(c.share))
    ]
    return {
        "name": in_words(one.name),
        "unit": per_term(one.unit),
        "value": value,
        "expanded": expanded,
        "k": f"{one.coverage_factor:.2f}",
        "u": standard,
        "df": rounded_df(one.df),
        "lines": lines,
        "figure": shares(one),
    }
