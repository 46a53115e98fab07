"""Steps of long work, told to a listener, such as a progress bar. The work does not know whether there is one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import NamedTuple, TypeVar

T = TypeVar("T")
Listener = Callable[[float, str], None]
"""Hears which part of the work is done, 0 to 1, and what is next."""


class _Part(NamedTuple):
    """The part of the whole work that is under way: where it begins, how much it is, and what it is."""

    begins: float
    length: float
    words: str
    listener: Listener


_part: ContextVar[_Part | None] = ContextVar("part of the work", default=None)


@contextmanager
def heard(listener: Listener) -> Iterator[None]:
    """The listener hears of all steps of what is done inside."""
    token = _part.set(_Part(0.0, 1.0, "", listener))
    try:
        yield
    finally:
        _part.reset(token)


def steps(items: Sequence[T], words: Callable[[T], str] = str, *, after: float = 0.0) -> Iterator[T]:
    """Items, of each of which the listener hears before it is worked on; steps inside a step are parts of it.

    Args:
        items: as long as each other, about.
        words: what is done with one.
        after: part of the work around these steps that was done before them, 0 to 1.

    Example:
        >>> told = []
        >>> with heard(lambda done, words: told.append((done, words))):
        ...     for output in steps(["a_V", "b_V"]):
        ...         inside = [*steps([1, 2], "rows left out, {} of 2".format, after=0.5)]
        >>> told[1], told[3]
        ((0.25, 'a_V: rows left out, 1 of 2'), (0.5, 'b_V'))

    """
    around = _part.get()
    if around is None:
        yield from items
        return
    first, each = around.begins + around.length * after, around.length * (1.0 - after) / max(len(items), 1)
    for k, item in enumerate(items):
        said = f"{around.words}: {words(item)}" if around.words else words(item)
        own = _Part(first + k * each, each, said, around.listener)
        own.listener(own.begins, said)
        token = _part.set(own)
        try:
            yield item
        finally:
            _part.reset(token)
