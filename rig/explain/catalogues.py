"""Effects that a trace looks for, and standard models, of every kind."""

from __future__ import annotations

from rig.procedures.kinds import kinds


def effects() -> str:
    """Catalogues of all kinds."""
    return _of_kinds("effects")


def models() -> str:
    """Standard models of all kinds."""
    return _of_kinds("models")


def _of_kinds(topic: str) -> str:
    return "\n".join(text for kind in kinds().values() if (text := kind.explained(topic)))
