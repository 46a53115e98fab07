"""A pitch-roll run as it is planned: outputs of ideal sensors with the expected scatter."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from rig.procedures.attitude.model import AXES, attitude_columns
from rig.procedures.evaluate.budgeting import Expected
from rig.procedures.tables.table import Table

if TYPE_CHECKING:
    from rig.fitter.arrays import FloatArray
    from rig.procedures.attitude.settings import PitchRollProcedure
    from rig.procedures.plan.run_list import RunList

_SEED = 20260115
_GRAVITY_SIGN = (1.0, -1.0, -1.0)


def expected_run(procedure: PitchRollProcedure, run_list: RunList, sensors: Mapping[str, str]) -> Expected:
    """See `Kind.expected`; sensors along the axes of the package, without offset."""
    expect = procedure.expect
    S = expect.sensitivity_V_per_g or 1.0
    pitch, roll = (np.array(run_list.column(name), np.float64) for name in ("pitch_deg", "roll_deg"))
    h = attitude_columns(pitch, roll)
    own = {"y": expect.sigma_y_deg, "z": expect.sigma_z_deg}
    rng, outputs = np.random.default_rng(_SEED), {}
    for column, axis in sensors.items():
        i = AXES[axis]
        sigma = np.radians(own.get(axis) or expect.sigma_deg) * S
        outputs[column] = S * _GRAVITY_SIGN[i] * h[:, 1 + i] + sigma * _scatter(h, rng)
    n = len(h)
    columns = {
        "replicate": np.array([point.replication for point in run_list.points], np.float64),
        "order": np.arange(1.0, n + 1.0),
        "elapsed_s": np.arange(float(n)),
        "pitch_deg": pitch,
        "roll_deg": roll,
        "sensor_temperature_degC": np.zeros(n),
        **outputs,
    }
    told = f"sensors of {S:g} V/g, expect.sensitivity_V_per_g" if expect.sensitivity_V_per_g else "ideal sensors"
    words = f"{told}, and observations with a standard error of {expect.sigma_deg:.1e} deg, expect.sigma_deg"
    axes = dict(sensors)
    table = Table("the plan", columns, True, {}, axes=axes, kind="pitch-roll", outputs={c: c for c in sensors})
    return Expected(table, expect.sensitivity_V_per_g is not None, words)


def _scatter(h: FloatArray, rng: np.random.Generator) -> FloatArray:
    """(n,) residuals of a fit to `h` whose standard error is exactly 1."""
    used = h[:, np.any(h != 0.0, axis=0)]
    basis = np.linalg.svd(used, full_matrices=False)[0][:, : np.linalg.matrix_rank(used)]
    noise = rng.normal(size=len(h))
    left = noise - basis @ (basis.T @ noise)
    df = max(len(h) - basis.shape[1], 1)
    return np.asarray(left * np.sqrt(df) / np.linalg.norm(left))
