"""Keys of files and options of instruments, from the models that check them."""

from __future__ import annotations

import json
import types
import typing
from collections.abc import Iterator, Mapping, Set
from enum import Enum
from typing import Any

from annotated_types import Ge, Gt, Le, Lt
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from rig.bench.config import BenchConfig
from rig.bench.plugins import driver_class, drivers
from rig.contracts.declared.exchanges import Check, Tell
from rig.contracts.declared.instrument import Instrument
from rig.contracts.declared.roles import Channel, Mark, Reader, Source
from rig.contracts.declared.scan import Group, Scan, Sort
from rig.contracts.declared.sums import Checksum
from rig.contracts.declared.wire import Errors, Wire
from rig.lab import People
from rig.procedures.kinds import kinds
from rig.register import Register
from rig.verbs.certificate.settings import CertificateSettings


def bench() -> str:
    """Keys of `bench.toml`."""
    return _joined("## bench.toml", *_tables(BenchConfig, "", {}))


def equipment() -> str:
    """Keys of `equipment.toml`."""
    return _joined("## equipment.toml", *_tables(Register, "", {}))


def certificate() -> str:
    """Keys of `certificate.toml`."""
    return _joined("## certificate.toml", *_tables(CertificateSettings, "", {}))


def people() -> str:
    """Keys of `people.toml`."""
    return _joined("## people.toml", *_tables(People, "", {}))


def procedure() -> str:
    """Keys of `procedure.toml` of every kind."""
    seen: Seen = {}
    parts = []
    for name, kind in kinds().items():
        if kind.settings is not None:
            parts += [f'## procedure.toml, `kind = "{name}"`', *_tables(kind.settings, "", seen)]
            seen.update({path: (kind_of or name, rows) for path, (kind_of, rows) in seen.items()})
    return _joined(*parts)


def instruments() -> str:
    """Options of every driver, in Python or a file."""
    return _joined(*(f"## `{name}`\n\n{options(name)}" for name in drivers()))


def instrument_file() -> str:
    """Keys of the file of an instrument, and of its questions and commands."""
    found = ["## An instrument's file"]
    for title, model in _OF_INSTRUMENTS.items():
        doc = " ".join((model.__doc__ or "").split("Attributes:")[0].split())
        found.append(f"### {title}\n\n{doc}\n\n" + "\n".join(_rows(model, inner=True)))
    return _joined(*found)


_OF_INSTRUMENTS: Mapping[str, type[BaseModel]] = {
    "The whole": Instrument,
    "`[wire]`": Wire,
    "`[wire.checksum]`": Checksum,
    "`[errors]`": Errors,
    "`[mark]`": Mark,
    "`[reader]`": Reader,
    "`[reader.channels.NAME]`": Channel,
    "`[source]`": Source,
    "`[scan]`": Scan,
    "`[scan.sorts.NAME]`": Sort,
    "`[[scan.groups]]`": Group,
    "A question; `is` and `why` are for settings": Check,
    "A command": Tell,
}


def _joined(*parts: str) -> str:
    return "\n\n".join(parts) + "\n"


def options(driver: str) -> str:
    """Table of the options of a driver, by the name of its plug-in."""
    found = driver_class(driver)
    return "\n".join(_rows(found.Options, supplied={one.option for one in found.contracts}))


Seen = dict[str, tuple[str, dict[str, str]]]
"""Rows of a table that a file of an earlier kind has, by key, and that kind, by the table's path."""


def _tables(
    model: type[BaseModel], path: str, seen: Seen, given: object = None, *, several: bool = False
) -> Iterator[str]:
    """Text and table of a model and of its inner models; `given` is the value if the file has none, `several`
    whether the file may have several of these tables. Rows that are as in an earlier kind are only named.
    """
    doc = (model.__doc__ or "").strip().splitlines()
    name = f"[[{path}]]" if several else f"[{path}]"
    title = f"### `{name}`" if path else ""
    yield "\n\n".join(part for part in (title, *(line.strip() for line in doc if line.strip())) if part)
    if any(not _inner(field) for field in model.model_fields.values()):
        yield _table(model, path, seen, given)
    for name, field in model.model_fields.items():
        inner = _inner(field)
        if inner is not None:
            below = f"{path}.{name}" if path else name
            default = None if field.is_required() else field.get_default(call_default_factory=True)
            several = typing.get_origin(field.annotation) is tuple
            below = f"{below}.NAME" if _is_mapping(field) else below
            yield from _tables(inner, below, seen, default, several=several)


def _table(model: type[BaseModel], path: str, seen: Seen, given: object) -> str:
    """Keys of a model: those of their own in a table, and the names of those that an earlier kind has."""
    head, rule, *rows = _rows(model, given)
    keyed = dict(zip((name for name, field in model.model_fields.items() if not _inner(field)), rows, strict=True))
    kind, before = seen.setdefault(path, ("", keyed))
    same = [name for name, row in keyed.items() if kind and before.get(name) == row]
    own = [row for name, row in keyed.items() if name not in same]
    also = f'As with `kind = "{kind}"`: {", ".join(f"`{name}`" for name in same)}.' if same else ""
    return "\n\n".join(part for part in ("\n".join([head, rule, *own]) if own else "", also) if part)


def _rows(
    model: type[BaseModel], given: object = None, supplied: Set[str] = frozenset(), *, inner: bool = False
) -> list[str]:
    """Lines of a table; keys `supplied` with a file of ours have a default that the model does not know. Keys with
    models are in it if `inner`.
    """
    rows = ["| key | value | default | meaning |", "| --- | --- | --- | --- |"]
    for name, field in model.model_fields.items():
        if inner or _inner(field) is None:
            default = "the supplied one" if name in supplied else _default(name, field, given)
            rows.append(f"| `{field.alias or name}` | {_type(field)} | {default} | {field.description or ''} |")
    return rows


def _inner(field: FieldInfo) -> type[BaseModel] | None:
    """The model of a field, alone, optional, or as the values of a table."""
    for candidate in (field.annotation, *typing.get_args(field.annotation)):
        if isinstance(candidate, type) and issubclass(candidate, BaseModel):
            return candidate
    return None


def _is_mapping(field: FieldInfo) -> bool:
    return typing.get_origin(field.annotation) is dict


def _type(field: FieldInfo) -> str:
    """Kind of a value and its limits: "number 0 to 10", "number above 0, to 1e+06"."""
    above, least, below, most = (_bounds(field, kind) for kind in (Gt, Ge, Lt, Le))
    name = _name(field.annotation)
    if least and most and not (above or below):
        return f"{name} {max(least):g} to {min(most):g}"
    limits = [f"above {max(above):g}" if above else "", f"from {max(least):g}" if least else ""]
    limits += [f"below {min(below):g}" if below else "", f"to {min(most):g}" if most else ""]
    return f"{name} {', '.join(filter(None, limits))}".strip()


def _bounds(field: FieldInfo, kind: type[Gt | Ge | Lt | Le]) -> list[Any]:
    """Limits of one sort; each of these classes has one field, the limit."""
    return [getattr(item, kind.__name__.lower()) for item in field.metadata if isinstance(item, kind)]


_NAMES = {"str": "text", "int": "whole number", "float": "number", "bool": "true or false", "date": "date"}
_NAMES |= {"Ask": "question", "Identity": "question", "Check": "question with its right answer", "Tell": "command"}
_NAMES |= dict.fromkeys(("Wire", "Checksum", "Errors", "Mark", "Reader", "Source", "Channel"), "table")


def _name(annotation: object) -> str:
    origin, arguments = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is typing.Literal:
        return " or ".join(f"`{a!r}`".replace("'", '"') for a in arguments)
    if origin in (typing.Union, types.UnionType):
        return " or ".join(_name(a) for a in arguments if a is not type(None))
    if origin in (list, tuple):
        inner = [_name(a) for a in arguments if a is not Ellipsis]
        return f"[{', '.join(inner)}]" if origin is tuple else f"list of {inner[0].removesuffix('s')}s"
    if origin is dict:
        return f"table of {_name(arguments[1])}"
    if origin is typing.Annotated:
        return _name(arguments[0])
    name = getattr(annotation, "__name__", str(annotation))
    return _NAMES.get(name, name)


def _default(name: str, field: FieldInfo, given: object) -> str:
    if isinstance(given, BaseModel):
        value = getattr(given, name)
    elif field.is_required():
        return "required"
    else:
        value = field.get_default(call_default_factory=True)
    if value is None or value in ("", {}, ()) or isinstance(value, BaseModel):
        return ""
    if isinstance(value, Enum):
        value = value.value
    if isinstance(value, dict):
        return ", ".join(f"`{k}`: `{v}`" for k, v in value.items())
    return f"`{json.dumps(value) if isinstance(value, str | bool) else value}`"
