"""Errors of a fit that include those of effects."""

from __future__ import annotations

import numpy as np
import pytest

from rig.fitter.linear import LinearFit
from rig.procedures.attitude.trace.estimate import _joint


@pytest.mark.parametrize("below_zero", [0.0, 1e-7, 3.0])
def test_a_variance_of_effects_below_zero_by_rounding_is_none(below_zero: float):
    """A stranger's cause (warm_from_below) had so many effects that look alike that a loop ended with a traceback."""
    h = np.column_stack([np.ones(6), np.arange(6.0)])
    root = np.linalg.cholesky(np.linalg.inv(h.T @ h))
    fit = LinearFit(("1", "x"), np.zeros(2), root, rss=4.0, n=6, condition=1.0)
    effects = np.column_stack([np.arange(6.0) ** 2, np.arange(6.0)])
    errors = _joint(fit, h, effects, np.diag([2.0, -below_zero])).root
    none = _joint(fit, h, effects, np.diag([2.0, 0.0])).root
    assert np.all(np.isfinite(errors))
    np.testing.assert_allclose(errors @ errors.T, none @ none.T, rtol=1e-5)
