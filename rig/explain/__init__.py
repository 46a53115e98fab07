"""References made from what the program uses: the command `rig explain`, and the generated parts of the documents.

Every function gives Markdown. Drivers, kinds and effects of other installed packages are in it, too.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import NamedTuple

from rig.errors import UsageError


class Topic(NamedTuple):
    """A subject: one line on it, and the function that writes it, imported when it is asked for."""

    does: str
    module: str
    function: str

    def text(self) -> str:
        """The whole reference."""
        write: Callable[[], str] = getattr(import_module(f"rig.{self.module}"), self.function)
        return write()


TOPICS: Mapping[str, Topic] = {
    "commands": Topic("every command with its arguments and options", "cli.command_lines", "commands"),
    "exit-codes": Topic("exit codes, and what to do", "explain.codes_and_states", "exit_codes"),
    "bench": Topic("keys of bench.toml", "explain.file_keys", "bench"),
    "procedure": Topic("keys of procedure.toml, by kind", "explain.file_keys", "procedure"),
    "equipment": Topic("keys of equipment.toml, the register", "explain.file_keys", "equipment"),
    "certificate": Topic("keys of certificate.toml", "explain.file_keys", "certificate"),
    "people": Topic("keys of people.toml, which rig person writes", "explain.file_keys", "people"),
    "instruments": Topic("options of each driver, for bench.toml", "explain.file_keys", "instruments"),
    "instrument-file": Topic("keys of the file of an instrument of your own", "explain.file_keys", "instrument_file"),
    "declared": Topic(
        "instruments that are files: what is sent, and how each was tried", "verbs.instrument.catalogue", "reference"
    ),
    "world": Topic("keys of world.toml, the truth behind a simulated bench", "simulated.world_keys", "world"),
    "faults": Topic("kinds of [[faults]] in world.toml", "simulated.world_keys", "faults"),
    "effects": Topic("effects that a trace looks for, by kind", "explain.catalogues", "effects"),
    "models": Topic("standard models of tables", "explain.catalogues", "models"),
    "states": Topic("states of a run, and what moves it from one to another", "explain.codes_and_states", "states"),
}


def explained(topic: str, name: str = "") -> str:
    """Markdown on a topic, or the parts of it on a name.

    Raises:
        UsageError: the topic is not known, or has nothing of that name.
    """
    if topic not in TOPICS:
        raise UsageError(f"there is no topic {topic!r}; topics are {', '.join(TOPICS)}")
    text = TOPICS[topic].text()
    found = parts(text, name.lower()) if name else text
    if not found:
        raise UsageError(f"nothing in {topic} has the name {name!r}; the topic alone prints all of it")
    return found


def parts(text: str, name: str) -> str:
    """Sections with a name in their heading; if there are none, rows and items that begin with it."""
    sections = re.split(r"(?m)^(?=#+ )", text)
    found, depth = [], 0
    for section in sections:
        heading, _, _ = section.partition("\n")
        level = len(heading) - len(heading.lstrip("#"))
        if not 0 < depth < level:
            depth = level if name in heading.lower() else 0
        found += [section] if depth else []
    return "".join(found or (rows for section in sections if (rows := _rows(section, name))))


def _rows(section: str, name: str) -> str:
    """The heading of a section, and its rows and items with a name; "" without any."""
    lines = section.splitlines()
    kept = [line for line in lines if name in re.split(r"(?<!\\)\|", line.lower() + "|")[line.startswith("|")]]
    kept = [line for line in kept if line.startswith(("|", "- "))]
    head = [line for line in lines if line.startswith("| --- ")][:1]
    table = (
        lines[lines.index(head[0]) - 1 : lines.index(head[0]) + 1] if head and kept[:1] and kept[0][0] == "|" else []
    )
    return "\n".join([*(line for line in lines[:1] if line.startswith("#")), "", *table, *kept, "", ""]) if kept else ""
