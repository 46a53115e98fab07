"""The catalogue of effects that `rig trace` looks for in attitude runs: ours, and the laboratory's own.

A laboratory adds effects without touching this project, by either or both of

- an installed package with entry points of the group `rig.effects`, each an `fitter.effects.Effect` or a tuple of them;
- a TOML file named by the environment variable `RIG_EFFECTS` (`fitter/effects/own.py` says how it is written).
"""

from __future__ import annotations

import os
from collections import Counter
from importlib.metadata import entry_points
from pathlib import Path

from fitter.effects import CATALOGUE, Effect
from fitter.effects.own import own_effects
from rig.errors import ConfigurationError

GROUP = "rig.effects"
VARIABLE = "RIG_EFFECTS"


def attitude_catalogue() -> tuple[Effect, ...]:
    """Our catalogue first: of explanations that are equally good the first is named.

    Raises:
        ConfigurationError: an entry point or the file is not what it should be, or a name is used twice.

    """
    effects = (*CATALOGUE, *_installed(), *_written())
    twice = [name for name, count in Counter(effect.name for effect in effects).items() if count > 1]
    if twice:
        raise ConfigurationError(f"two effects are called {twice[0]}: rename the one of your own ({GROUP}, {VARIABLE})")
    return effects


def _installed() -> tuple[Effect, ...]:
    found: list[Effect] = []
    for point in entry_points(group=GROUP):
        given = point.load()
        effects = given if isinstance(given, tuple) else (given,)
        if not all(isinstance(effect, Effect) for effect in effects):
            raise ConfigurationError(
                f"entry point {point.name} of {GROUP} is no effect: give an Effect or a tuple of them"
            )
        found += effects
    return tuple(found)


def _written() -> tuple[Effect, ...]:
    path = os.environ.get(VARIABLE)
    if not path:
        return ()
    try:
        return own_effects(Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ConfigurationError(f"{VARIABLE}={path}: {error}") from error
