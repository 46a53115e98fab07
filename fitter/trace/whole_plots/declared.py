"""The columns of the declared model."""

from __future__ import annotations

from fitter.arrays import FloatArray
from fitter.formula import Formula
from fitter.whole_plot_data import WholePlotData

NAMED = {"full": "(P + T_sensor + T_SSE)^2 + P^2 + T_sensor^2 + T_SSE^2"}


def declared_model(data: WholePlotData, model: str) -> tuple[tuple[str, ...], FloatArray]:
    """Names and (n, k) columns of a named set of terms, or of a formula."""
    return Formula.parse(NAMED.get(model, model)).columns(data.table)
