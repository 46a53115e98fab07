"""How a quantity that a standard reads is brought to its levels, as `rig plan` says it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from rig.bench.approach import Approach
from rig.procedures.column_names import spelled, unit_of
from rig.procedures.present.blocks import Block, Line

if TYPE_CHECKING:
    from rig.runs.plans import Plan


def first_settings(plan: Plan) -> Iterator[Block]:
    """The first setting of every level, and which levels are beyond the table of approach."""
    levels = {factor.name: sorted(set(plan.run_list.column(factor.name))) for factor in plan.run_list.factors}
    for name, of in plan.bench.steered.items():
        if name not in levels:
            continue
        table = Approach.of(plan.bench.references[name].approach or ())
        first = ", ".join(f"{level:g} at {table.setting(level):.4g}" for level in levels[name])
        near = plan.procedure.conduct.near[name]
        yield Line(
            f"  {name} is set by {of}, first as in its table of approach, then corrected until its standard reads the "
            f"level within {near:.3g} {spelled(unit_of(name))}: {first} {spelled(unit_of(of))}"
        )
        if beyond := [f"{level:g}" for level in levels[name] if not table.covers(level)]:
            yield Line(
                f"  [yellow]{name} = {', '.join(beyond)} is beyond the table of approach[/]: the first setting goes on "
                f"as at its end"
            )
