"""A run before and around its sequence: bench, procedure and world held together, forecast, start, resumption."""
