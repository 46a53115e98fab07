"""All events of a run: each is one class, with its stored fields and its sentence for people.

A new event is a class in one of these modules; no other place has to change.
"""

from rig.run_file.events import bench, by_hand, corrections, laboratory, loops, points, queues, sessions

__all__ = ["bench", "by_hand", "corrections", "laboratory", "loops", "points", "queues", "sessions"]
