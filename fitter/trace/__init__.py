"""From a residual to the effect behind it: parts that all kinds share. Method: docs/explanation/trace.md."""
