"""`rig plan`: what a run will do, take and promise, before it is started."""
