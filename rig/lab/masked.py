"""Settings files without their secrets: keys whose values stay out of the log and of pages."""

from __future__ import annotations

import re
from collections.abc import Iterator

_WORDS = r"pass(?:word|wd|phrase)|pwd|token|secret|credential|api[_-]?key|private|url|webhook"
"""Parts of keys that may be secrets, or where people write secrets: addresses, and names of variables."""
_STRING = r"\"{3}.*?\"{3}|'{3}.*?'{3}|\"(?:[^\"\\\n]|\\.)*\"|'[^'\n]*'"
_VALUE = rf"{_STRING}|\[[^\]]*\]|\{{[^}}\n]*\}}|[^\s#,}}\]]+"
_KEY = re.compile(rf"""(?is)((?<![\w.-])(?:[\w.-]|"[^"\n]*"|'[^'\n]*')*?(?:{_WORDS})[\w.-]*["']?\s*=\s*)({_VALUE})""")
_HEADER = re.compile(r"^\s*\[+\s*([^\]\n]*)\]", re.MULTILINE)
_ANY = re.compile(rf"""(?s)(^[ \t]*[\w."'-]+[ \t]*=[ \t]*)({_VALUE})""", re.MULTILINE)
_USER = re.compile(r"(://[^/\s:@\"']*):[^/\s@\"']+@")
_TABLE = re.compile(rf"(?i)(?:{_WORDS})")


def without_secrets(text: str) -> str:
    """The text of a settings file, with "not shown" for values that may be secrets.

    Example:
        >>> without_secrets('api_key = "abc"  # of the mail')
        'api_key = "not shown"  # of the mail'
    """
    return "".join(_section(*part) for part in _sections(text))


def _sections(text: str) -> Iterator[tuple[str, str]]:
    """Names of tables, and their texts with the heading."""
    at, name = 0, ""
    for found in _HEADER.finditer(text):
        yield name, text[at : found.start()]
        at, name = found.start(), found[1]
    yield name, text[at:]


def _section(name: str, text: str) -> str:
    pattern = _ANY if _TABLE.search(name) else _KEY
    return _USER.sub(r"\1:not-shown@", pattern.sub(r'\1"not shown"', text))
