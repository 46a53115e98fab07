"""A standard's reading has noise, which all outputs of a row share: it is no shape that an explanation leaves.

A flow bench: nine settings of a valve, a standard that reads 0 to 5 kg/min, a sensor of 2100 Hz per kg/min with a noise
of 0.22 Hz (the mean of five readings).
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from rig.fitter.confirm.judgement import CHANGED
from rig.fitter.confirm.structure import structured
from rig.fitter.trace.flexible import waves
from rig.procedures.general.effects.scene import at_levels

FLOWS = np.array([0.62, 1.18, 1.73, 2.28, 2.82, 3.35, 3.88, 4.39, 4.9])
RUNS = 40


def later_run(noise, hidden, seed):
    """A further run, seen beside a model with a cubic."""
    rng = np.random.default_rng(seed)
    true = np.tile(FLOWS, 11)
    read = true + noise * rng.standard_normal(true.size)
    output = 2000.0 + 2100.0 * true - 20.0 * true**2 + hidden(true) + 0.22 * rng.standard_normal(true.size)
    outputs = output / np.hypot(0.22, 2100.0 * noise)
    model = np.vander(read, 4)
    both = SimpleNamespace(
        fresh=np.ones(read.size, np.bool_),
        sensors=("mfs_Hz",),
        outputs=outputs,
        leverage=lambda rows: 0.0,
        shapes=lambda lasting: iter([("over flow_kg_per_min", waves(at_levels(read), 12)[None])]),
        stacked=lambda raw: raw[0].copy(),
        weigh=lambda i, columns: columns,
    )
    return structured(both, model, lasting=True)


@pytest.mark.parametrize("noise", [0.0, 1e-4, 2e-4, 5e-4, 2e-3])
def test_the_true_cause_fits_whatever_the_noise_of_the_standard(noise):
    rejected = sum(later_run(noise, lambda q: 0.6 * q**3, seed)[0] < CHANGED for seed in range(RUNS))
    assert rejected <= 1


@pytest.mark.parametrize("noise", [0.0, 1e-4, 2e-4])
def test_another_cause_leaves_a_shape_and_it_is_said_where(noise):
    for seed in range(RUNS):
        p, place = later_run(noise, lambda q: 0.2 * q**4, seed)
        assert p < CHANGED
        assert place == "over flow_kg_per_min"
