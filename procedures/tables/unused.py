"""Unused parts of a table: they are named, so that nothing is dropped silently."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from rig.procedures.column_names import spelled, split_unit
from rig.procedures.tables.file_rows import rows_in_words

if TYPE_CHECKING:
    from rig.procedures.tables.table import Table

NO_PART = "plays no part"
TEXT = "holds text"
RECORDED = "recorded beside the readings; plays no part"
_UNITS = {
    "V",
    "mV",
    "uV",
    "kV",
    "A",
    "mA",
    "uA",
    "psia",
    "psig",
    "psi",
    "Pa",
    "hPa",
    "kPa",
    "bar",
    "mbar",
    "degC",
    "degF",
}
_UNITS |= {"K", "deg", "rad", "N", "kN", "m", "mm", "um", "Hz", "kHz", "ohm", "s", "ms", "min", "h", "pct", "g"}
"""Ends of column names that are units."""


@dataclass(frozen=True)
class Unused:
    """Unused columns and rows.

    Attributes:
        columns: reason by name.
        rows: (row in the file or None for several of a run, column or "", reason) each.
    """

    columns: Mapping[str, str] = field(default_factory=dict)
    rows: Sequence[tuple[int | None, str, str]] = ()

    def to_json(self) -> dict[str, Any]:
        """JSON values."""
        return {
            "columns": [{"column": name, "why": why} for name, why in self.columns.items()],
            "rows": [{"row": row, "column": column or None, "why": why} for row, column, why in self.rows],
        }


def other_unit(name: str, known: Collection[str]) -> str | None:
    """The known column that differs from this one only in its unit, or in capitals; None if there is none."""
    stem = _stem(name)
    for other in known:
        if name != other and (name.casefold() == other.casefold() or stem.casefold() == _stem(other).casefold()):
            return other
    return None


def known_unit_of(name: str) -> str:
    """The unit at the end of a column's name; "" if the name ends in no known unit."""
    return name[len(_stem(name)) + 1 :]


def unit_after(name: str) -> str:
    """The unit of a column as it stands after a number, with a space before it; "" if there is none."""
    unit = known_unit_of(name)
    return f" {spelled(unit)}" if unit else ""


def _stem(name: str) -> str:
    stem, unit = split_unit(name)
    return stem if stem and (unit in _UNITS or "_per_" in unit) else name


def why_unused(name: str, known: Collection[str], use: str = "calibrated as") -> str:
    """Reason why an unknown column is not used."""
    other = other_unit(name, known)
    return NO_PART if other is None else f"{use} {other}: rename it, and convert its values if the unit is another"


def unused_in_fit(table: Table, known: Collection[str], unit: str) -> Unused:
    """Columns that fits and traces of a kind do not use.

    Args:
        table: the table as read.
        known: columns that this kind of table has, or may have.
        unit: of its outputs.
    """
    named = {*known, "simulated"}
    found = {}
    for name in table.names:
        if name in named or name.endswith(f"_{unit}"):
            continue
        stem, other = split_unit(name)
        if other in ("V", "mV", "uV", "kV"):
            found[name] = f"outputs are read in {unit}: convert it and name it {stem}_{unit}"
        elif name in ("run_index", "accepted", "pressure_side") or stem.endswith(("_readback", "_since")):
            found[name] = RECORDED
        else:
            found[name] = why_unused(name, named, "columns of this kind have")
    rejected = table.provenance.get("observations_rejected", 0)
    why = f"{rejected} observations were rejected when they were made; rig export --all writes them"
    return Unused(found, [(None, "", why)] if rejected else ())


def unused_columns(table: Table, used: Iterable[str], reasons: Mapping[str, str] | None = None) -> Unused:
    """Columns of a table of any kind that are not among the used ones.

    Args:
        table: the table as read.
        used: names of used columns.
        reasons: special reasons for others.
    """
    taken, found = set(used), {}
    for name in table.names:
        if name in table.gaps:
            found[name] = f"a value is missing (row {table.gaps[name]})"
        elif name not in taken:
            found[name] = (reasons or {}).get(name, NO_PART)
    return Unused(found)


def sentences(unused: Mapping[str, Any]) -> list[str]:
    """The values of `Unused.to_json` in words; except readbacks, and text, which are in the notes."""
    told = [each for each in unused["columns"] if each["why"] not in (RECORDED, TEXT)]
    plain = [each["column"] for each in told if each["why"] == NO_PART]
    found = [f"not used: {', '.join(plain)}"] if plain else []
    found += [f"{each['column']} is not used: {each['why']}" for each in told if each["why"] != NO_PART]
    found += [each["why"] for each in unused["rows"] if each["row"] is None]
    by_reason: dict[tuple[str | None, str], list[int]] = {}
    for each in (one for one in unused["rows"] if one["row"] is not None):
        by_reason.setdefault((each["column"], each["why"]), []).append(each["row"])
    for (column, why), rows in by_reason.items():
        found.append(f"{rows_in_words(rows)}{f', column {column}' if column else ''}: {why}")
    return found
