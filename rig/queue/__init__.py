"""A queue of runs and loops: one at a time on a bench, several benches at once.

The public face: `QueueFile`, its state `Queue`, and `work`, which carries the items out.
"""

from rig.queue.file import Item, Queue, QueueFile, open_queue
from rig.queue.worker import work

__all__ = ["Item", "Queue", "QueueFile", "open_queue", "work"]
