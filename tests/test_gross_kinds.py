"""Gross errors of every size, in each kind of data: bad rows are named, and no good ones in their place."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from procedures.attitude.gross import of_attitude
from procedures.general.gross import of_table
from proving.truth import attitude as attitude_truth

SIGMA_DEG = 1e-3
REPLICATIONS = {
    "six replications": (attitude_truth.D1(180, 5, 5), {}),
    "three replications": (attitude_truth.D1(180, 5, 9, replications=3), {}),
    "six replications, undeclared pads": (
        attitude_truth.D1(180, 5, 5),
        {"compliance": {("y", "x"): 4e-2}, "offset_sd": 2.0},
    ),
}


@pytest.mark.parametrize("kind", REPLICATIONS)
@pytest.mark.parametrize("size", [100.0, 1e4, 1e6, 1e9])
def test_in_few_replications_where_most_readings_of_a_point_may_be_bad(kind, size):
    """Two bad readings of three outvoted the good one, and a start without a fit named nothing at all."""
    plan, bench = REPLICATIONS[kind]
    sd = float(np.radians(SIGMA_DEG)) * attitude_truth.Bench().sensors[0].S
    for seed, share in ((0, 0.1), (1, 0.1), (2, 0.2), (3, 0.2)):
        rng = np.random.default_rng([seed, round(np.log10(size) * 10)])
        data = attitude_truth.simulate(attitude_truth.Bench(sigma_deg=SIGMA_DEG, **bench), plan, seed)[0]
        name, y = next((name, output.copy()) for name, output in data.outputs.items())
        bad = rng.choice(len(y), round(share * len(y)), replace=False)
        y[bad] += size * sd * rng.choice([-1, 1], bad.size) * rng.uniform(1.0, 1.5, bad.size)
        found = of_attitude(replace(data, outputs={name: y}))[name]
        assert sorted(found.rows.tolist()) == sorted(bad.tolist()), f"seed {seed}"


def test_rounded_readings_that_mostly_agree_are_no_scale_for_the_others():
    """Of 60 readings 35 were the same, and those without them so many standard deviations off that the others' sum of
    squares was forgotten."""
    for seed in range(10):
        rng = np.random.default_rng([7, seed])
        y = np.round(rng.uniform() + 0.5 * rng.standard_normal(60))
        assert not of_table(y, np.ones((60, 1))).rows.size
