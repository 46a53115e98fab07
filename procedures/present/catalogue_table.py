"""Catalogues of effects in Markdown."""

from __future__ import annotations

from collections.abc import Iterable

from rig.fitter.effects.entry import Entry
from rig.procedures.present.markdown import table


def catalogue_table(rows: Iterable[tuple[Entry, list[str]]]) -> str:
    """A table of effects, each with the names of its columns on some data."""
    first: dict[str, str] = {}
    cells = [
        [f"`{e.name}`: {e.stratum}, {e.scope}", e.cause, _terms(e, names), once(first, e.name, e.separate_by)]
        for e, names in rows
    ]
    return table(("effect: stratum, scope", "cause", "columns", "what separates it"), cells)


def once(first: dict[str, str], name: str, text: str) -> str:
    """A sentence, or the name of the effect that has the same one, if that is shorter."""
    other = first.setdefault(text, name)
    return text if other == name or len(text.split()) < 5 else f"as `{other}`"


def _terms(entry: Entry, names: list[str]) -> str:
    """Names of its columns; where a constant is searched, those of its first value."""
    searched = getattr(entry, "searched", False)
    shown = [f"`{name}`" for name in names[: 2 if searched else 4]]
    more = ", ..." if len(names) > len(shown) else ""
    return ", ".join(shown) + more + (" (searched)" if searched else "")
