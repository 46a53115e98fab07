"""A run file or a table, to fit and to trace: `rig fit`, `rig trace`, `rig.open`."""
