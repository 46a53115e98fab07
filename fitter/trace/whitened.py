"""Outputs and candidate columns at one level of a run, in units of each sensor's error."""

from __future__ import annotations

from dataclasses import dataclass

from rig.fitter.arrays import FloatArray
from rig.fitter.linear import orthonormal


@dataclass(frozen=True, eq=False)
class Whitened:
    """Residuals of outputs and columns after the model, over each sensor's own error.

    Attributes:
        outputs: (S, n).
        columns: (S, n, J).
    """

    outputs: FloatArray
    columns: FloatArray

    def beside(self, taken: FloatArray, length: FloatArray) -> Whitened:
        """Residuals of both after fitting other columns to all sensors together.

        Args:
            taken: (S, n, q) columns in the model.
            length: (q,) reference length of each, over all sensors.
        """
        count, n, j = self.columns.shape
        basis = orthonormal(taken.reshape(count * n, -1), length, 1e-6)
        if not basis.shape[1]:
            return self
        columns, outputs = self.columns.reshape(count * n, j), self.outputs.reshape(-1)
        columns, outputs = columns - basis @ (basis.T @ columns), outputs - basis @ (basis.T @ outputs)
        return Whitened(outputs.reshape(count, n), columns.reshape(count, n, j))
