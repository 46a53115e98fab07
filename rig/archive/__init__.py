"""Items and equipment of a laboratory: their certificates, what is due, which certificates used what.

The public face: `Lab`, the index of a folder, and what it answers. The files are the truth; the index is made of them.
"""

from rig.archive.answers import Affected, Due, History, affected, due, history, known
from rig.archive.index import Lab

__all__ = ["Affected", "Due", "History", "Lab", "affected", "due", "history", "known"]
