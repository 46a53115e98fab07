"""Results of commands: printed lines, JSON, and the same in Python (`import rig`, docs/python.md)."""
