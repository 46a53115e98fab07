"""A charted parameter as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fitter.history import QuantityChart


def quantity_json(q: QuantityChart, dates: Sequence[str]) -> dict[str, Any]:
    """Values, tests and limits of one parameter; None for statistics that need more calibrations."""
    series, spread = q.series, q.homogeneity
    result: dict[str, Any] = {
        "values": [float(v) for v in series.values],
        "stderr": [float(v) for v in np.sqrt(series.variance)],
        "df": series.df,
        "homogeneity": {
            "F": spread.F,
            "F_95": spread.limit_95,
            "df": list(spread.df),
            "p": spread.p,
            "p_adjusted": q.adjusted["homogeneity"],
            "between_sd": spread.between_sd,
        },
        "trend": None,
        "step": None,
        "limits": None,
    }
    if q.trend is not None:
        result["trend"] = {
            "per_year": q.trend.per_year,
            "stderr": q.trend.stderr,
            "half_width_95": q.trend.half_width_95,
            "df": q.trend.df,
            "p": q.trend.p,
            "p_adjusted": q.adjusted["trend"],
            "p_walk": q.trend.p_walk,
            "favoured": q.trend.favoured.value,
        }
    if q.step is not None:
        result["step"] = {
            "after": dates[q.step.before - 1],
            "before": dates[q.step.before],
            "size": q.step.size,
            "stderr": q.step.stderr,
            "p": q.step.p,
            "p_adjusted": q.adjusted["step"],
        }
    if q.limits is not None:
        result["limits"] = {
            "centre": q.limits.centre,
            "half_width_95": [float(v) for v in q.limits.warning],
            "half_width_99_7": [float(v) for v in q.limits.action],
        }
    return result
