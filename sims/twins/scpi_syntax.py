"""SCPI syntax: headers in short and long form, optional nodes, parameters (SCPI-1999, volume 1, section 6).

A command table maps header patterns, in the notation of manuals (`[SENSe:]VOLTage:DC:NPLCycles`), to methods.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any


class ScpiError(Exception):
    """A refused command; `code` goes to the error queue."""

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


@dataclass(frozen=True)
class Command:
    """One row of a command table.

    Attributes:
        header: in the notation of the manual.
        set: method name for the command form, "" if it has none.
        query: method name for the query form, "" if it has none.
        local: allowed in local control.
    """

    header: str
    set: str = ""
    query: str = ""
    local: bool = False


def _forms(header: str) -> list[str]:
    """Every spelling of a header: with and without optional nodes, each node short and long, upper case."""
    if header.startswith("*"):
        return [header]
    nodes = re.findall(r"\[:?([A-Za-z]+\d?):?\]|:?([A-Za-z]+\d?)", header)
    choices = []
    for optional, required in nodes:
        name = optional or required
        short = "".join(c for c in name if not c.islower())
        spellings = list(dict.fromkeys((short, name.upper())))
        choices.append([*spellings, ""] if optional else spellings)
    return [":".join(filter(None, combination)) for combination in itertools.product(*choices)]


def compiled(table: Sequence[Command]) -> dict[str, Command]:
    """Rows of a command table by every spelling of their headers."""
    return {form: row for row in table for form in _forms(row.header)}


_ENCLOSING = re.compile("[\"'()]")


def split_outside(text: str, separator: str) -> list[str]:
    """Split at a separator that is not inside quotes or parentheses."""
    if not _ENCLOSING.search(text):
        return text.split(separator)
    parts, depth, quote, part = [], 0, "", ""
    for c in text:
        if quote:
            quote = "" if c == quote else quote
        elif c in "\"'":
            quote = c
        elif c in "()":
            depth += 1 if c == "(" else -1
        elif c == separator and not depth:
            parts.append(part)
            part = ""
            continue
        part += c
    return [*parts, part]


_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(E[+-]?\d{1,3})?", re.ASCII | re.IGNORECASE)


def number(text: str) -> float:
    """A numeric parameter."""
    if not _NUMBER.fullmatch(text):
        raise ScpiError(-104 if text[:1].isalpha() else -121)
    value = float(text)
    if not abs(value) < 1e38:
        raise ScpiError(-222)
    return value


def boolean(text: str) -> bool:
    """ON, OFF or a number that is rounded."""
    match text.upper():
        case "ON":
            return True
        case "OFF":
            return False
    return round(number(text)) != 0


Methods = tuple[Callable[[Any, str], None], Callable[[Any], str]]
"""A twin's methods that set a setting and ask for it."""


def switch(attribute: str) -> Methods:
    """Methods of a twin for a switch that is one of its attributes: `set_display, ask_display = switch("display")`."""

    def tell(twin: Any, state: str) -> None:
        setattr(twin, attribute, boolean(state))

    def ask(twin: Any) -> str:
        return "1" if getattr(twin, attribute) else "0"

    return tell, ask


def mask(attribute: str, most: int = 0x7FFF) -> Methods:
    """Methods of a twin for a mask of its status system; one of eight bits refuses what is more."""

    def tell(twin: Any, value: str) -> None:
        bits = round(number(value))
        if most == 0xFF and not 0 <= bits <= most:
            raise ScpiError(-222)
        setattr(twin, attribute, bits & most)

    def ask(twin: Any) -> str:
        return f"{getattr(twin, attribute):{twin.integers}}"

    return tell, ask
