"""The run file: one SQLite database that holds a run, append-only, durable, self-checking; and the files beside it."""
