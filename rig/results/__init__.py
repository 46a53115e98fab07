"""What commands give: the lines they print, their JSON, and the same from Python (`import rig`, docs/python.md)."""
