"""Everything that can happen in a run: one class an event, with what is stored of it and the words it is told in.

An event is added as a class of one of these modules, and nowhere else.
"""

from rig.run_file.events import bench, points, sessions

__all__ = ["bench", "points", "sessions"]
