"""Further runs of a pressure calibration: the same temperatures or few of them, with other pressures."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

from rig.procedures.plan.further_runs import Limits, Variation, named
from rig.procedures.plan.settings import Varies
from rig.procedures.pressure.settings import WholePlotProcedure


def further_runs(first: WholePlotProcedure, limits: Limits, *, chamber: bool) -> Iterator[Variation]:
    """Runs after `first`, on any bench: the temperatures of the design, some or all of them, with other pressures."""
    pressures = sorted(first.design.pressures_psia)
    between = [round((low + high) / 2, 6) for low, high in itertools.pairwise(pressures)]
    kinds: tuple[tuple[str, Varies, Sequence[float], Sequence[float]], ...] = (
        ("the same pressures in another order", "order", pressures, first.design.repeated_psia),
        ("every pressure twice in a whole plot", "order", pressures, pressures),
        ("pressures between those of the first run too", "settings", sorted({*pressures, *between}), []),
    )
    for what, varies, levels, repeated in kinds:
        for pairs in _temperatures(first):
            design = first.design.model_copy(
                update={
                    "type": "list",
                    "temperatures_degC": pairs,
                    "pressures_psia": list(levels),
                    "repeated_psia": list(repeated),
                }
            )
            run = first.model_copy(
                update={
                    "design": design,
                    "replications": 1,
                    "seed": first.seed + 1,
                    "name": named(first.name, what),
                }
            )
            yield Variation(what, run, varies=varies)


def _temperatures(first: WholePlotProcedure) -> Iterator[list[tuple[float, float]]]:
    """Centre and extremes twice, every temperature once, and the whole design again."""
    every = sorted(set(first.design.pairs()))
    ends = sorted({every[0], every[len(every) // 2], every[-1]})
    for pairs in (2 * ends, every, 2 * every, first.design.pairs()):
        yield list(pairs)
