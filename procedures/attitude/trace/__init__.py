"""From the residual of an attitude sensor to the physical effect behind it. Method: docs/explanation/trace.md."""

from rig.procedures.attitude.trace.result import FoundEffect, SensorTrace, Trace
from rig.procedures.attitude.trace.run import trace

__all__ = ["FoundEffect", "SensorTrace", "Trace", "trace"]
