"""Pressure transducers over temperature, after McCollum, Commo and Parker: calibrate, compare methods.

fit = fit_pressure(data, "bridge_mV", "full")
fit.methods["in-flight zero"].reading_error.max_pct
"""

from rig.procedures.pressure.fit.calibration import PressureCalibration, PressureFit, fit_pressure, fit_transducers
from rig.procedures.pressure.fit.errors import Errors
from rig.procedures.pressure.fit.methods import METHODS, MethodFit
from rig.procedures.pressure.fit.models import HIERARCHICAL, MODELS, named_formula, variance_inflation
from rig.procedures.pressure.fit.reading_error import PAPER_SENSITIVITY_MV_PER_PSI, ReadingError

__all__ = [
    "HIERARCHICAL",
    "METHODS",
    "MODELS",
    "PAPER_SENSITIVITY_MV_PER_PSI",
    "Errors",
    "MethodFit",
    "PressureCalibration",
    "PressureFit",
    "ReadingError",
    "fit_pressure",
    "fit_transducers",
    "named_formula",
    "variance_inflation",
]
