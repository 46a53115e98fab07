"""Results of commands: printed lines, JSON, and the same in Python (`import rig`, docs/how_to/python.md)."""
