"""The text of a file of bytes: its encoding is told, or recognised, or asked for."""

from __future__ import annotations

import codecs
import re

from rig.errors import UsageError

_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_SIGNS = "\xa0\xb0\xb1\xb2\xb3\xb5\xb7\xb9\xd7\u2030\u2013\u20ac\u2026"
"""Signs of measurements in CP1252 that stand alone: degree, plus-minus, powers, micro, dot, times, per mille."""
_STRANGE = re.compile(rf"[^\x00-\x7f\xc0-\xff{_SIGNS}]|[\xc0-\xff]{{3,}}")
_LETTER = re.compile(r"(?<![A-Za-z\xc0-\xff])[\xc0-\xff]{1,2}(?![A-Za-z\xc0-\xff])")
"""A letter with an accent that stands alone, as Western words have none."""


def text_of(data: bytes, name: str, asked: str = "") -> tuple[str, str]:
    """The text, and the name of its encoding.

    Args:
        data: the file.
        name: of the file, for messages.
        asked: encoding declared by the user; "" to recognise it.

    Raises:
        UsageError: the bytes are not text in the declared encoding, or the encoding is not recognised.
    """
    mark = next((known for start, known in _MARKS if data.startswith(start)), "")
    encoding = asked or mark or "utf-8"
    try:
        text = data.decode(encoding)
    except (UnicodeDecodeError, ValueError) as error:
        if asked or mark:
            start = "is neither a run file nor UTF-8 text, and" if mark else "is"
            raise UsageError(f"{name} {start} not text in {encoding} ({error}); name another --encoding") from None
        text, encoding = _western(data, name), "cp1252"
    if "\0" in text:
        wide = data[:200].count(b"\0") > len(data[:200]) // 3
        hint = "; if it is UTF-16, say --encoding utf-16-le or utf-16-be" if wide else ""
        raise UsageError(f"{name} is not a table: there is a NUL in it{hint}")
    return text.removeprefix("\ufeff"), encoding


def _western(data: bytes, name: str) -> str:
    """Text in CP1252 (Latin-1) if all its letters and signs are those of Western words and units."""
    refusal = f"{name} is neither a run file nor UTF-8 text, and its encoding is not clear: say it with --encoding"
    try:
        text = data.decode("cp1252")
    except UnicodeDecodeError as error:
        raise UsageError(f"{refusal} (byte {error.start})") from None
    if (wrong := _STRANGE.search(text) or _LETTER.search(text)) or "\0" in text:
        where = "" if wrong is None else f" (row {text.count(chr(10), 0, wrong.start()) + 1})"
        raise UsageError(f"{refusal}{where}, such as cp1251, cp1250 or shift_jis")
    return text
