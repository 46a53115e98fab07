"""The only link between controller and simulation: dry runs, `rig sim`, `rig demo`."""
