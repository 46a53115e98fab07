"""The state of a run, folded from its records, and the rules that recorded readings must keep."""
