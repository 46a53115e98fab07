"""Inputs and results of a kind: fits and traces, to print, to store and to report."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import IO, TYPE_CHECKING, Any, ClassVar, Protocol

from rig.procedures.plan.settings import Strict

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from rig.fitter.trace.outcome import Outcome
    from rig.procedures.present.blocks import Block
    from rig.procedures.tables.table import Table


QUICK = "without the left-out error, which takes most of the time; same effects and sizes"
"""Help of the option `quick` of a trace."""


class Options(Strict):
    """Options of a command that one kind has. A field's description is its help; its default is "not given".

    Attributes:
        doubts_by_left_out: whether a trace doubts names by the left-out error, so that `quick` knows fewer doubts.
    """

    doubts_by_left_out: ClassVar[bool] = False


class Source(Protocol):
    """A run file, or a CSV file, not yet read."""

    @property
    def name(self) -> str:
        """For messages."""

    @property
    def is_run(self) -> bool:
        """Whether it is a run of a bench, or a table of one."""

    @property
    def table(self) -> Table:
        """The whole table, every column numeric. Raises an error of usage if it is not such a table."""

    def read(self, needed: Collection[str]) -> Table:
        """A CSV table with any columns; these are required."""


@dataclass(frozen=True)
class Page:
    """A report: a template of a kind's package and its values.

    Attributes:
        package: package with the template in its folder `templates`.
        template: file name.
        table: source of the data.
        span_s: seconds from the first observation to the last; 0 if irrelevant.
        unused: unused columns and rows, from `Unused.to_json`.
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
        """JSON values for `rig fit --json` and `--out`."""

    def blocks(self) -> Iterable[Block]:
        """Blocks for people."""

    def page(self) -> Page | None:
        """Its report; None if it has none."""


@dataclass(frozen=True)
class PlainFitted:
    """A calibration, ready for JSON, that has no report but its trace's."""

    result: dict[str, Any]

    def to_json(self) -> dict[str, Any]:
        """The JSON of `rig fit --json`."""
        return self.result

    def page(self) -> None:
        """It has none."""


class Traced(Protocol):
    """A table and its trace."""

    @property
    def table(self) -> Table:
        """Source of the data."""

    @property
    def outcomes(self) -> Sequence[Outcome]:
        """One outcome per sensor."""

    def to_json(self) -> dict[str, Any]:
        """JSON values for `rig trace --json`."""

    def blocks(self) -> Iterable[Block]:
        """Blocks for people."""

    def page(self) -> Page:
        """Its report."""


class Compared(Protocol):
    """Designs side by side."""

    def to_json(self) -> dict[str, Any]:
        """JSON values for `rig plan --compare --json`, without files; "designs" in the given order."""

    def blocks(self) -> Iterable[Block]:
        """Blocks for people."""

    def draw(self, file: IO[bytes]) -> None:
        """Precision over the range of use, as PNG."""
