"""Installed kinds of calibration, by name: ours and those of other packages."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from importlib.metadata import EntryPoint
from typing import TYPE_CHECKING

from rig.procedures.entry_points import entry_points
from rig.procedures.errors import BrokenKind, DataError
from rig.procedures.kind import Kind, Procedure

if TYPE_CHECKING:
    from rig.procedures.tables.table import Table

GROUP = "rig.kinds"


@cache
def kinds() -> Kinds:
    """Every installed kind, by name, ours first. Raises `BrokenKind`: two packages have one of the same name."""
    return Kinds(entry_points(GROUP))


class Kinds(Mapping[str, Kind]):
    """Kinds by name. Each is imported at its first use: a command mostly needs one of them.

    Looking one up raises `BrokenKind` if its entry point cannot be loaded, or is not a kind.
    """

    def __init__(self, points: Iterable[EntryPoint]) -> None:
        self._points: dict[str, EntryPoint] = {}
        self._loaded: dict[str, Kind] = {}
        once = {point.value: point for point in points}  # one package may be found on two paths
        for point in sorted(once.values(), key=lambda p: (not p.value.startswith("procedures."), p.name)):
            if point.name in self._points:
                raise BrokenKind(
                    f"two packages have a kind of calibration {point.name!r}: remove one of them{_whose(point)}"
                )
            self._points[point.name] = point

    def __getitem__(self, name: str) -> Kind:
        if name not in self._loaded:
            self._loaded[name] = _loaded(self._points[name])
        return self._loaded[name]

    def __contains__(self, name: object) -> bool:
        return name in self._points

    def __iter__(self) -> Iterator[str]:
        return iter(self._points)

    def __len__(self) -> int:
        return len(self._points)


def _loaded(point: EntryPoint) -> Kind:
    try:
        kind = point.load()
    except Exception as error:
        why = f"{type(error).__name__}: {error}"
        raise BrokenKind(f"the kind of calibration {point.name!r} cannot be used: {why}{_whose(point)}") from error
    if not isinstance(kind, Kind):
        raise BrokenKind(f"{point.value} is no kind of calibration, which its package calls it{_whose(point)}")
    return kind


def _whose(point: EntryPoint) -> str:
    """The package of an entry point, for the end of a message."""
    return "" if point.dist is None else f" (package {point.dist.name} {point.dist.version})"


def kind_of(procedure: Procedure) -> Kind:
    """The kind of a procedure."""
    return kinds()[procedure.kind]


def kind_of_table(table: Table) -> Kind | None:
    """The kind declared by a table, or the one that matches its columns; None if no kind does.

    Raises:
        DataError: several kinds match the columns, or the declared kind is not installed.
    """
    if table.kind:
        if table.kind not in kinds():
            names = ", ".join(kinds())
            raise DataError(f"{table.source} is of kind {table.kind!r:.80}, which is not installed; there are {names}")
        return kinds()[table.kind]
    found = [kind for kind in kinds().values() if kind.recognises(table.columns.keys())]
    if len(found) > 1:
        what = " and of ".join(kind.title for kind in found)
        raise DataError(f"{table.source} has columns of {what}: leave out those of one ({found[0].described})")
    return found[0] if found else None
