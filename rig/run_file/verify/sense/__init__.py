"""Consistency of the records of a sound run file: finds records that no controller can have written.

The hash chain shows a change only if its author did not compute the hashes again, and anybody can do that. The checks
here are harder to satisfy: readings and their means, readbacks and setpoints, times, counts, marks and
the events that explain them must agree. A change that is consistent in itself (every reading and mean multiplied by
1.001) shows only in a comparison with a head hash that was noted elsewhere.
"""

from rig.run_file.verify.sense.all_checks import Judged, judged

__all__ = ["Judged", "judged"]
