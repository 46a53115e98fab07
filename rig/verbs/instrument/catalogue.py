"""The list of instruments, and the page of one: made from its file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import cast

from rig.bench.config import read_text
from rig.bench.contract_files import with_hook
from rig.bench.plugins import declared, driver_class, installed, is_file, text_of
from rig.contracts.declared.exchanges import Ask, Tell
from rig.contracts.declared.instrument import Instrument, parse
from rig.drivers.roles import ByHand, Chamber, Head, PressureController, Reader, Source
from rig.errors import ConfigurationError, UsageError
from rig.procedures.present.markdown import table as markdown_table

_ROLES: Mapping[str, type] = {
    "head": Head,
    "reader": Reader,
    "chamber": Chamber,
    "pressure": PressureController,
    "source": Source,
    "person": ByHand,
}


def listed() -> list[dict[str, str]]:
    """Every instrument: driver name, what it is, roles, wire, how it was tried."""
    rows = []
    for name in installed("rig.drivers"):
        found = driver_class(name)
        roles = [role for role, protocol in _ROLES.items() if issubclass(cast(type, found), protocol)]
        rows.append(
            {"driver": name, "is": "in Python", "roles": ", ".join(roles), "wire": found.wire, "tried": "see its page"}
        )
    for name, text in declared().items():
        table = parse(text)
        rows.append(
            {
                "driver": name,
                "is": f"{_named(table)}: {table.about}",
                "roles": ", ".join(role for role in ("reader", "source") if getattr(table, role) is not None),
                "wire": table.wire.protocol,
                "tried": ", ".join(table.tried) or "never",
            }
        )
    return sorted(rows, key=lambda row: row["driver"])


def text_named(name: str) -> tuple[str, str]:
    """The text of an instrument's file, by driver name or path, and where it is from.

    Raises:
        ConfigurationError: the file cannot be read, or is wrong.
        UsageError: no declared instrument has this name.
    """
    text = f"{with_hook(read_text(Path(name), 'instrument'), Path(name))}\n" if is_file(name) else text_of(name)
    if not text:
        raise UsageError(f"{name} is no file and no declared instrument; these are: {', '.join(declared())}")
    try:
        driver_class(text)
    except ConfigurationError as error:
        raise ConfigurationError(f"{name}: {error}") from None
    return text, name


def page(name: str) -> str:
    """The page of a declared instrument, Markdown: what it is, what is sent, what is asked, sources.

    Raises:
        ConfigurationError, UsageError: see `text_named`.
    """
    text, _ = text_named(name)
    return "\n".join(_page(name, parse(text)))


def reference() -> str:
    """The pages of all declared instruments of installed packages, Markdown."""
    return "\n".join(page(name) for name in declared())


def _named(table: Instrument) -> str:
    return f"{table.maker} {', '.join(table.model)}".strip()


def _page(name: str, table: Instrument) -> Iterator[str]:
    yield f"## `{name}`\n"
    roles = " and ".join(role for role in ("reader", "source") if getattr(table, role) is not None)
    yield f"{_named(table)}: {table.about}. It is a {roles}.\n"
    tried = ", ".join(table.tried)
    yield f"Tried: {tried or 'no'}{'' if 'on hardware' in table.tried else '; never on hardware'}.\n"
    yield from (f"Not confirmed: {one}.\n" for one in table.unconfirmed)
    wire = table.wire
    if table.bridge:
        yield f"Reached by {table.bridge}: questions are its attributes, commands set them.\n"
    elif table.can:
        yield "CAN; questions are signals of its DBC, commands are messages.\n"
    elif table.modbus:
        yield f"Modbus; {wire.type} unless said otherwise, {wire.word_order} word first.\n"
    else:
        ends = f"lines end with {wire.send_end!r}, answers with {wire.reply_end or wire.send_end!r}"
        dropped = " while DTR is dropped" * wire.clear_drops_dtr
        ends += f"; device clear is {wire.clear!r}{dropped}" if wire.clear else ""
        yield f"{'Stream' if wire.protocol == 'stream' else 'Text'}; {wire.baud} baud {wire.frame}; {ends}.\n"
    every: list[tuple[str, Ask | Tell]] = [*table.asks(), *table.tells()]
    rows = [(place, f"`{_shown(one)}`", _meaning(table, one)) for place, one in every]
    yield markdown_table(("in its file", "is sent", "answer, or meaning"), rows)
    yield from (f"Source: {one}.\n" for one in table.sources)


def _shown(one: Ask | Tell) -> str:
    line = one.ask if isinstance(one, Ask) else one.tell
    if line is not None:
        return line
    if one.register_ is None:
        return ""
    value = "" if isinstance(one, Ask) else f" = {'value' if one.value is None else f'{one.value}'}"
    return f"{one.table} {one.register_}{value}"


def _meaning(table: Instrument, one: Ask | Tell) -> str:
    said: str
    if table.modbus:
        said = one.type or ""
    elif table.can and isinstance(one, Ask):
        said = f"counts as `{one.status}` says" if one.status is not None else ""
    else:
        said = ", ".join(f"`{form}`" for form in (one.forms if isinstance(one, Ask) else one.answer))
    scale = f"times {one.scale:g}" if one.scale != 1.0 else ""
    right = f"has to be {one.is_}" if getattr(one, "is_", None) is not None else ""  # type: ignore[union-attr]  # of a check
    words = ", ".join(f"{word} is {meaning}" for word, meaning in one.words.items()) if isinstance(one, Ask) else ""
    bit = f"bit {one.bit}" if isinstance(one, Ask) and one.bit is not None else ""
    return "; ".join(filter(None, (said, scale, bit, words, right)))
