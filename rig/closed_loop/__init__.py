"""From a table to what it says: fit, trace, error before and after, in JSON and in words."""

from rig.closed_loop.attitude import Traced, fit_table, sentence, trace_table

__all__ = ["Traced", "fit_table", "sentence", "trace_table"]
