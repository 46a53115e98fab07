"""The remainder between points, and its place."""

from __future__ import annotations

import numpy as np

from rig.fitter import ties
from rig.fitter.arrays import FloatArray
from rig.fitter.linear import orthonormal
from rig.fitter.sums_of_squares import FTest, centred
from rig.fitter.trace.outcome import Finding, remains
from rig.procedures.attitude.effects.unnamed import HARMONICS, where
from rig.procedures.attitude.trace.problem import Problem


def shared_attitude(problem: Problem, corrected_V: FloatArray) -> FTest:
    """Test of agreement, within pure error, of commands with the same attitude but different head angles.

    Effects of gravity on the package are functions of attitude and cancel here; errors of the head do not.

    Args:
        problem: the run.
        corrected_V: (n,) one sensor's output minus known effects.
    """
    data = problem.scene.data
    left = problem.levels.leave(corrected_V[:, None], "replications")
    by_point, by_attitude = centred(left, data.point), centred(left, data.attitude)
    n_attitudes = int(data.attitude.max()) + 1
    above, below = problem.levels.n_points - n_attitudes, problem.levels.df("points")
    error = float(np.sum(problem.levels.leave(corrected_V[:, None], "points") ** 2))
    if above <= 0 or below <= 0 or error <= 0:
        return FTest(float("nan"), max(above, 0), max(below, 0))
    contrast = float(np.sum(by_attitude**2) - np.sum(by_point**2))
    return FTest(contrast / above / (error / below), above, below)


def strongest_wave(problem: Problem, corrected_V: FloatArray) -> Finding:
    """The product of harmonics in pitch and roll, up to `HARMONICS` per turn, with the largest part of the remainder.

    Args:
        problem: the run.
        corrected_V: (n,) one sensor's output minus known effects.
    """
    data, roll = problem.scene.data, problem.scene.roll
    left = problem.levels.leave(corrected_V[:, None], "replications")[:, 0]
    left = left - centred(left[:, None], data.point)[:, 0]
    best = remains("between points", 0.0)
    for k in range(HARMONICS + 1):
        for m in range((HARMONICS if roll else 0) + 1):
            waves = np.column_stack(
                [p * r for p in _waves(data.pitch_deg, k) for r in _waves(data.roll_deg if roll else None, m)]
            )
            own = problem.levels.leave(waves, "replications")
            basis = orthonormal(own, np.linalg.norm(waves, axis=0), 0.05)
            share = float(np.sum((basis.T @ left) ** 2) / max(np.sum(left**2), np.finfo(float).tiny))
            if ties.below(best.share, share):
                best = remains(f"between points, {where(k, m, roll=roll)}", min(share, 1.0))
    return best


def _waves(angle_deg: FloatArray | None, k: int) -> list[FloatArray | float]:
    if k == 0 or angle_deg is None:
        return [1.0] if angle_deg is None else [np.ones_like(angle_deg)]
    return [np.sin(k * np.radians(angle_deg)), np.cos(k * np.radians(angle_deg))]
