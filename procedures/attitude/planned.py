"""A pitch-roll run as it is planned: its precision, and outputs of ideal sensors with the expected scatter."""

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
from rig.fitter.quantiles import t_limit
from rig.procedures.attitude.model import variance_function
from rig.procedures.attitude.settings import PitchRollProcedure
from rig.procedures.plan.precision import Precision, source_of
from rig.procedures.plan.run_list import RunList

AT_DEG = (0.0, 10.0, 30.0, 60.0, 90.0)
"""Pitch angles for the precision of an attitude sensor; those inside the design are shown."""


def precision(procedure: PitchRollProcedure, run_list: RunList) -> Precision:
    """Precision of a sensor's calibrated output at a few pitch angles (eqs. 52 and 72), roll 0."""
    setpoints = np.array([p.setpoints for p in run_list.points])
    roll = bool(np.ptp(setpoints[:, 1]))
    angles = [a for a in AT_DEG if a <= np.abs(setpoints[:, 0]).max()]
    design = attitude_columns(setpoints[:, 0], setpoints[:, 1], roll=roll)
    at = attitude_columns(np.array(angles), np.zeros(len(angles)), roll=roll)
    sigma = procedure.expect.sigma_deg
    sd = sigma * np.sqrt(variance_function(design, at))
    df = len(design) - design.shape[1]
    reach = t_limit(0.95, df) if df > 0 else float("nan")
    return Precision(
        ("pitch / deg", "sd of the calibrated output / deg", "95 % interval / deg"),
        [
            {"pitch_deg": a, "sd_deg": float(s), "interval95_deg": reach * float(s)}
            for a, s in zip(angles, sd, strict=True)
        ],
        [(f"{a:g}", f"{s:.2e}", f"+-{reach * s:.2e}") for a, s in zip(angles, sd, strict=True)],
        f"if one observation has a standard error of {sigma:.1e} deg: "
        f"{source_of(['sigma_deg'], procedure.expect.model_fields_set)}",
    )


_SEED = 20260115
_GRAVITY_SIGN = (1.0, -1.0, -1.0)


def expected_run(procedure: PitchRollProcedure, run_list: RunList, sensors: Mapping[str, str]) -> Expected:
    """The run as planned, for a forecast: sensors lie along the axes of the package and have no offset."""
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
