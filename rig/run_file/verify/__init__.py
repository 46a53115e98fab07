"""Verification of a run file: against itself, against what was noted elsewhere, and what of it can be restored."""
