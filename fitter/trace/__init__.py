"""From a residual to the physical effect behind it. How it works and how far to trust it: docs/trace.md."""

from fitter.trace.result import FoundEffect, SensorTrace, Trace, Unnamed
from fitter.trace.run import trace

__all__ = ["FoundEffect", "SensorTrace", "Trace", "Unnamed", "trace"]
