"""The kinds of calibration."""

from procedures.attitude.settings import PitchRollProcedure
from procedures.pressure.settings import WholePlotProcedure

Procedure = PitchRollProcedure | WholePlotProcedure
"""A checked `procedure.toml` of any kind."""
