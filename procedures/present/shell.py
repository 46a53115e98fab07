"""Words of commands that are printed for a person to copy."""

from __future__ import annotations

import shlex
from collections.abc import Iterable


def shell_word(value: object) -> str:
    """A path, name or formula as one word of a command, whatever characters are in it.

    One that begins with a hyphen would be read as an option: as a path it begins with `./`.
    """
    text = str(value)
    return shlex.quote(f"./{text}" if text.startswith("-") else text)


def confirming(run: object, ignore: Iterable[str] | None = None) -> str:
    """The command that confirms what a trace of a run found, with the columns that the trace ignored.

    Example:
        >>> confirming("runs/night.sqlite", ["flow_side"])
        'rig confirm runs/night.sqlite --ignore flow_side'
    """
    return " ".join([f"rig confirm {shell_word(run)}", *(f"--ignore {shell_word(one)}" for one in ignore or ())])
