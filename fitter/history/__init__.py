"""Several calibrations of one sensor over time: is it drifting, and until when does the last one hold?

series = Series(years, values, variance, df)     one parameter, its within-calibration variance
homogeneity(series), trend(series), step(series), limits(series)
error_bound(list_of_series, rows, years_ahead)   of the last calibration as it ages
"""

from fitter.history.attitude import AttitudeCharted, Calibrated, attitude_charted, calibrated
from fitter.history.chart import Chart, QuantityChart, chart
from fitter.history.charted import Charted
from fitter.history.components import Between
from fitter.history.curve import CurveCharted, curve_charted
from fitter.history.forecast import ErrorBound, error_bound
from fitter.history.homogeneity import Homogeneity, homogeneity
from fitter.history.limits import Limits, limits
from fitter.history.pressure import PressureCharted, pressure_charted
from fitter.history.series import Series
from fitter.history.step import Step, step
from fitter.history.trend import Trend, trend

__all__ = [
    "AttitudeCharted",
    "Between",
    "Calibrated",
    "Chart",
    "Charted",
    "CurveCharted",
    "ErrorBound",
    "Homogeneity",
    "Limits",
    "PressureCharted",
    "QuantityChart",
    "Series",
    "Step",
    "Trend",
    "attitude_charted",
    "calibrated",
    "chart",
    "curve_charted",
    "error_bound",
    "homogeneity",
    "limits",
    "pressure_charted",
    "step",
    "trend",
]
