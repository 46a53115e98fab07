"""Several calibrations of one sensor over time: its drift, and the validity of the last one.

series = Series(years, values, variance, df)     one parameter, its within-calibration variance
homogeneity(series), trend(series), step(series), limits(series)
error_bound(list_of_series, rows, years_ahead)   of the last calibration over its age
"""

from rig.fitter.history.between_calibrations import Between
from rig.fitter.history.chart import Chart, QuantityChart, chart
from rig.fitter.history.charted import Charted
from rig.fitter.history.control_limits import Limits, limits
from rig.fitter.history.forecast import ErrorBound, error_bound
from rig.fitter.history.homogeneity import Homogeneity, homogeneity
from rig.fitter.history.series import Series
from rig.fitter.history.step import Step, step
from rig.fitter.history.trend import Trend, trend

__all__ = [
    "Between",
    "Chart",
    "Charted",
    "ErrorBound",
    "Homogeneity",
    "Limits",
    "QuantityChart",
    "Series",
    "Step",
    "Trend",
    "chart",
    "error_bound",
    "homogeneity",
    "limits",
    "step",
    "trend",
]
