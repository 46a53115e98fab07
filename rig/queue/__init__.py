"""A queue of runs and loops: one at a time on a bench, several benches at once.

The public face: `Keeps`, the place where a queue is kept; its state `Queue`; and `work`, which carries the items out.
"""

from rig.queue.file import Item, Keeps, Queue, QueueFile, open_queue
from rig.queue.worker import work

__all__ = ["Item", "Keeps", "Queue", "QueueFile", "open_queue", "work"]
