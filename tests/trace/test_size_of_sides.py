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
