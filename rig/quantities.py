"""Names of quantities set by instruments, by role, and units of outputs, for bench files and tables."""

HEAD_AXES = ("pitch", "roll")
"""Quantities of a dividing head (`drivers.roles.Head`)."""
HEAD = tuple(f"{axis}_deg" for axis in HEAD_AXES)
PRESSURE = "pressure_psia"
"""Quantity of a pressure controller (`drivers.roles.PressureController`)."""
ATMOSPHERE_PSIA = 14.7
PER_VOLT = {"V": 1.0, "mV": 1e3}
"""Units of recorded outputs; readers measure volts."""
