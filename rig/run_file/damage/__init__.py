"""Evidence that a run file has been changed or damaged: its pages and its chain, without SQLite."""
