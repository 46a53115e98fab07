"""Several calibrations of one sensor over time: its drift, and the validity of the last one.

series = Series(years, values, variance, df)     one parameter, its within-calibration variance
homogeneity(series), trend(series), step(series), limits(series)
error_bound(list_of_series, rows, years_ahead)   of the last calibration over its age
"""

from fitter.history.chart import Chart, QuantityChart, chart
from fitter.history.charted import Charted
from fitter.history.components import Between
from fitter.history.forecast import ErrorBound, error_bound
from fitter.history.homogeneity import Homogeneity, homogeneity
from fitter.history.limits import Limits, limits
from fitter.history.series import Series
from fitter.history.step import Step, step
from fitter.history.trend import Trend, trend

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
