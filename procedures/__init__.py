"""Calibration procedures: what is run, and how it is evaluated. A folder is a kind of calibration.

Nothing here talks to an instrument. A procedure is expanded once, before anything moves, into a `RunList`: every
point of the run, in order. The run list is hashed and stored; the run is the run list carried out.
"""
