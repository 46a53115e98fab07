"""Outputs and columns at a level, beside the effects found."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.linear import orthonormal
from rig.procedures.attitude.trace.levels import Level
from rig.procedures.attitude.trace.problem import Problem


class View:
    """Outputs and columns at a level, over the sensors' errors, beside some candidates."""

    def __init__(self, problem: Problem, level: Level, rest: Sequence[int], sigma: FloatArray) -> None:
        self.problem, self.level, self.sigma = problem, level, sigma
        picked = list(rest)
        taken = problem.columns_at(level, picked) / sigma[:, None, None]
        length = np.linalg.norm(problem.length[:, picked] / sigma[:, None], axis=0)
        self.basis = orthonormal(taken.reshape(taken.shape[0] * taken.shape[1], len(picked)), length, 1e-4)
        y = (problem.outputs_at(level) / sigma[:, None]).reshape(-1)
        self.outputs = (y - self.basis @ (self.basis.T @ y)).reshape(len(sigma), -1)

    def of(self, picked: Sequence[int]) -> FloatArray:
        """(S n, q) of candidates."""
        columns = self.problem.columns_at(self.level, list(picked)) / self.sigma[:, None, None]
        flat = columns.reshape(columns.shape[0] * columns.shape[1], len(picked))
        return np.asarray(flat - self.basis @ (self.basis.T @ flat))

    def each(self, picked: Sequence[int]) -> FloatArray:
        """(S, n, q) of candidates."""
        return self.of(picked).reshape(*self.outputs.shape, -1)

    def project(self, columns: FloatArray, sensor: int | None) -> FloatArray:
        """The rest of (n, m) columns of one sensor, or (S n, m) of all."""
        n = len(self.problem.scene.data)
        if sensor is not None:
            left = self.problem.left(sensor, columns, self.level) / self.sigma[sensor]
            basis = self.basis[sensor * n : (sensor + 1) * n]
            if basis.shape[1]:
                basis = orthonormal(basis, None, 1e-4)
                left = left - basis @ (basis.T @ left)
            return np.asarray(left)
        parts = [
            self.problem.left(i, columns[i * n : (i + 1) * n], self.level) / self.sigma[i]
            for i in range(len(self.sigma))
        ]
        left = np.concatenate(parts)
        return np.asarray(left - self.basis @ (self.basis.T @ left))

    def whitened(self, columns: FloatArray, *, sensor: int | None, rho: FloatArray) -> FloatArray:
        """The rest of (n, m) columns of one sensor, or (S n, m) of all, less the prediction by the row before."""
        return self.white(self.project(columns, sensor), sensor, rho)

    def white(self, columns: FloatArray, sensor: int | None, rho: FloatArray) -> FloatArray:
        """The same minus the prediction by the row before."""
        own = rho if sensor is None else rho[sensor : sensor + 1]
        if not np.any(own):
            return columns
        n = len(self.problem.scene.data)
        rows, replicate = self.problem.levels.executed, self.problem.levels.replicate
        first = np.concatenate([[True], np.diff(replicate[rows]) != 0])
        flat = columns.reshape(own.size, n, -1)
        out = np.empty_like(flat)
        for k, r in enumerate(own):
            ordered = flat[k][rows]
            before = np.concatenate([ordered[:1], ordered[:-1]])
            out[k][rows] = np.where(first[:, None], ordered * np.sqrt(1 - r**2), ordered - r * before)
        return out.reshape(columns.shape)
