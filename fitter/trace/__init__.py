"""From a residual to the physical effect behind it. How it works and how far to trust it: docs/trace.md."""

from fitter.trace.result import FoundEffect, SensorTrace, Trace, Unnamed
from fitter.trace.run import trace
from fitter.trace.whole_plots import FoundPressureEffect, TransducerTrace, WholePlotTrace, trace_whole_plots

__all__ = [
    "FoundEffect",
    "FoundPressureEffect",
    "SensorTrace",
    "Trace",
    "TransducerTrace",
    "Unnamed",
    "WholePlotTrace",
    "trace",
    "trace_whole_plots",
]
