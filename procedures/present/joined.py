"""Sentences about sensors, each once; names in one line, as many as a person reads."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

MOST = 6
"""Names in a line; where there are many more, their number stands for the rest."""


def joined(told: Iterable[tuple[str, str]]) -> Iterator[str]:
    """Sentences about sensors, each once, with the names of all sensors that it is about before it."""
    names: dict[str, list[str]] = {}
    for sensor, sentence in told:
        names.setdefault(sentence, []).append(sensor)
    yield from (f"{', '.join(every)}: {sentence}" if any(every) else sentence for sentence, every in names.items())


def once(notes: Iterable[str], names: Mapping[str, str] | None = None) -> Iterator[str]:
    """Notes of which those that begin with a sensor are joined, as in `joined`.

    Args:
        notes: sentences.
        names: of sensors, by their outputs; None for any single word before a colon.
    """
    known = None if names is None else {**names, **{name: name for name in names.values()}}
    parts = [note.partition(": ") for note in notes]
    yield from joined(
        ((known or {}).get(first, first), rest)
        if colon and (first.isidentifier() if known is None else first in known)
        else ("", f"{first}{colon}{rest}")
        for first, colon, rest in parts
    )


def some(names: Sequence[str], between: str = ", ") -> str:
    """Names in a line, the first of them if they are many.

    Example:
        >>> some(["drift", "step"], " or "), some(list("abcdefghij"))
        ('drift or step', 'a, b, c, d, e, f and 4 more')

    """
    more = len(names) - MOST
    return between.join(names) if more <= 1 else f"{between.join(names[:MOST])} and {more} more"
