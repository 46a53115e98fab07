"""What happens during a run: run file, sequencer, settling, guard, recovery."""
