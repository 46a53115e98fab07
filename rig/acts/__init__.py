"""Acts of people and programs in a laboratory: one class an act, for page, JSON API and command line.

A further act is a further class in one of these modules; no other place changes.
"""

from rig.acts import of_files, of_laboratory, of_people, of_queue, of_runs
from rig.acts.act import Act, Told, act_of, acts
from rig.acts.places import Places, is_loop

__all__ = [
    "Act",
    "Places",
    "Told",
    "act_of",
    "acts",
    "is_loop",
    "of_files",
    "of_laboratory",
    "of_people",
    "of_queue",
    "of_runs",
]
