"""Commands with their options, as their help has them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from rig.cli.commands import COMMANDS, loaded

_SEVERAL = 3
"""Number of options that another command has, too, from which they are only named."""
_SPELLED = re.compile(r"^- (`[\w-]+)")


def commands() -> str:
    """Every command with its purpose, arguments and options."""
    return "\n".join(_commands())


def _commands() -> Iterator[str]:
    heading, first = "", dict[str, str]()
    for name, entry in COMMANDS.items():
        if entry.heading != heading:
            heading = entry.heading
            yield f"## {heading}\n"
        command = loaded(name)
        given = [one for one in command.params if one.param_type_name == "argument"]
        yield f"### `{' '.join(['rig', name, *(_argument(one) for one in given)])}`\n"
        yield (command.help or "").strip() + "\n"
        before: dict[str, list[str]] = {}
        for text in (_line(one) for one in command.params if not (one.hidden or one.name == "help")):
            before.setdefault(first.setdefault(text, name), []).append(text)
        own = [text for other, texts in before.items() if other == name or len(texts) < _SEVERAL for text in texts]
        for other, texts in before.items():
            if other != name and len(texts) >= _SEVERAL:
                own.append(f"- as for `rig {other}`: {', '.join(_SPELLED.findall(text)[0] + '`' for text in texts)}")
        yield "\n".join(own) + "\n" if own else ""


def _argument(one: Any) -> str:
    """An argument in a line of usage."""
    shown = f"{one.name.upper()}{'...' if one.nargs == -1 else ''}"
    return shown if one.required else f"[{shown}]"


def _line(one: Any) -> str:
    """One option or argument: what is written, its meaning, its default."""
    if one.param_type_name == "argument":
        return f"- `{one.name.upper()}`: {one.help or ''}"
    value = "" if one.is_flag else f" {(one.metavar or one.name).upper().strip('<>')}"
    names = ", ".join(f"`{text}{value}`" for text in (*one.opts, *one.secondary_opts))
    default = one.default() if callable(one.default) else one.default
    shown = "" if default in (None, False, (), [], "") else f" (default `{getattr(default, 'value', default)}`)"
    return f"- {names}: {one.help or ''}{shown}{' (required)' if one.required else ''}"
