"""Changes by an amendment, or by another register: differences of two documents, as sentences.

Entries of lists are the same by their names, not by their places: a further result moves no other one. Of a result the
printed values count, of a budget what it comes to.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

_MOST = 20
_NEVER = (("number",), ("amends",), ("dates", "issued"))
"""Parts of a document that differ in every amendment."""
_NOTHING: tuple[Any, ...] = (None, "", [], {})
"""Values that say nothing: a certificate of an earlier version lacks fields that are empty now."""
_PRINTED = ("value", "expanded", "unit", "k", "probability")
"""Values of a result as the page has them."""


def changes(old: Mapping[str, Any], new: Mapping[str, Any], most: int = _MOST) -> tuple[str, ...]:
    """Differences of two trees of values, as sentences; of more than `most` the first, and their number.

    Example:
        >>> changes({"items": [{"name": "cell", "serial": "8"}]}, {"items": [{"name": "cell", "serial": "7"}]})
        ('items cell serial: 8 is now 7',)
    """
    found = list(_changes(old, new, ()))
    left = len(found) - most
    return (*found[:most], *([f"and {left} further changes"] if left > 0 else []))


def _changes(old: Any, new: Any, where: tuple[str, ...]) -> Iterator[str]:
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        if all(key in part for key in _PRINTED for part in (old, new)):
            if any(old[key] != new[key] for key in _PRINTED):
                yield f"{_place(where)}: {_result(old)} is now {_result(new)}"
            return
        if "contributions" in old and "contributions" in new:
            yield from _budget(old, new, where)
            return
        for name in dict.fromkeys([*old, *new]):
            if (*where, name) not in _NEVER:
                yield from _changes(old.get(name), new.get(name), (*where, name))
    elif isinstance(old, list) and isinstance(new, list):
        yield from _lists(old, new, where)
    elif old != new and not (old in _NOTHING and new in _NOTHING):
        yield f"{_place(where)}: {_shown(old)} is now {_shown(new)}"


def _lists(old: Sequence[Any], new: Sequence[Any], where: tuple[str, ...]) -> Iterator[str]:
    first, then = (_named(part) for part in (old, new))
    if first is None or then is None:
        for n in range(max(len(old), len(new))):
            one, other = (part[n] if n < len(part) else None for part in (old, new))
            yield from _changes(one, other, (*where, _label(one if one is not None else other, n)))
        return
    for name in dict.fromkeys([*first, *then]):
        at = (*where, _label(first.get(name) or then[name], 0))
        if name not in first:
            yield f"{_place(at)} is new{_of_result(then[name])}"
        elif name not in then:
            yield f"{_place(at)} is left out{_of_result(first[name])}"
        else:
            yield from _changes(first[name], then[name], at)


def _named(parts: Sequence[Any]) -> dict[tuple[Any, ...], Mapping[str, Any]] | None:
    """Entries by what they are of; None if they are no entries, or several are of one."""
    if not all(isinstance(part, Mapping) for part in parts):
        return None
    found = {
        (part.get("sensor"), part.get("stage"), _first(part, "asset", "result", "name", "label", "title")): part
        for part in parts
    }
    return found if len(found) == len(parts) else None


def _first(part: Mapping[str, Any], *keys: str) -> Any:
    return next((part[key] for key in keys if part.get(key)), None)


def _budget(old: Mapping[str, Any], new: Mapping[str, Any], where: tuple[str, ...]) -> Iterator[str]:
    """A budget in a sentence: its result's sentence has the uncertainty."""
    if _printed(old) == _printed(new):
        return
    one, other = ({part.get("label") for part in of["contributions"]} for of in (old, new))
    said = [f"without {', '.join(sorted(one - other))}"] if one - other else []
    said += [f"with {', '.join(sorted(other - one))}"] if other - one else []
    unit, before, now = new.get("unit", ""), old.get("combined"), new.get("combined")
    combined = f"{before} is now {now}" if before != now else f"{now}, of other contributions,"
    yield f"{_place(where)}: {', '.join([f'the combined standard uncertainty {combined} {unit}'.rstrip(' ,'), *said])}"


def _printed(budget: Mapping[str, Any]) -> Any:
    """A budget as the page has it."""
    own = {key: value for key, value in budget.items() if key not in ("left", "contributions")}
    return own, [{k: v for k, v in part.items() if k != "share"} for part in budget["contributions"]]


def _result(part: Mapping[str, Any]) -> str:
    return f"{part['value']} ± {part['expanded']} {part['unit']} (k = {part['k']})"


def _of_result(part: Any) -> str:
    return f": {_result(part)}" if all(key in part for key in _PRINTED) else ""


def _place(where: tuple[str, ...]) -> str:
    """Where it is, in words: a name within one that says the same stands alone."""
    if "results" in where:
        where = ("result", *where[where.index("results") + 1 :])
    elif where[:1] == ("budgets",):
        where = ("budget of", *where[1:])
    return " ".join(name for n, name in enumerate(where) if not any(one.startswith(name) for one in where[n + 1 :]))


def _label(part: Any, n: int) -> str:
    """Name of an entry of a list, or its ordinal."""
    if isinstance(part, Mapping):
        name = _first(part, "result", "name", "label", "sensor")
        if name:
            return " ".join(filter(None, (str(name), part.get("stage"))))
    return str(n + 1)


def _shown(value: Any) -> str:
    if value in _NOTHING:
        return "nothing"
    if isinstance(value, Mapping | list):
        return "a new entry"
    return str(value)
