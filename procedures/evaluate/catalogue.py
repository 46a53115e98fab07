"""A kind's catalogue of effects, with a laboratory's own."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import TypeVar

from rig.fitter.effects.entry import Entry
from rig.procedures.errors import DataError

Own = TypeVar("Own", bound=Entry)


def with_own(ours: tuple[Own, ...], own: Iterable[Entry], of: type[Own]) -> tuple[Own, ...]:
    """Ours first: among equally good explanations the first is named.

    Args:
        ours: entries of the kind.
        own: the laboratory's, of any kind.
        of: class of the kind's entries.

    Raises:
        DataError: a name is used twice.
    """
    effects = (*ours, *(effect for effect in own if isinstance(effect, of)))
    twice = [name for name, count in Counter(effect.name for effect in effects).items() if count > 1]
    if twice:
        raise DataError(f"two effects are called {twice[0]}: rename the one of your own (rig.effects, RIG_EFFECTS)")
    return effects
