"""What happens during a run: sequencer, settling, guard, policies, recovery. What is written is in `rig.run_file`."""
