"""The catalogues of effects that `rig trace` looks for in runs: ours, and the laboratory's own.

A laboratory adds effects without touching this project, by either or both of

- an installed package with entry points of the group `rig.effects`, each an `Effect` of `procedures.attitude.effects`
  or a `PressureEffect` of `procedures.pressure.effects.scene`, or a tuple of them;
- a TOML file named by the environment variable `RIG_EFFECTS` (`fitter/effects/own.py` says how it is written).
"""

from __future__ import annotations

import os
from collections import Counter
from importlib.metadata import entry_points
from pathlib import Path

from fitter.effects.entry import Entry
from fitter.effects.own import own_effects
from fitter.errors import FitError
from procedures.attitude.effects import CATALOGUE, Effect
from procedures.attitude.effects import own as own_of_attitude
from procedures.pressure.effects import PRESSURE_CATALOGUE
from procedures.pressure.effects import own as own_of_pressure
from procedures.pressure.effects.scene import PressureEffect
from rig.errors import ConfigurationError
from rig.regular import read_regular_text

GROUP = "rig.effects"
VARIABLE = "RIG_EFFECTS"
GRAMMARS = (own_of_attitude.GRAMMAR, own_of_pressure.GRAMMAR)


def attitude_catalogue() -> tuple[Effect, ...]:
    """Of attitude sensors, ours first: of explanations that are equally good the first is named.

    Raises:
        ConfigurationError: an entry point or the file is not what it should be, or a name is used twice.

    """
    effects = (*CATALOGUE, *(effect for effect in _own() if isinstance(effect, Effect)))
    _check_names([effect.name for effect in effects])
    return effects


def pressure_catalogue() -> tuple[PressureEffect, ...]:
    """The same of pressure transducers in whole plots."""
    effects = (*PRESSURE_CATALOGUE, *(effect for effect in _own() if isinstance(effect, PressureEffect)))
    _check_names([effect.name for effect in effects])
    return effects


def _check_names(names: list[str]) -> None:
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise ConfigurationError(f"two effects are called {twice[0]}: rename the one of your own ({GROUP}, {VARIABLE})")


def _own() -> tuple[Entry, ...]:
    return (*_installed(), *_written())


def _installed() -> tuple[Entry, ...]:
    found: list[Entry] = []
    for point in entry_points(group=GROUP):
        given = point.load()
        effects = given if isinstance(given, tuple) else (given,)
        if not all(isinstance(effect, Effect | PressureEffect) for effect in effects):
            raise ConfigurationError(
                f"entry point {point.name} of {GROUP} is no effect: give an Effect, a PressureEffect or a tuple"
            )
        found += effects
    return tuple(found)


_MOST_TEXT = 1 << 20


def _written() -> tuple[Entry, ...]:
    path = os.environ.get(VARIABLE)
    if not path:
        return ()
    try:
        return own_effects(read_regular_text(Path(path), _MOST_TEXT), GRAMMARS)
    except (OSError, UnicodeDecodeError, FitError) as error:
        raise ConfigurationError(f"{VARIABLE}={path}: {error}") from error
