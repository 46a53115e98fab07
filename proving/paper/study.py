"""The whole study: nights captured, tables, statements, pictures."""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from proving.paper.capture import capture
from proving.paper.checks import checks, ranges
from proving.paper.document import Section, computed_sections, experiment_sections
from proving.paper.experiments import figures_22_to_54
from proving.paper.loci import figures_9_11_12
from proving.paper.nights import NIGHTS
from proving.paper.one_axis import figures_6_to_8
from proving.paper.outputs import figures_1_to_5
from proving.paper.plots import Figure
from proving.paper.statement import Statement
from proving.paper.table_2 import Measured, figure_21
from proving.paper.three_axes import figures_13_to_20
from proving.paper.two_axes import figure_10
from rig.engine.session import Progress

Say = Callable[[str], None]
Watch = Callable[[], AbstractContextManager[Callable[[Progress], None]]]


@dataclass(frozen=True, eq=False)
class Study:
    """What came out.

    Attributes:
        sections: of the document.
        figures: in the paper's order.
        simulated: whether there are experiments in it.

    """

    sections: tuple[Section, ...]
    figures: tuple[Figure, ...]
    simulated: bool

    @property
    def statements(self) -> tuple[Statement, ...]:
        """All of them."""
        return tuple(s for section in self.sections for s in section.statements)

    def to_json(self) -> dict[str, Any]:
        """JSON-ready."""
        sections = [
            {"title": s.title, "statements": [vars(one) for one in s.statements]}
            if s.statements
            else {"title": s.title, "words": list(s.words), "header": list(s.header), "rows": [list(r) for r in s.rows]}
            for s in self.sections
        ]
        return {"sections": sections, "figures": [{"number": f.number, "caption": f.caption} for f in self.figures]}


def without_experiments() -> Study:
    """Table 1, figures 1 to 21, critical values: nothing is measured."""
    return Study(computed_sections(), _computed_figures(), False)


def reproduce(
    seeds: Sequence[int], *, say: Say, watch: Watch, runs: Path | None = None, nights: Sequence[str] = tuple(NIGHTS)
) -> Study:
    """Everything.

    Args:
        seeds: one study each; the first is shown, the others count how often each check holds.
        say: called with what is going on, a line each.
        watch: gives, for the time of one night, what is called with the sequencer's news.
        runs: folder to keep the run files in; None for a temporary one.
        nights: which of `NIGHTS`.

    """
    first: Measured | None = None
    held: Counter[tuple[str, str]] = Counter()
    for seed in seeds:
        measured = measure(seed, say=say, watch=watch, runs=runs, nights=nights)
        first = first or measured
        held.update((s.where, s.says) for s in (*checks(measured), *ranges(measured)) if s.agrees)
    if first is None:
        raise ValueError("a study needs at least one seed")
    experiments = experiment_sections(first.rows, checks(first), ranges(first), held, len(seeds))
    return Study((*computed_sections(), *experiments), (*_computed_figures(), *figures_22_to_54(first)), True)


def measure(
    seed: int, *, say: Say, watch: Watch, runs: Path | None = None, nights: Sequence[str] = tuple(NIGHTS)
) -> Measured:
    """The nights of one seed, captured."""
    data = {}
    for i, (name, night) in enumerate(NIGHTS.items()):
        if name not in nights:
            continue
        points = night.points * night.replications
        say(f"seed {seed}, section {night.section}: {name}, {points} points")
        with _folder(runs, f"seed-{seed}-night-{i + 1}") as folder, watch() as show:
            data[name] = capture(night, folder, 100 * seed + i, show)
    return Measured(data)


def _computed_figures() -> tuple[Figure, ...]:
    figures = (
        *figures_1_to_5(),
        *figures_6_to_8(),
        *figures_9_11_12(),
        figure_10(),
        *figures_13_to_20(),
        figure_21(),
    )
    return tuple(sorted(figures, key=lambda figure: int(figure.number)))


@contextmanager
def _folder(runs: Path | None, name: str) -> Iterator[Path]:
    if runs is None:
        with tempfile.TemporaryDirectory(prefix="rig-study-") as temporary:
            yield Path(temporary)
        return
    folder = runs / name
    folder.mkdir(parents=True, exist_ok=True)
    yield folder
