"""A laboratory's own effects, which `rig trace` tests in addition to the catalogues, and its history.

A laboratory adds effects without changing this project, by one or both of:

- an installed package with entry points of the group `rig.effects`, each an entry of a kind's catalogue, a tuple of
  them, or what `own_effects` makes of a text;
- a TOML file named by the environment variable `RIG_EFFECTS` (its format is in `fitter/effects/own.py`).
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

from rig.errors import ConfigurationError
from rig.files.regular import read_regular_text
from rig.fitter.effects.entry import Entry
from rig.fitter.effects.history import NOTHING, Laboratory
from rig.fitter.effects.own import own_effects
from rig.fitter.errors import FitError
from rig.procedures.entry_points import entry_points
from rig.procedures.kinds import kinds

GROUP = "rig.effects"
VARIABLE = "RIG_EFFECTS"
_MOST_TEXT = 1 << 20


def laboratory_effects() -> Laboratory:
    """Installed effects, then those of the file, with its history.

    Raises:
        ConfigurationError: an entry point or the file is invalid.
    """
    written = _written()
    return replace(written, effects=(*_installed(), *written.effects))


def _installed() -> tuple[Entry, ...]:
    found: list[Entry] = []
    for point in entry_points(GROUP):
        given = point.load()
        if isinstance(given, Laboratory):
            if given.history.calibrations:
                raise ConfigurationError(f"entry point {point.name} of {GROUP} has a history: declare it in {VARIABLE}")
            given = given.effects
        effects = given if isinstance(given, tuple) else (given,)
        if not all(isinstance(effect, Entry) for effect in effects):
            raise ConfigurationError(
                f"entry point {point.name} of {GROUP} is not an effect of a kind's catalogue, or a tuple of them"
            )
        found += effects
    return tuple(found)


def _written() -> Laboratory:
    path = os.environ.get(VARIABLE)
    if not path:
        return NOTHING
    grammars = [kind.own_effects for kind in kinds().values() if kind.own_effects is not None]
    try:
        written = own_effects(read_regular_text(Path(path), _MOST_TEXT), grammars)
    except (OSError, UnicodeDecodeError, FitError) as error:
        raise ConfigurationError(f"{VARIABLE}={path}: {error}") from error
    if written.history.confirmed:
        shown = "".join(kind.explained("effects") for kind in kinds().values())
        own = {effect.name for effect in written.effects}
        # Of a table's effect, such as `periodic:x_mm`, the part before the column is in a catalogue.
        for name in written.history.confirmed:
            if name not in own and f"`{name.split(':')[0]}" not in shown:
                raise ConfigurationError(
                    f"{VARIABLE}={path}: [history]: {name} is in no catalogue: `rig explain effects` lists all effects"
                )
    return written
