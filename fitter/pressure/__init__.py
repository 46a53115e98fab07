"""Pressure transducers over temperature, after McCollum, Commo and Parker: calibrate, compare methods, use in flight.

fit = fit_pressure(data, "bridge_mV", "full")
fit.methods["in-flight zero"].reading_error.max_pct
infer_pressure(fit.calibration(), bridge_mV, T_sensor, T_SSE, Zero(v_0, T_sensor_0, T_SSE_0))
"""

from fitter.pressure.calibration import PressureCalibration, PressureFit, fit_pressure, fit_transducers
from fitter.pressure.errors import Errors
from fitter.pressure.in_flight import STOOD_DEGC, Inferred, infer_pressure
from fitter.pressure.methods import METHODS, MethodFit
from fitter.pressure.models import HIERARCHICAL, MODELS, named_formula, variance_inflation
from fitter.pressure.reading_error import PAPER_SENSITIVITY_MV_PER_PSI, ReadingError
from fitter.pressure.zero import Departure, Zero, departure

__all__ = [
    "HIERARCHICAL",
    "METHODS",
    "MODELS",
    "PAPER_SENSITIVITY_MV_PER_PSI",
    "STOOD_DEGC",
    "Departure",
    "Errors",
    "Inferred",
    "MethodFit",
    "PressureCalibration",
    "PressureFit",
    "ReadingError",
    "Zero",
    "departure",
    "fit_pressure",
    "fit_transducers",
    "infer_pressure",
    "named_formula",
    "variance_inflation",
]
