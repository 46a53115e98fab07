"""A kind's catalogue of effects, with a laboratory's own."""

from __future__ import annotations

from collections import Counter
from typing import TypeVar

from rig.fitter.effects.entry import Entry
from rig.fitter.effects.history import Laboratory
from rig.procedures.errors import DataError

Own = TypeVar("Own", bound=Entry)


def with_own(ours: tuple[Own, ...], own: Laboratory, of: type[Own]) -> tuple[Own, ...]:
    """Ours first: among equally good explanations the first is named.

    Args:
        ours: entries of the kind.
        own: what the laboratory adds: effects of any kind, and how often it found each.
        of: class of the kind's entries.

    Raises:
        DataError: a name is used twice.
    """
    effects = (*ours, *(effect for effect in own.effects if isinstance(effect, of)))
    twice = [name for name, count in Counter(effect.name for effect in effects).items() if count > 1]
    if twice:
        raise DataError(f"two effects are called {twice[0]}: rename the one of your own (rig.effects, RIG_EFFECTS)")
    return tuple(map(own.history.of, effects))
