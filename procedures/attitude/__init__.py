"""The kind "pitch-roll": inertial attitude sensors on a dividing head (NASA/TP-1999-209835)."""
