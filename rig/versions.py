"""Versions of the software that computes: ours, Python's, and those of relevant libraries."""

from __future__ import annotations

import platform
from collections.abc import Iterable

from rig.plugins import packages
from rig.version import VERSION


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
