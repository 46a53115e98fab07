"""Writing plain values as TOML: the standard library can only read it."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from datetime import date, datetime
from typing import Any


def toml_text(values: Mapping[str, Any]) -> str:
    """The text of a TOML file: tables of tables, texts, numbers, dates, and lists of all of these."""
    return "\n".join(_lines(values, "")) + "\n"


def _lines(table: Mapping[str, Any], path: str) -> Iterator[str]:
    plain = {key: value for key, value in table.items() if not isinstance(value, Mapping)}
    if path and (plain or len(plain) == len(table)):
        yield f"\n[{path}]"
    yield from (f"{_key(key)} = {_value(value)}" for key, value in plain.items())
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from _lines(value, f"{path}.{_key(key)}" if path else _key(key))


def _key(key: str) -> str:
    """A key, bare if TOML permits it."""
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else json.dumps(key)


def _value(value: object) -> str:
    if isinstance(value, (datetime, date)):
        return value.isoformat()
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_value(item) for item in value) + "]"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_key(key)} = {_value(item)}" for key, item in value.items()) + "}"
    if isinstance(value, (bool, int, float, str)):
        return json.dumps(value)  # texts, numbers and booleans are the same as in JSON
    raise TypeError(f"{value!r} cannot be written to a TOML file")
