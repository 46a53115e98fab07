"""Common methods of all results: JSON, HTML, text, figures, data frames."""

from __future__ import annotations

import io
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.markup import escape

from rig.procedures.present.as_json import finite
from rig.procedures.present.blocks import Block, Line
from rig.procedures.present.html import html
from rig.procedures.present.terminal import show
from rig.procedures.present.visible import visible

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame
    from xarray import Dataset

    from rig.procedures.evaluate.results import Page
    from rig.verbs.frames import Frame

_WIDTH = 120


class Plots(tuple["Figure", ...]):
    """Figures, shown by a notebook below one another."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        from rig.procedures.present.pictures import png  # noqa: PLC0415 - matplotlib takes a second to import

        return "".join(f'<img src="data:image/png;base64,{png(figure)}">' for figure in self)


class Result(ABC):
    """A result: the output of a command, as an object.

    Example:
        >>> line = rig.open("cell.csv").fit(response="y_V", formula="1 + x_mm")
        >>> "y_V" in str(line)
        True
    """

    def to_json(self) -> dict[str, Any]:
        """The JSON of the command with `--json`, as dictionaries, lists, text, numbers, None.

        Example:
            >>> line = rig.open("cell.csv").fit(response="y_V", formula="1 + x_mm")
            >>> sorted(line.to_json()["coefficients"])
            ['1', 'x_mm']
        """
        found: dict[str, Any] = finite(self._told)
        return found

    @property
    @abstractmethod
    def _told(self) -> Mapping[str, Any]:
        """The result as JSON values, with NaN and infinity as they are."""

    @abstractmethod
    def blocks(self) -> Iterable[Block]:
        """Blocks for people, for a terminal or a page."""

    def notes(self) -> Sequence[str]:
        """Notes for readers, one sentence each."""
        return ()

    @abstractmethod
    def frame(self) -> Frame:
        """Its numbers as one table."""

    @abstractmethod
    def plot(self) -> Plots:
        """Matplotlib figures, shown by a notebook. Raises `UsageError` if there are none."""

    def to_pandas(self) -> DataFrame:
        """Its numbers as a data frame; `attrs["units"]` has the units by column. Raises `UsageError` without pandas.

        Example:
            >>> rig.open("cell.csv").table.to_pandas().attrs["units"]["x_mm"]
            'mm'
        """
        return self.frame().to_pandas()

    def to_xarray(self) -> Dataset:
        """Its numbers as labelled arrays, with `attrs["units"]` each. Raises `UsageError` without xarray.

        Example:
            >>> rig.open("cell.csv").table.to_xarray()["x_mm"].attrs
            {'units': 'mm'}
        """
        return self.frame().to_xarray()

    def _repr_html_(self) -> str:
        return html(self._said())

    def __str__(self) -> str:
        console = Console(file=io.StringIO(), width=_WIDTH, highlight=False, emoji=False, color_system=None)
        with console.capture() as said:
            show(self._said(), console)
        return visible(said.get())

    def _said(self) -> Iterator[Block]:
        yield from self.blocks()
        yield from (Line(f"[yellow]{escape(note)}[/]") for note in self.notes())

    def __repr__(self) -> str:
        return f"<rig.{type(self).__name__}>"


class Reported(Result):
    """A result that has a report."""

    @property
    @abstractmethod
    def _page(self) -> Page:
        """Its report, with figures. Raises `UsageError` if it has none."""

    def plot(self) -> Plots:
        """The figures of its report. Raises `UsageError` if it has none."""
        return Plots(self._page.figures)

    def report(self, path: Path | str) -> None:
        """Write its report as self-contained HTML. Raises `UsageError` if it has none.

        Example:
            >>> rig.open("cell.csv").trace(response="y_V", formula="1 + x_mm").report("trace.html")
        """
        from rig.verbs.write_page import write_page  # noqa: PLC0415 - templates are needed for reports alone

        write_page(Path(path), self._page)
