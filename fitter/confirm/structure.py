"""Structure in the residuals of a later run: what a model leaves that no error makes.

An explanation may be the best of its class without being true. If its residuals in the later run still follow a smooth
curve of something that was recorded, it is not confirmed, however small they are: the error of the later run is taken
from these residuals themselves, not from the first run.
"""

from __future__ import annotations

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.confirm.together import Together, left
from rig.fitter.linear import orthonormal
from rig.fitter.quantiles import f_tail

ORDERS = 3, 6, 12
"""Numbers of columns of a place that are tried together, the smoothest first."""
LEAST_DF = 8
"""Degrees of freedom beside a shape: with fewer the error is not known well enough."""
INDEPENDENT = 0.03
"""Share of a column that remains beside the model and the columns before it, below which it is a part of them.

A standard's reading scatters about each level of a setting. Waves over the levels and the model's columns of the
readings then differ by that scatter alone, and along it lies the error of the standard in every output, times the
output's slope: it is no shape.
"""


def structured(both: Together, model: FloatArray, *, lasting: bool) -> tuple[float, str]:
    """Probability by chance of the clearest shape in a model's residuals in the later run, over all tried; its place.

    Args:
        both: both runs.
        model: (S n, q) its columns, as `Together.columns_of`.
        lasting: whether causes of time and temperature are of no interest: their shapes are left out.
    """
    fresh = np.tile(both.fresh, len(both.sensors))
    whole_rest = left(model, both.outputs)
    rest = whole_rest[fresh]
    basis = orthonormal(model)
    df = rest.size - float(np.sum(basis[fresh] ** 2)) - both.leverage(both.fresh)
    (found, place), tried = (1.0, ""), 0
    for name, raw in both.shapes(lasting=lasting):
        whole = np.sqrt(np.sum(np.stack([both.weigh(i, own) for i, own in enumerate(raw)]) ** 2, axis=(0, 1)))
        columns = both.stacked(raw)
        columns -= basis @ (basis.T @ columns)
        for order in dict.fromkeys(min(order, columns.shape[1]) for order in ORDERS):
            shape = orthonormal(columns[:, :order], whole[:order], INDEPENDENT)
            rank = shape.shape[1]
            if not rank or df - rank < LEAST_DF:
                continue
            along = shape.T @ whole_rest
            scatter = float(np.sum((rest - shape[fresh] @ along) ** 2)) / (df - rank)
            tried += 1
            f = float(along @ along) / rank / max(scatter, np.finfo(float).tiny)
            found, place = min((found, place), (f_tail(f, rank, df - rank), name))
    return min(found * max(tried, 1), 1.0), place
