"""Whether the records of a whole run file make sense together: what a controller that wrote them cannot have written.

The chain of hashes tells a change by somebody who does not make it again, and anybody can. What is held against one
another here takes more to keep consistent: readings and their means, readbacks and setpoints, times, counts, marks and
the events that explain them. A change that is consistent in itself (every reading and mean multiplied by 1.001) shows
nowhere but against a head hash that was noted elsewhere.
"""

from rig.run_file.sense.check import Judged, judged

__all__ = ["Judged", "judged"]
