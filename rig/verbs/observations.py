"""Tables of observations of a run or a CSV file."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Collection, Iterable, Mapping
from pathlib import PurePath
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.markup import escape

from rig.fitter.rounding import with_error
from rig.procedures.present.blocks import Block, Grid, Line, headline
from rig.procedures.present.numbers import number
from rig.procedures.tables.unused import known_unit_of
from rig.verbs.frames import Frame, of_columns
from rig.verbs.result import Plots, Result

if TYPE_CHECKING:
    from rig.procedures.tables.table import Table

_SHOWN = 10
_TIME = "elapsed_s"


class Columned(Result):
    """Columns by name, one row an observation."""

    @property
    @abstractmethod
    def columns(self) -> Mapping[str, np.ndarray[Any, Any]]:
        """(n,) values by column name."""

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def __getitem__(self, name: str) -> np.ndarray[Any, Any]:
        """(n,) values of a column. Raises `KeyError`."""
        return self.columns[name]

    def _first_rows(self, names: Collection[str], errors: Mapping[str, str] | None = None) -> Iterable[Block]:
        """A table of the first rows of these columns, and how many more there are.

        Args:
            names: of the columns.
            errors: columns whose values determine the digits of others, by their names.
        """
        grid, columns = Grid([escape(name) for name in names], frame="rule"), self.columns
        for i in range(min(_SHOWN, len(self))):
            sds = {name: float(columns[sd][i]) for name, sd in (errors or {}).items()}
            grid.add_row(*(_cell(columns[name][i], sds.get(name)) for name in names))
        yield grid
        if len(self) > _SHOWN:
            yield Line(f"... {len(self) - _SHOWN} more rows")


class Observations(Columned):
    """A table: columns of numbers and of text, with units in their names.

    Attributes:
        table: the object used by fits and traces.

    Example:
        >>> table = rig.open("cell.csv").table
        >>> len(table), table["x_mm"].max()
        (60, np.float64(5.0))
    """

    def __init__(self, table: Table) -> None:
        self.table = table

    @property
    def columns(self) -> Mapping[str, np.ndarray[Any, Any]]:
        """(n,) values by column name, without columns that have gaps."""
        return {**self.table.columns, **self.table.text}

    @property
    def simulated(self) -> bool:
        """Whether no real instrument was involved, if known."""
        return self.table.simulated

    @property
    def provenance(self) -> Mapping[str, Any]:
        """Provenance of the numbers."""
        return self.table.provenance

    @property
    def _told(self) -> dict[str, Any]:
        """Source and all columns; no command prints this."""
        about = {"source": self.table.source, "simulated": self.simulated, "provenance": dict(self.provenance)}
        return {**about, "columns": {n: v.tolist() for n, v in self.columns.items()}}

    def blocks(self) -> Iterable[Block]:
        """Source and the first rows."""
        yield headline(PurePath(self.table.source).name, self.table)
        yield from self._first_rows(self.columns)

    def frame(self) -> Frame:
        """All columns."""
        return of_columns(self.columns, {"source": self.table.source, "simulated": int(self.simulated)})

    def plot(self) -> Plots:
        """One figure: every column of numbers that varies, in the order of rows, or over time."""
        from rig.procedures.present.pictures import grid  # noqa: PLC0415 - matplotlib takes a second to import

        shown = {n: v for n, v in self.table.columns.items() if n != _TIME and np.ptp(v) > 0}
        time = self.table.columns.get(_TIME)
        x, label = (np.arange(len(self)) + 1, "row") if time is None else (time / 3600.0, "elapsed / h")
        figure, axes = grid(max(len(shown), 1), columns=2, height=2.2)
        for axis, (name, values) in zip(axes, shown.items(), strict=False):
            axis.plot(x, values, ".", ms=3)
            unit = known_unit_of(name)
            axis.set_title(f"{name.removesuffix(f'_{unit}')} / {unit}" if unit else name, fontsize=9)
            axis.set_xlabel(label, fontsize=8)
            axis.tick_params(labelsize=7)
        return Plots((figure,))

    def __repr__(self) -> str:
        return f"<rig.Observations of {self.table.source}: {len(self)} rows, {', '.join(self.columns)}>"


def _cell(value: Any, error: float | None) -> str:
    if error is not None and np.isfinite(error):
        return with_error(float(value), error)[0]
    return escape(str(value)) if isinstance(value, str) else number(float(value), 7)
