"""The engine of traces: blocks of columns judged beside a model under components of the error."""
