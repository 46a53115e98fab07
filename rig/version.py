"""What computes: our version, as the package has it, Python's, and the libraries whose answers matter."""

from __future__ import annotations

import platform
from collections.abc import Iterable
from importlib.metadata import PackageNotFoundError, version

from rig.bench.plugins import packages


def _version() -> str:
    try:
        return version("calibration-rig")
    except PackageNotFoundError:  # a source tree without installation
        return "0+source"


VERSION = _version()


def versions(drivers: Iterable[str] = ()) -> dict[str, str]:
    """Versions by name, for the run file and reports; with the packages of these drivers, if not ours."""
    import apsw  # noqa: PLC0415
    import numpy as np  # noqa: PLC0415

    return {
        "calibration-rig": VERSION,
        "python": platform.python_version(),
        "sqlite": apsw.sqlite_lib_version(),
        "numpy": np.__version__,
        **packages("rig.drivers", drivers),
    }
