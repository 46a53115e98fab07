"""Communication with instruments: roles, the clock, wires, and one module for each real instrument.

A driver is registered in `pyproject.toml`, under `rig.drivers`, and its twin (`sims/twins`) under `rig.twins`;
CONTRIBUTING.md goes through it.
Meters and sources that take lines of text need no driver of their own: the bench file describes them, for `scpi_meter`
and `scpi_source`.
"""
