"""A simulated disk under the very SQLite that writes run files: it loses power, fills up, fails and is slow."""

from proving.disk.simulated import Crash, Disk, folding

__all__ = ["Crash", "Disk", "folding"]
