"""`rig run`: a procedure carried out on a bench; `rig status`: the state of a run."""
