"""Names of what instruments set by their roles, and units of outputs, as bench files and tables have them."""

HEAD_AXES = ("pitch", "roll")
"""Of a dividing head (`drivers.roles.Head`)."""
HEAD = tuple(f"{axis}_deg" for axis in HEAD_AXES)
PRESSURE = "pressure_psia"
"""Of a pressure controller (`drivers.roles.PressureController`)."""
ATMOSPHERE_PSIA = 14.7
PER_VOLT = {"V": 1.0, "mV": 1e3}
"""Units in which outputs are recorded; readers measure volts."""
