"""The live page of a run: a separate process that only reads the run file and `RUN.live`.

It opens no instrument and writes no file. A crash of it, or several of them, never affects a run.
"""

from rig.watch.access import Access
from rig.watch.app import make_app
from rig.watch.server import serve
from rig.watch.shelf import Shelf

__all__ = ["Access", "Shelf", "make_app", "serve"]
