"""Words of commands that are printed for a person to copy."""

from __future__ import annotations

import shlex


def shell_word(value: object) -> str:
    """A path, name or formula as one word of a command, whatever characters are in it.

    One that begins with a hyphen would be read as an option: as a path it begins with `./`.
    """
    text = str(value)
    return shlex.quote(f"./{text}" if text.startswith("-") else text)
