"""Entries of catalogues of effects, for all kinds of calibration. The catalogues are in the kinds."""
