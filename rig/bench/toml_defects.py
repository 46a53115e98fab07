"""Lines of a settings file that are no TOML: what to write instead, and the mended line."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable

_Mend = Callable[[str], str]


def _by(pattern: str, replacement: str) -> _Mend:
    return lambda line: re.sub(pattern, replacement, line)


_HINTS: tuple[tuple[str, str, _Mend], ...] = (
    (
        r"[\u201c\u201d\u201e\u2018\u2019]",
        'quotes are straight: "text"',
        _by("[\u201c\u201d\u201e\u2018\u2019]", '"'),
    ),
    (r"^\s*(;|//|%|!)", "a remark begins with #", _by(r"^\s*(;|//|%|!)\s*", "# ")),
    (r"=\s*-?\d+,\d", "the decimal sign is a point", _by(r"(=\s*-?\d+),(\d)", r"\1.\2")),
    (r"=\s*\[[^\]]*\d\s+-?\d", "commas separate the values of a list", _by(r"(\d)\s+(?=-?\d)", r"\1, ")),
    (
        r"=\s*(True|False|TRUE|FALSE|yes|no|on|off|Yes|No)\b",
        "write true or false",
        lambda line: _by(r"(=\s*)(False|FALSE|no|off|No)\b", r"\1false")(
            _by(r"(=\s*)(True|TRUE|yes|on|Yes)\b", r"\1true")(line)
        ),
    ),
    (r'=\s*"[^"]*\\', "a text with backslashes has single quotes", _by(r'(=\s*)"([^"\']*)"', r"\1'\2'")),
    (r"^\s*\[+[^\]]*$", "a section ends with ]", lambda line: line.rstrip() + "]" * line.count("[")),
    (r"=\s*[A-Za-z/]", "a text has quotes", _by(r"(=\s*)([A-Za-z/][^\"#]*?)(\s*(#.*)?)$", r'\1"\2"\3')),
    (r"^\s*[\w.-]+\s*:", "write NAME = VALUE", _by(r"^(\s*[\w.-]+)\s*:\s*", r"\1 = ")),
)
"""Frequent defects of lines that are no TOML, what to write instead, and how the line is mended."""
_LONGEST = 500
_PRIVATE = re.compile(r"(?i)password|token|secret|api_?key|url")


def in_words(text: str, error: str, *, shown: bool) -> str:
    """What to write instead of a line that is no TOML, for the end of a message, with the line and the mended one.

    Possible secrets are not `shown`; a mended line is, if the file can be read further with it.
    """
    place = re.search(r"\(at line (\d+), column \d+\)$", error)
    if place is None:
        return ""
    lines, number = text.splitlines(), int(place[1])
    line = lines[number - 1]
    if error.startswith("Cannot overwrite a value"):
        return f": {line.partition('=')[0].strip():.60} has a value already; give it one"
    if re.match(r"Cannot (declare|mutate)", error):
        return f": {line.strip():.60} is there already; put its keys together"
    hint, mend = next(((hint, mend) for pattern, hint, mend in _HINTS if re.search(pattern, line)), ("", None))
    told = f": {hint}" if hint else ""
    if not shown or len(line) > _LONGEST or _PRIVATE.search(line) or not line.isprintable():
        return told
    told += f"\n  line {number}: {line.strip():.100}"
    if mend is not None and (mended := mend(line)) != line and _reads_further(lines, number, mended):
        told += f"\n  write instead: {mended.strip():.100}"
    return told


def _reads_further(lines: list[str], number: int, mended: str) -> bool:
    """Whether a file with a mended line has no defect up to and in this line."""
    try:
        tomllib.loads("\n".join([*lines[: number - 1], mended, *lines[number:]]))
    except tomllib.TOMLDecodeError as error:
        place = re.search(r"\(at line (\d+), column \d+\)$", str(error))
        return place is not None and int(place[1]) > number
    except (ValueError, RecursionError):
        return False
    return True
