"""Searched constants of effects in tables: their values and standard errors, beside a nonlinear fit of scipy's."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest
from command import rig
from scipy.optimize import curve_fit

from rig.procedures.general.trace.estimate import Constant
from rig.procedures.general.trace.result import FoundTableEffect

N, GAP_S, TAU_S = 120, 30.0, 150.0


def behind(x, tau):
    """First-order lag of `x`, which changes just after each reading, minus `x`; at rest at the start."""
    found, state = [], x[0]
    for now, before in zip(x, [x[0], *x[:-1]], strict=True):
        state = now + (state - now) * np.exp(-GAP_S / tau)
        del before
        found.append(state - now)
    return np.array(found)


def model(x, a, b, c, tau):
    return a + b * x + c * behind(x, tau)


@pytest.fixture(scope="module")
def traced(tmp_path_factory):
    """A sensor that follows steps of x with a lag of 150 s, and the same told by the trace."""
    rng = np.random.default_rng(4)
    x = np.repeat(rng.permutation(np.arange(24.0)), N // 24)
    y = model(x, 1.0, 2.0, 0.05, TAU_S) + 0.01 * rng.standard_normal(N)
    lines = [f"{n},{GAP_S * n:g},{a:.17g},{b:.17g}" for n, (a, b) in enumerate(zip(x, y, strict=True))]
    path = tmp_path_factory.mktemp("lag") / "t.csv"
    path.write_text("\n".join(["order,elapsed_s,x_mm,y_V", *lines]) + "\n")
    done = rig("trace", path, "--formula", "1 + x_mm", "--response", "y_V", "--json")
    assert done.returncode == 0, done.stderr
    effect = next(one for one in json.loads(done.stdout)["sensors"]["y_V"]["effects"] if one["constants"])
    return x, y, effect, rig("trace", path, "--formula", "1 + x_mm", "--response", "y_V").stdout


def test_a_time_constant_has_the_value_and_the_error_of_a_nonlinear_fit(traced):
    x, y, effect, _ = traced
    best, covariance = curve_fit(model, x, y, p0=[1.0, 2.0, 0.05, 100.0])
    (found,) = effect["constants"]
    assert (found["name"], found["unit"]) == ("time constant", "s")
    assert found["estimate"] == pytest.approx(best[3], rel=0.02)
    assert found["stderr"] == pytest.approx(covariance[3, 3] ** 0.5, rel=0.1)
    low, high = found["interval_95"]
    assert low < TAU_S < high


def test_it_is_printed_with_its_interval_and_sizes_have_the_unit_of_the_output(traced):
    _, _, effect, text = traced
    flat = " ".join(text.split())
    assert "time constant 1" in flat
    assert " V rms, " in effect["size"]
    assert effect["size"].endswith(" V from end to end")
    assert effect["size_95"].endswith(" V rms")


def test_an_interval_of_a_time_constant_is_never_below_zero():
    constant = Constant("time constant", 30.0, 25.0, 90.0)
    told = FoundTableEffect._constant(SimpleNamespace(time_unit="s"), constant)
    low, high = told["interval_95"]
    assert 0.0 < low < 30.0 < high
    assert low * high == pytest.approx(30.0**2)
