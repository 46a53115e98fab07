"""Budgets of many sensors on one screen: for each the range of its expanded uncertainties."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from rich.markup import escape

from rig.fitter.rounding import with_error
from rig.procedures.evaluate.fit_in_short import MANY
from rig.procedures.present.blocks import Block, Grid, Line, headline
from rig.procedures.present.terms import in_words
from rig.units.si import per_term
from rig.verbs.budget.coverage import with_probability

if TYPE_CHECKING:
    from rig.fitter.budget import Budgeted
    from rig.verbs.budget.evaluation import RunBudget
    from rig.verbs.budget.result import Budget


def in_short(budget: Budget) -> Iterable[Block]:
    """One screen: with more than three sensors, the range of each one's uncertainties, not every result."""
    found = budget.found
    if len(set(found.sensors)) <= MANY:
        return budget.blocks(each=False)
    return [headline(Path(found.of.table.source).name, found.of.table), *of_sensors(found)]


def of_sensors(found: RunBudget) -> Iterator[Block]:
    """A row a sensor for what is inferred, or for the outputs if nothing is."""
    groups: dict[tuple[str, str], list[Budgeted]] = {}
    for one, sensor in zip(found.budgets, found.sensors, strict=True):
        groups.setdefault((sensor, what_of(one.name, sensor)), []).append(one)
    kinds = [what for _, what in groups]
    wanted = next((w for w in ("inferred", "output") if any(k.startswith(w) for k in kinds)), "")
    for sentence in found.of.stated.what_is_lacking(found.unstated):
        yield Line(f"[bold]not in the uncertainties:[/] {escape(sentence)}")
    yield Line(with_probability(found.budgets))
    grid = Grid(("sensor", "result", "smallest", "largest", "largest influence"), frame="plain", apart=2)
    for (sensor, what), every in groups.items():
        if what.startswith(wanted):
            low, high = (pick(every, key=lambda one: one.expanded_uncertainty) for pick in (min, max))
            first = high.contributions[0]
            influence = f"{first.name.partition(':')[0]}, {100 * first.share:.0f} %"
            grid.add_row(escape(sensor), escape(in_words(what)), _words(low), _words(high), escape(influence))
    yield grid


def what_of(name: str, sensor: str) -> str:
    """The sort of a result by its name, without its sensor and settings.

    Example:
        >>> what_of("cell_1 inferred force at 5 kN, 23 degC", "cell_1_V")
        'inferred force'
    """
    own = next((begin for begin in (sensor, sensor.rpartition("_")[0]) if begin and name.startswith(f"{begin} ")), "")
    return name[len(own) :].strip().partition(" at ")[0]


def _words(one: Budgeted) -> str:
    _, expanded = with_error(one.value, one.expanded_uncertainty)
    return f"{expanded} {per_term(one.unit)}"
