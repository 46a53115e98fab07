"""The abscissa of a fitted curve from a new reading of its response."""

from rig.procedures.general.infer.calibration import CurveCalibration
from rig.procedures.general.infer.curve import InferredCurve, infer_curve
from rig.procedures.general.infer.factored import Factored
from rig.procedures.general.infer.frames import too_few_digits

__all__ = ["CurveCalibration", "Factored", "InferredCurve", "infer_curve", "too_few_digits"]
