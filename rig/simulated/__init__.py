"""The one place where the controller meets the simulation: dry runs, `rig sim`, `rig demo`."""
