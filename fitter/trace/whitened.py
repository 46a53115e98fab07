"""Outputs and candidate columns at one level of a run, in units of each sensor's error."""

from __future__ import annotations

from dataclasses import dataclass

from rig.fitter.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Whitened:
    """Residuals of outputs and columns after the model, over each sensor's own error.

    Attributes:
        outputs: (S, n).
        columns: (S, n, J).
    """

    outputs: FloatArray
    columns: FloatArray
