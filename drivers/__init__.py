"""Communication with instruments: roles, the clock, wires, and one module for each real instrument.

A driver is registered in `pyproject.toml`, under `rig.drivers`, and its twin under `rig.twins`.
"""
