"""Every command, registered by being imported."""

from rig.cli import data, demo, plan, run, sim  # noqa: F401
