"""An answer to *IDN? that fits a pattern: the twin of an instrument that is known by a regular expression."""

from __future__ import annotations

import re
from re import _constants as codes  # type: ignore[attr-defined]
from re import _parser as parser  # type: ignore[attr-defined]
from typing import Any

_ANYTHING = "".join(map(chr, range(33, 127))) + " "
_MARK = "simulated"
_FIELDS = (_MARK.upper(), _MARK.upper(), "", _MARK)
"""Maker, model, serial number and version, where the pattern leaves them open; the serial number is the twin's own."""


def fitting(pattern: str, serial: str) -> str | None:
    """A text that a pattern matches as a whole, marked as simulated where the pattern allows it; None if none is found.

    Args:
        pattern: a regular expression.
        serial: serial number of the twin.
    """
    text = _text(parser.parse(pattern), "", serial, {})
    rest = "".join(f",{field or serial}" for field in _FIELDS[text.count(",") + 1 :])
    return next((one for one in (text + rest, text) if re.fullmatch(pattern, one)), None)


def _text(parsed: Any, before: str, serial: str, groups: dict[int, str]) -> str:
    """The text for a part of a pattern, after `before`; `before` is in it."""
    for code, argument in parsed:
        if code is codes.LITERAL:
            before += chr(argument)
        elif code in (codes.MAX_REPEAT, codes.MIN_REPEAT, codes.POSSESSIVE_REPEAT):
            before = _repeated(argument, before, serial, groups)
        elif code is codes.SUBPATTERN:
            start, before = len(before), _text(argument[-1], before, serial, groups)
            groups[argument[0]] = before[start:]
        elif code is codes.ATOMIC_GROUP:
            before = _text(argument, before, serial, groups)
        elif code is codes.BRANCH:
            before = _text(argument[1][0], before, serial, groups)
        elif code is codes.GROUPREF:
            before += groups.get(argument, "")
        elif code in (codes.ANY, codes.IN, codes.NOT_LITERAL):
            before += _filled([(code, argument)], 1, 1, before, serial)
    return before


def _repeated(repeat: tuple[int, Any, Any], before: str, serial: str, groups: dict[int, str]) -> str:
    least, most, part = repeat
    if len(part) == 1 and part[0][0] in (codes.ANY, codes.IN, codes.NOT_LITERAL):
        return before + _filled(part, least, int(most), before, serial)
    for _ in range(least):
        before = _text(part, before, serial, groups)
    return before


def _filled(part: Any, least: int, most: int, before: str, serial: str) -> str:
    """Characters of one class: what the field of the identity is about, as far as they allow it."""
    allowed = [c for c in _ANYTHING if _allows(part[0], c)]
    field = before.count(",")
    wanted = (_FIELDS[field] if field < len(_FIELDS) else _MARK) or serial
    kept = "".join(c for c in wanted if c in allowed) or "".join(c for c in serial if c in allowed)
    filler = allowed[0] if allowed else " "
    return kept[:most].ljust(least, kept[-1:] or filler)


def _allows(one: tuple[Any, Any], character: str) -> bool:
    code, argument = one
    if code is codes.ANY:
        return True
    if code is codes.NOT_LITERAL:
        return bool(ord(character) != argument)
    inside = any(_holds(item, character) for item in argument if item[0] is not codes.NEGATE)
    return inside is not (argument[0][0] is codes.NEGATE)


def _holds(item: tuple[Any, Any], character: str) -> bool:
    code, argument = item
    if code is codes.LITERAL:
        return bool(ord(character) == argument)
    if code is codes.RANGE:
        return bool(argument[0] <= ord(character) <= argument[1])
    classes = {
        codes.CATEGORY_DIGIT: r"\d",
        codes.CATEGORY_NOT_DIGIT: r"\D",
        codes.CATEGORY_WORD: r"\w",
        codes.CATEGORY_NOT_WORD: r"\W",
        codes.CATEGORY_SPACE: r"\s",
        codes.CATEGORY_NOT_SPACE: r"\S",
    }
    return re.fullmatch(classes[argument], character) is not None
