"""From a residual to the effect behind it: what the traces of all kinds share. How it works: docs/trace.md."""
