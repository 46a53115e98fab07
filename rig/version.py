"""The version of this program, from its package."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version


def _version() -> str:
    try:
        return version("calibration-rig")
    except PackageNotFoundError:  # a source tree without installation
        return "0+source"


VERSION = _version()
