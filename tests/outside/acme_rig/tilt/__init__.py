"""Acme's kind of calibration: a level sensor on the pitch axis, a few angles up and down."""
