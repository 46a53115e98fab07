"""`rig fit FILE` and `rig trace FILE` of an unknown table: its columns, and the next command."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from rich.markup import escape

from rig.by_kind import known
from rig.errors import UsageError
from rig.procedures.kinds import kinds
from rig.procedures.present.blocks import Block, Grid, Line
from rig.tables import FileSource, is_run
from rig.units.in_tables import unit_in

if TYPE_CHECKING:
    from rig.procedures.tables.table import Table
    from rig.procedures.tables.unknown_table import UnknownTable


class SeenTable:
    """A table, the likely roles of its columns, and the command to run next.

    Attributes:
        seen: as a kind sees it.
        table: with NaN for missing values.
        command: to run next; "" if there is none.
    """

    def __init__(self, seen: UnknownTable, table: Table, source: FileSource, command: str) -> None:
        self.seen = seen
        self.table = table
        self._of = command
        options = seen.fit if command == "fit" else seen.trace
        asked = source.asked.words()
        parts: list[str] = []
        for option, value in options.items():
            flag = f"--{option.replace('_', '-')}"
            parts += [f"{flag}={value}"] if value.startswith("-") else [flag, value]
        name = f"./{source.name}" if source.name.startswith("-") else source.name
        self.command = shlex.join(["rig", command, name, *asked, *parts]) if options else ""

    def to_json(self) -> dict[str, Any]:
        """JSON values for `--json`."""
        columns = [
            {"column": one.name, "unit": self._unit(one.name), "role": one.role, "values": one.values,
             "missing": one.missing}
            for one in self.seen.columns
        ]  # fmt: skip
        data = {"file": self.table.provenance["file"], "points": len(self.table), "kind": None}
        if self.table.understood:
            data["understood"] = self.table.understood
        seen = self.seen
        told = {"next": self.command or None, "why_not": seen.why_not or None, "curve": seen.curve or None}
        return {"data": data, "columns": columns, **told, "responses": list(seen.responses), "notes": list(seen.notes)}

    def blocks(self) -> Iterable[Block]:
        """Lines for people."""
        yield Line(f"[bold]{escape(self.table.provenance['file'])}[/]: {len(self.table)} rows")
        grid = Grid(("column", "unit", "likely role", "values", "missing"))
        for one in self.seen.columns[:_SHOWN]:
            missing = str(one.missing) if one.missing else ""
            grid.add_row(escape(one.name), escape(self._unit(one.name)), one.role, escape(one.values), missing)
        yield grid
        if len(self.seen.columns) > _SHOWN:
            yield Line(f"and {len(self.seen.columns) - _SHOWN} more columns")
        if self.command:
            yield Line("Roles are a proposal by names and values. Nothing was fitted. A command to begin with:")
            yield Line(f"  {escape(self.command)}")
            direction = self.seen.trace.get("direction", "")
            if self._of == "fit" and "=" in direction:  # two words that only a person knows for sure
                words = f"{direction.rpartition('=')[0]} looks like the side of approach; rig trace takes it by"
                yield Line(
                    escape(f"{words} --direction {shlex.quote(direction)}, the upward word first."), wrapped=True
                )
            if self.seen.curve:
                yield Line(escape(self.seen.curve), wrapped=True)
            if others := self.seen.responses[1:]:
                more = f"{', '.join(others[:_NAMED])}{', ...' if len(others) > _NAMED else ''}"
                swap = f", and {self.seen.responses[0]} after --ignore in its place" if self._of == "trace" else ""
                words = f"Other outputs of this sort: {more}. For each, the same with its name after --response{swap}."
                yield Line(escape(words), wrapped=True)
            for note in self.seen.notes:
                yield Line(escape(note), wrapped=True)
            if self.seen.why_not and self._of == "trace":
                yield Line(f"Time is left out of it: {escape(self.seen.why_not)}", wrapped=True)
        else:
            yield Line(f"There is nothing to propose: {escape(self.seen.why_not)}", wrapped=True)

    def _unit(self, name: str) -> str:
        return self.table.units.get(name, "") or unit_in(name)


_SHOWN, _NAMED = 40, 12


def look_at(source: FileSource, command: str, given: Mapping[str, Any]) -> SeenTable | None:
    """Description of a table that no kind recognises and no option describes; None for any other.

    Raises:
        UsageError: the file can be read in several ways.
    """
    if given or is_run(source.path):
        return None
    try:
        known(source.table)
    except UsageError:
        pass
    else:
        return None
    table = source.all_columns()
    if any(kind.recognises(table.names) for kind in kinds().values()):
        return None
    for kind in kinds().values():
        seen = kind.look(source, table)
        if seen is not None:
            return SeenTable(seen, table, source, command)
    return None
