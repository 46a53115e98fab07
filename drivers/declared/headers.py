"""Headers that answers repeat, as in `:SOUR:PRES 5.0`: an answer to another question shows by its own."""

from __future__ import annotations

from collections.abc import Collection
from functools import lru_cache


@lru_cache(maxsize=256)
def same_header(asked: str, echoed: str, ends: Collection[str]) -> bool:
    """Whether an echoed header is that of a question: `ends` may be spelt out, numbers left out.

    A number must be the expected one, or 1 if none was sent: answers of another module are refused.

    Example:
        >>> same_header(":SOUR:PRES", ":SOUR1:PRES:LEV", ("LEV",)), same_header(":SOUR2:PRES", ":SOUR3:PRES", ())
        (True, False)
    """
    asked_nodes, told_nodes = (_nodes(text) for text in (asked, echoed))
    for (name, number), (told, told_number) in zip(asked_nodes, told_nodes, strict=False):
        if name != told or told_number not in ("", number or "1"):
            return False
    rest = ":".join(name for name, _ in told_nodes[len(asked_nodes) :])
    return len(told_nodes) >= len(asked_nodes) and rest in ("", *ends)


def _nodes(header: str) -> list[tuple[str, str]]:
    """The nodes of a header, each with its number, "" if it has none."""
    nodes = header.upper().removeprefix(":").rstrip(":").split(":")
    return [(node.rstrip("0123456789"), node[len(node.rstrip("0123456789")) :]) for node in nodes]
