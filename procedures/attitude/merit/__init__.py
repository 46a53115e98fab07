"""Figures of merit of a design, before the measurement: NASA/TP-1999-209835, sections 3.3, 3.4, 4 and 5.3.

Pure functions, as in the fitter; the designs come in as arrays of angles.

design = DesignPoints("D1 +-45", pitch_deg, roll_deg, replications=6) figure_of_merit(design, Usage.within(30.0))
compare([design, other], Usage.within(30.0), sigma_deg=2e-4)
"""

from rig.procedures.attitude.merit.comparison import Comparison, Curve, Recommendation, compare, curve, recommend
from rig.procedures.attitude.merit.design_points import DesignPoints, Usage
from rig.procedures.attitude.merit.merit import figure_of_merit, mean_variance, variance, worst_variance
from rig.procedures.attitude.merit.visibility import Visibility, pad_visibility, smallest_offset_drift, visibility

__all__ = [
    "Comparison",
    "Curve",
    "DesignPoints",
    "Recommendation",
    "Usage",
    "Visibility",
    "compare",
    "curve",
    "figure_of_merit",
    "mean_variance",
    "pad_visibility",
    "recommend",
    "smallest_offset_drift",
    "variance",
    "visibility",
    "worst_variance",
]
