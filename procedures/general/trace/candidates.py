"""Candidates of a table: every term of every effect that can be tested in it."""

from __future__ import annotations

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.trace.engine.problem import SPARED, Candidate
from rig.fitter.trace.engine.term import TableTerm
from rig.fitter.trace.limits import limit
from rig.fitter.trace.not_kept import NotKept, overflows
from rig.procedures.general.effects import TableEffect, effects_of
from rig.procedures.general.effects.of_settings import FIRST_ORDER
from rig.procedures.general.effects.scene import TableScene
from rig.procedures.general.read_settings import settings_of, share_within

REPEATED = 2
"""Readings of a setting, at least, on average, by which settings are levels."""
SCATTER = 0.05
"""Share of a term's variation within settings from which it is one of their scatter."""
NOTHING_LEFT = limit("declared", "general")
"""Share of a column beside the declared model, below which it is declared."""


def _of_scatter(scene: TableScene, effect: TableEffect, term: TableTerm) -> bool:
    """Whether a term over settings differs mostly where a reference standard's readings of one setting scatter.

    Such a term tells the noise of the standard: a wave whose period fits a whole number of times between the levels.
    """
    read = [name for name in effect.columns if name in scene.setpoints]
    if effect.source != "setting" or effect.family != "periodic" or not read:
        return False
    group = settings_of(np.column_stack([scene.of(name) for name in read]))
    return int(group.max()) + 1 <= scene.n // REPEATED and share_within(term.columns, group) > SCATTER


def _declared(term: TableTerm, basis: FloatArray) -> bool:
    """Whether a term is one of the declared model, whose columns have this basis (n, k)."""
    about = term.columns - term.columns.mean(axis=0)
    beside = term.columns - basis @ (basis.T @ term.columns)
    return bool(np.linalg.norm(beside) <= NOTHING_LEFT * np.linalg.norm(about))


def candidates_of(
    scene: TableScene, response: str, basis: FloatArray
) -> tuple[tuple[Candidate, ...], tuple[NotKept, ...]]:
    """All candidates in a table, cheapest first, then in catalogue order; and those with too large values.

    Args:
        scene: the table.
        response: its name.
        basis: (n, k) of the declared model's columns, orthonormal.
    """
    left = len(basis) - basis.shape[1]
    with np.errstate(over="ignore", invalid="ignore"):
        every = [
            Candidate(effect, term)
            for effect in map(scene.history.of, effects_of(scene, response))
            for term in effect.terms(scene)
            if not _of_scatter(scene, effect, term) and not (effect.kind is FIRST_ORDER and _declared(term, basis))
        ]
    large = [c for c in every if overflows(c.term.columns)]
    found = [c for c in every if c.term.columns.shape[1] + SPARED <= left and c not in large]
    cheapest: dict[str, int] = {}
    for candidate in found:
        name = candidate.effect.name
        cheapest[name] = min(cheapest.get(name, candidate.term.price), candidate.term.price)
    names = dict.fromkeys(c.effect.name for c in large)
    ordered = tuple(sorted(found, key=lambda c: cheapest[c.effect.name]))
    return ordered, tuple(NotKept(name, None, "overflow") for name in names)
