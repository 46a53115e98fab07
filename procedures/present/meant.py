"""The known name that a person meant who wrote another one."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


def nearest(given: str, known: Iterable[str]) -> str:
    """The known name that is most like a given one; "" if none is.

    Example:
        >>> nearest("flow_kg_per_mn", ["valve_V", "flow_kg_per_min"]), nearest("HZ", ["Hz", "V"]), nearest("x", ["Hz"])
        ('flow_kg_per_min', 'Hz', '')
    """
    names = list(known)
    cases = {one.casefold(): one for one in reversed(names)}
    near = get_close_matches(given, names, n=1) or get_close_matches(given.casefold(), list(cases), n=1)
    return cases.get(near[0].casefold(), near[0]) if near and near[0] not in names else "".join(near)


def meant(given: str, known: Iterable[str]) -> str:
    """The end of a message about an unknown name: "; did you mean NAME?", or "" if no known name is like it."""
    return f"; did you mean {near}?" if (near := nearest(given, known)) else ""
