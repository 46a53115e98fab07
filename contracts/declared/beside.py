"""The DBC beside an instrument's file: its text is put into the file's, which then stands for itself."""

from __future__ import annotations

import json
import re
from collections.abc import Callable

_KEY = re.compile(r"""^( *dbc *= *)(["'])([A-Za-z0-9_][A-Za-z0-9_. -]*)\2""", re.MULTILINE)


def with_dbc(text: str, read: Callable[[str], bytes]) -> str:
    """The text of an instrument's file with its DBC in it, so that it stands for itself.

    Args:
        text: the file.
        read: gives the bytes of a file beside it; its errors are passed on.
    """
    found = _KEY.search(text)
    if found is None:
        return text
    data = read(found[3])
    try:
        dbc = data.decode("utf-8")
    except UnicodeDecodeError:  # most programs write DBC files so
        dbc = data.decode("cp1252", errors="replace")
    said = json.dumps(dbc.replace("\r\n", "\n").rstrip() + "\n", ensure_ascii=False).replace("\x7f", "")
    return f"{text[: found.start()]}{found[1]}{said}{text[found.end() :]}"
