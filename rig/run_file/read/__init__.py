"""Reading a run file: opening it, its records, and the files beside it."""
