"""Text from other sources, made safe for display."""

from __future__ import annotations

import re

_UNSEEN = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")


def visible(text: str) -> str:
    """The text with escape sequences in place of control characters, characters that change the direction of text,
    and invalid characters.
    """
    return _UNSEEN.sub(lambda found: f"\\x{ord(found.group()):02x}", text)


def visible_line(text: str) -> str:
    """As `visible`, with line ends escaped too: what others wrote looks like no further line."""
    return visible(text).replace("\n", "\\x0a")
