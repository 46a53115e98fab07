"""Templates of the user with `{name}` in them: checking and filling in."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from rig.procedures.present.meant import nearest

_PLACE = re.compile(r"\{\{(\w+)\}\}|\{(\w+)\}")


def filled(value: object, words: Mapping[str, str]) -> object:
    """A table with `{name}` filled in, in all its texts at every depth; `{{name}}` becomes `{name}`."""
    if isinstance(value, str):
        return _PLACE.sub(lambda found: f"{{{found[1]}}}" if found[1] else words.get(found[2], found[0]), value)
    if isinstance(value, Mapping):
        return {str(k): filled(v, words) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [filled(v, words) for v in value]
    return value


def check_names(value: object, known: tuple[str, ...], place: str) -> None:
    """Raise ValueError for an unknown name, with its place and the most similar known name."""
    for at, text in _texts(value, place):
        for found in _PLACE.finditer(text):
            name = found[2]
            if name is None or name in known:
                continue
            near = nearest(name, known)
            meant = f"did you mean {{{near}}}?" if near else f"known: {', '.join(f'{{{k}}}' for k in known)}"
            raise ValueError(f"{at}: there is no {{{name}}}; {meant} (to send it unchanged, write {{{{{name}}}}})")


def _texts(value: object, place: str) -> Iterator[tuple[str, str]]:
    """Every text at every depth, and its place."""
    if isinstance(value, str):
        yield place, value
    elif isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _texts(inner, f"{place}.{key}")
    elif isinstance(value, (list, tuple)):
        for number, inner in enumerate(value):
            yield from _texts(inner, f"{place}.{number}")
