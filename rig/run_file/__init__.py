"""The run file: one SQLite database that holds a run, append-only, durable, self-checking; and what lies beside it."""
