"""Communication with instruments: roles, the clock, wires, and one module for each real instrument."""
