"""What the data say: models, least squares, analysis of variance, and the trace from a residual to its cause.

Pure functions: arrays in, frozen dataclasses out. No files, no clocks, no instruments.

    data = AttitudeData(replicate=..., order=..., ..., outputs={"x_V": ...})
    fit_attitude(data, "x_V").to_dict()
    fitter.trace.trace(data).to_json()
"""

from fitter.attitude import attitude_columns, variance_function
from fitter.calibration import AttitudeFit, fit_all, fit_attitude
from fitter.data import AttitudeData
from fitter.linear import LinearFit, RankError, Triangle, least_squares
from fitter.stream import StreamFit, fit_stream

__all__ = [
    "AttitudeData",
    "AttitudeFit",
    "LinearFit",
    "RankError",
    "StreamFit",
    "Triangle",
    "attitude_columns",
    "fit_all",
    "fit_attitude",
    "fit_stream",
    "least_squares",
    "variance_function",
]
