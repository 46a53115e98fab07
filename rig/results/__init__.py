"""What commands give: the lines that they print, their JSON, and the same from Python (`import rig`, docs/python.md)."""
