"""A laboratory's own effects: `rig trace` tests them in addition to the catalogues.

A laboratory adds effects without changing this project, by one or both of:

- an installed package with entry points of the group `rig.effects`, each an entry of a kind's catalogue, or a tuple of
  them;
- a TOML file named by the environment variable `RIG_EFFECTS` (its format is in `fitter/effects/own.py`).
"""

from __future__ import annotations

import os
from pathlib import Path

from rig.errors import ConfigurationError
from rig.files.regular import read_regular_text
from rig.fitter.effects.entry import Entry
from rig.fitter.effects.own import own_effects
from rig.fitter.errors import FitError
from rig.procedures.entry_points import entry_points
from rig.procedures.kinds import kinds

GROUP = "rig.effects"
VARIABLE = "RIG_EFFECTS"
_MOST_TEXT = 1 << 20


def laboratory_effects() -> tuple[Entry, ...]:
    """Installed effects, then those of the file.

    Raises:
        ConfigurationError: an entry point or the file is invalid.
    """
    return (*_installed(), *_written())


def _installed() -> tuple[Entry, ...]:
    found: list[Entry] = []
    for point in entry_points(GROUP):
        given = point.load()
        effects = given if isinstance(given, tuple) else (given,)
        if not all(isinstance(effect, Entry) for effect in effects):
            raise ConfigurationError(
                f"entry point {point.name} of {GROUP} is not an effect of a kind's catalogue, or a tuple of them"
            )
        found += effects
    return tuple(found)


def _written() -> tuple[Entry, ...]:
    path = os.environ.get(VARIABLE)
    if not path:
        return ()
    grammars = [kind.own_effects for kind in kinds().values() if kind.own_effects is not None]
    try:
        return own_effects(read_regular_text(Path(path), _MOST_TEXT), grammars)
    except (OSError, UnicodeDecodeError, FitError) as error:
        raise ConfigurationError(f"{VARIABLE}={path}: {error}") from error
