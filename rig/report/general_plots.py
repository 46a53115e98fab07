"""Residual plots of a table, before beside after; the residual's running mean shows what a cloud hides."""

from __future__ import annotations

from typing import Any

import numpy as np

from rig.report.pictures import png, side_by_side

Array = np.ndarray[Any, np.dtype[np.float64]]

_PARTS = 12


def residuals_over(name: str, values: Array, left: tuple[Array, Array], response: str) -> str:
    """Residuals (n,) before and after over a variable (n,), each on its own scale; base64 PNG."""
    figure, axes = side_by_side(3.2, share_y=False)
    for axis, residual, title in zip(
        axes, left, ("before: declared model", "after: with the effects found"), strict=True
    ):
        axis.plot(values, residual, "o", ms=3, alpha=0.5)
        axis.plot(*_means(values, residual), "-", color="C1", lw=1.5, label="running mean")
        axis.axhline(0, color="0.5", linewidth=0.7)
        axis.set_title(title, fontsize=9)
        axis.set_xlabel(name, fontsize=9)
        axis.grid(color="0.9", linewidth=0.6)
        axis.tick_params(labelsize=8)
    axes[0].set_ylabel(f"residual of {response}", fontsize=9)
    axes[0].legend(fontsize=7, frameon=False)
    return png(figure)


def _means(values: Array, residual: Array) -> tuple[Array, Array]:
    """Mean residual in parts of the range that hold as many rows each, or at each value where these are few."""
    distinct, index = np.unique(values, return_inverse=True)
    if len(distinct) > _PARTS:
        order = np.argsort(values, kind="stable")
        index = np.empty(len(values), np.int64)
        index[order] = np.arange(len(values)) * _PARTS // len(values)
    count = np.maximum(np.bincount(index), 1)
    return np.bincount(index, values) / count, np.bincount(index, residual) / count
