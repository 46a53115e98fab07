"""No decision hangs on the last bit: other processors round otherwise. See also `make test-kernels`."""

from __future__ import annotations

import numpy as np
import pytest

from rig.fitter.confirm.judgement import _gained


@pytest.mark.parametrize("seed", range(20))
def test_the_fall_of_a_sum_of_squares_is_never_negative(seed):
    """Found on an Intel processor: the difference of two residual sums of squares was -3e-14, and its p no number."""
    rng = np.random.default_rng(seed)
    model = rng.normal(size=(60, 3)) * 10.0 ** rng.uniform(-6, 6, 3)
    outputs = model @ (rng.normal(size=3) / np.linalg.norm(model, axis=0)) * 1e4
    inside = model @ rng.normal(size=(3, 2))
    outside = np.linalg.qr(np.column_stack([model / np.linalg.norm(model, axis=0), rng.normal(size=60)]))[0][:, -1:]
    assert _gained(outputs, model, inside) == (0.0, 0), f"seed {seed}"
    gain, more = _gained(outputs, model, np.column_stack([inside, 1e-5 * outside]))
    assert more == 1, f"seed {seed}"
    assert 0.0 <= gain < 1e-12, f"seed {seed}"


def test_the_fall_of_a_sum_of_squares_is_that_of_two_fits():
    rng = np.random.default_rng(3)
    model, further, outputs = rng.normal(size=(30, 3)), rng.normal(size=(30, 2)), rng.normal(size=30)
    rss = [
        float(np.linalg.lstsq(columns, outputs, rcond=None)[1][0])
        for columns in (model, np.column_stack([model, further]))
    ]
    gain, more = _gained(outputs, model, further)
    assert more == 2
    assert gain == pytest.approx(rss[0] - rss[1], rel=1e-12)
