"""Expected precision of an attitude calibration."""

from __future__ import annotations

import numpy as np

from rig.fitter.quantiles import t_limit
from rig.procedures.attitude.model import attitude_columns, variance_function
from rig.procedures.attitude.settings import PitchRollProcedure
from rig.procedures.plan.precision import Precision
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
        f"if one observation has a standard error of {sigma:.1e} deg, expect.sigma_deg",
    )
