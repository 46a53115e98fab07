"""The version of this program, as its package has it."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version


def _version() -> str:
    try:
        return version("calibration-rig")
    except PackageNotFoundError:  # a source tree that was never installed
        return "0+source"


VERSION = _version()
