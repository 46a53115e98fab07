"""Text of others, made harmless to whoever looks at it."""

from __future__ import annotations

import re

_UNSEEN = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")


def visible(text: str) -> str:
    """Text with characters that would steer a terminal, turn its lines round, or are none, written out."""
    return _UNSEEN.sub(lambda found: f"\\x{ord(found.group()):02x}", text)
