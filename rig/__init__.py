"""The controller: benches, the sequencer, the run file, recovery, the closed loop, the command line."""

from importlib.metadata import PackageNotFoundError, version

try:
    __version__ = version("calibration-rig")
except PackageNotFoundError:  # a source tree that was never installed
    __version__ = "0+source"
