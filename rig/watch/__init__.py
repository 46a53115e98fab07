"""The live page of a run: a process of its own that reads the run file and `RUN.live`, and nothing else.

It opens no instrument and writes no file. Losing it, or starting three of it, never matters to a run.
"""

from rig.watch.access import Access
from rig.watch.app import make_app
from rig.watch.server import serve
from rig.watch.shelf import Shelf

__all__ = ["Access", "Shelf", "make_app", "serve"]
