"""Place of `notify.toml`. Separate from the module that reads it, because that one is slow to import."""

from __future__ import annotations

import os
from pathlib import Path


def find_settings(explicit: Path | None) -> Path | None:
    """Path of `notify.toml`: `explicit`, $RIG_NOTIFY, the user's, or the machine's; None if there is none."""
    if explicit is not None:
        return explicit
    named = os.environ.get("RIG_NOTIFY")
    if named:
        return Path(named)
    home = Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config")
    places = (home / "calibration-rig" / "notify.toml", Path("/etc/calibration-rig/notify.toml"))
    return next((place for place in places if place.is_file()), None)
