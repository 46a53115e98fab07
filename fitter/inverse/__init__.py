"""Pitch and roll from sensor outputs, with standard deviations and 95 % intervals.

Every package of sections 5 and 6 of NASA/TP-1999-209835: one axis with or without measured roll, two axes, three.

    calibration = calibrate_package(data)
    found = infer_attitude(calibration, outputs_V)
    found.pitch_deg, found.pitch_sd_deg, found.pitch_lo95_deg, found.pitch_hi95_deg, found.flag
"""

from fitter.inverse.answer import InferredAttitude
from fitter.inverse.calibrate import calibrate_package
from fitter.inverse.calibration import AttitudeCalibration
from fitter.inverse.curve import CurveCalibration, InferredCurve, infer_curve, too_few_digits
from fitter.inverse.factored import Factored
from fitter.inverse.infer import infer_attitude
from fitter.inverse.sensor_model import SensorModel, Term
from fitter.inverse.singular import singularity
from fitter.inverse.three_axis import ThreeAxis

__all__ = [
    "AttitudeCalibration",
    "CurveCalibration",
    "Factored",
    "InferredAttitude",
    "InferredCurve",
    "SensorModel",
    "Term",
    "ThreeAxis",
    "calibrate_package",
    "infer_attitude",
    "infer_curve",
    "singularity",
    "too_few_digits",
]
