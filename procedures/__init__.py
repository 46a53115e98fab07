"""Calibration procedures: run lists and evaluation. A folder is a kind of calibration.

No module here communicates with an instrument. A procedure is expanded once, before any motion, into a `RunList`: all
points of the run, in order. The run list is hashed and stored; the run executes it.
"""
