"""The command `rig explain`: references made from what the program uses."""

from __future__ import annotations

import re
from typing import Annotated

import typer
from rich.markdown import Markdown

from rig.cli.commands import app
from rig.cli.show import out
from rig.errors import ExitCode
from rig.explain import TOPICS, explained
from rig.procedures.present.shell import shell_word

_LINK = re.compile(r"\[([^]]+)\]\((\.\./)?([\w/]+\.md)[^)]*\)")
"""A link between pages, as a page of docs/reference has it."""


def _named(link: re.Match[str]) -> str:
    """A link as words, with the page that it leads to."""
    return f"{link[1]} (`docs/{'' if link[2] else 'reference/'}{link[3]}`)"


@app.command()
def explain(
    topic: Annotated[str, typer.Argument(help="see below", show_default=False)] = "",
    name: Annotated[str, typer.Argument(help="only what has this name", show_default=False)] = "",
) -> int:
    """Explain the keys of files, options of instruments, effects, models, commands, and exit codes.

    Without a topic it lists the topics.

    Examples:

    - `rig explain bench interlocks`
    - `rig explain instruments scpi-meter`
    - `rig explain effects creep`
    """
    if topic:
        text = _LINK.sub(_named, explained(topic, name))
    else:
        text = "".join(f"- `rig explain {shell_word(name)}`: {topic.does}\n" for name, topic in TOPICS.items())
    if out.is_terminal:
        out.print(Markdown(text))
    else:
        print(text, end="")
    return ExitCode.DONE
