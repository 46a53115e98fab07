"""The size of an effect of the side of approach is what a reader can compare with its coefficient."""

from __future__ import annotations

import re

import numpy as np

from rig.procedures.general.column_roles import Roles
from rig.procedures.general.evaluate import trace_general_table
from rig.procedures.tables.table import Table


def test_a_difference_of_08_between_both_sides_is_04_to_either_side():
    """It was "1.18 Hz from end to end": of what the declared model leaves of it."""
    rng = np.random.default_rng(2)
    up = np.array([1, 2.5, 4, 5.5, 7, 8.5, 10])
    x, side = np.tile([*up, *up[-2::-1]], 9), np.tile([1.0] * 7 + [-1.0] * 6, 9)
    y = 50.0 + 180.0 * x - 3.0 * x**2 + 0.4 * side + rng.normal(0, 0.05, len(x))
    columns = {"elapsed_s": np.arange(len(x)) * 40.0, "x_V": x, "x_side": side, "s_Hz": y}
    table = Table("t.csv", columns, simulated=True, provenance={})
    roles = Roles("s_Hz", "1 + x_V + x_V^2", time="elapsed_s", direction="x_side")
    (effect,) = trace_general_table(lambda _: table, roles, validate=False).trace.added
    assert effect.family == "direction"
    (size,) = map(float, re.findall(r"up to ([0-9.]+) Hz to either side", effect.size))
    assert abs(size - 0.4) < 0.02
    assert size == float(f"{abs(effect.coefficients[0]):.3g}")


def test_a_lag_whose_first_value_before_nobody_read_is_found_as_it_is():
    """Taken as at rest, that row gave a lag of 87 s for one of 60 s, and a direction that is not there."""
    rng = np.random.default_rng(3)
    up = [0.49, 1.17, 1.81, 2.39, 2.91, 3.38, 3.8]
    x = np.tile([*up, *up[-2::-1]], 6)
    before, state, y = np.r_[0.0, x[:-1]], 0.0, []
    for start, now in zip(before, x, strict=True):  # held for 4 s, then a step, read 36 s after it
        state = now + (start + (state - start) * np.exp(-4.0 / 60.0) - now) * np.exp(-36.0 / 60.0)
        y.append(50.0 + 180.0 * now - 3.0 * (now - state) + rng.normal(0, 0.05))
    columns = {
        "elapsed_s": np.arange(len(x)) * 40.0,
        "x_kg": x,
        "x_since_s": np.full(len(x), 36.0),
        "x_from_kg": np.r_[np.nan, x[:-1]],
        "x_side": np.sign(x - before),
        "block": np.ones(len(x)),
        "s_Hz": np.array(y),
    }
    table = Table("t.csv", columns, simulated=True, provenance={})
    roles = Roles("s_Hz", "1 + x_kg", time="elapsed_s", direction="x_side", ignore=("block",))
    found = trace_general_table(lambda _: table, roles, validate=False).trace
    (effect,) = found.added
    assert effect.effect in ("setting-lag:x_kg", "creep:x_kg"), "with one wait for all steps they are one curve"
    (constant,) = effect.constants
    assert abs(constant.value - 60.0) < 6.0
    assert abs(abs(effect.coefficients[0]) - 3.0) < 0.2
