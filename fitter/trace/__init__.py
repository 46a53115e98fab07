"""From a residual to the effect behind it: common parts of the traces of all kinds. Method: docs/method/trace.md."""
