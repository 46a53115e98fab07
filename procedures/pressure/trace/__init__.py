"""From the residual of a pressure transducer to the physical effect behind it. Method: docs/explanation/trace.md."""

from rig.procedures.pressure.trace.result import FoundPressureEffect, TransducerTrace, WholePlotTrace
from rig.procedures.pressure.trace.run import trace_whole_plots

__all__ = ["FoundPressureEffect", "TransducerTrace", "WholePlotTrace", "trace_whole_plots"]
