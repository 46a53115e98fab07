"""What a kind is given of data, and what it gives back: fits and traces, to print, to keep and to report."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import IO, TYPE_CHECKING, Any, Protocol

from fitter.trace.outcome import Outcome
from procedures.blocks import Block
from procedures.settings import Strict
from procedures.table import Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Options(Strict):
    """Options of a command that one kind has. A field's description is its help; its default is "not given"."""


class Source(Protocol):
    """A run file, or a CSV file, not yet read."""

    @property
    def name(self) -> str:
        """For messages."""

    @property
    def table(self) -> Table:
        """All of it, every column numbers. Raises an error of usage where it is no such table."""

    def read(self, needed: Collection[str]) -> Table:
        """A CSV table of anything, of which these columns are needed."""


@dataclass(frozen=True)
class Page:
    """A report: a template of a kind's package and what it is filled with.

    Attributes:
        package: that has the template in its folder `templates`.
        template: file name.
        table: where the data come from.
        span_s: from the first observation to the last; 0 where it does not matter.
        unused: columns and rows that play no part, as `Unused.to_json`.
        contents: values of the template.

    """

    package: str
    template: str
    table: Table
    span_s: float
    unused: Mapping[str, Any]
    contents: Mapping[str, Any] = field(default_factory=dict)

    @property
    def figures(self) -> tuple[Figure, ...]:
        """Its plots, in the order of its contents."""
        from matplotlib.figure import Figure  # noqa: PLC0415 - pages alone have plots

        def of(value: Any) -> Iterator[Figure]:
            if isinstance(value, Figure):
                yield value
            elif isinstance(value, Mapping):
                for one in value.values():
                    yield from of(one)
            elif isinstance(value, (list, tuple)):
                for one in value:
                    yield from of(one)

        return tuple(of(self.contents))


class Fitted(Protocol):
    """A calibration."""

    def to_json(self) -> dict[str, Any]:
        """What `rig fit --json` prints and `--out` keeps."""

    def blocks(self) -> Iterable[Block]:
        """What a person reads of it."""

    def page(self) -> Page | None:
        """Its report; None where it has none."""


@dataclass(frozen=True)
class PlainFitted:
    """A calibration, ready for JSON, that has no report but its trace's."""

    result: dict[str, Any]

    def to_json(self) -> dict[str, Any]:
        """What `rig fit --json` prints."""
        return self.result

    def page(self) -> None:
        """It has none."""


class Traced(Protocol):
    """A table and what was traced in it."""

    @property
    def table(self) -> Table:
        """Where the data come from."""

    @property
    def outcomes(self) -> Sequence[Outcome]:
        """One a sensor."""

    def to_json(self) -> dict[str, Any]:
        """What `rig trace --json` prints."""

    def blocks(self) -> Iterable[Block]:
        """What a person reads of it."""

    def summary(self) -> Iterable[Block]:
        """The same in short, where there are many sensors."""

    def page(self) -> Page:
        """Its report."""


class Compared(Protocol):
    """Designs side by side."""

    def to_json(self) -> dict[str, Any]:
        """What `rig plan --compare --json` prints, without files; "designs" in the order given."""

    def blocks(self) -> Iterable[Block]:
        """What a person reads of it."""

    def draw(self, file: IO[bytes]) -> None:
        """Precision over the range of use, as PNG."""
