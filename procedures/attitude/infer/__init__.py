"""Pitch and roll from sensor outputs, with standard deviations and 95 % intervals.

Every package of sections 5 and 6 of NASA/TP-1999-209835: one axis with or without measured roll, two axes, three.

    calibration = calibrate_package(data)
    found = infer_attitude(calibration, outputs_V)
    found.pitch_deg, found.pitch_sd_deg, found.pitch_lo95_deg, found.pitch_hi95_deg, found.flag
"""

from rig.procedures.attitude.infer.answer import InferredAttitude
from rig.procedures.attitude.infer.calibrate import calibrate_package
from rig.procedures.attitude.infer.calibration import AttitudeCalibration
from rig.procedures.attitude.infer.infer import infer_attitude
from rig.procedures.attitude.infer.sensor_model import SensorModel, Term
from rig.procedures.attitude.infer.singular import singularity
from rig.procedures.attitude.infer.three_axis import ThreeAxis

__all__ = [
    "AttitudeCalibration",
    "InferredAttitude",
    "SensorModel",
    "Term",
    "ThreeAxis",
    "calibrate_package",
    "infer_attitude",
    "singularity",
]
