"""What happens during a run: sequencer, settling, guard, policies, recovery. Records are written by `rig.run_file`."""
