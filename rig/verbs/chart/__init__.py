"""`rig chart`: several calibrations of one sensor over time."""
