"""Where the file lies that says who is told. Apart from what reads it, which takes a while to import."""

from __future__ import annotations

import os
from pathlib import Path


def find_settings(explicit: Path | None) -> Path | None:
    """The file that says who is told: `explicit`, $RIG_NOTIFY, the user's, the machine's; None if there is none."""
    if explicit is not None:
        return explicit
    named = os.environ.get("RIG_NOTIFY")
    if named:
        return Path(named)
    home = Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config")
    places = (home / "calibration-rig" / "notify.toml", Path("/etc/calibration-rig/notify.toml"))
    return next((place for place in places if place.is_file()), None)
