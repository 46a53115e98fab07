"""Writing a run file, by one connection; its creation, its rescue, and a watch for changes by others."""
