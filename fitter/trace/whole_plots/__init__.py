"""From a residual to the effect behind it, for runs in whole plots: docs/trace.md."""

from fitter.trace.whole_plots.result import FoundPressureEffect, TransducerTrace, WholePlotTrace
from fitter.trace.whole_plots.run import trace_whole_plots

__all__ = ["FoundPressureEffect", "TransducerTrace", "WholePlotTrace", "trace_whole_plots"]
