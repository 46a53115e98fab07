"""What computes: our version, Python's, and the libraries whose answers matter."""

from __future__ import annotations

import platform

from rig import __version__


def versions() -> dict[str, str]:
    """By name, for the run file and reports."""
    import apsw  # noqa: PLC0415
    import numpy as np  # noqa: PLC0415

    return {
        "calibration-rig": __version__,
        "python": platform.python_version(),
        "sqlite": apsw.sqlite_lib_version(),
        "numpy": np.__version__,
    }
