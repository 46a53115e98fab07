"""Columns of the effects of groups and of bits."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from rig.fitter.trace.engine.term import TableTerm
from rig.procedures.general.effects.columns import Terms, origin, power_text
from rig.procedures.general.effects.scene import TableScene


def offsets(scene: TableScene, group: str) -> Terms:
    """One column for each level except the first."""
    g = scene.groups[group]
    if g.declared or not 1 < len(g.levels) <= len(g.index) // 2:
        return ()
    return (TableTerm(tuple(f"C({group})[{level}]" for level in g.levels[1:]), g.indicators[:, 1:], of_levels=True),)


def gains(scene: TableScene, group: str, variable: str) -> Terms:
    """A slope over a variable for each level except the first."""
    g, v = scene.groups[group], scene.of(variable)
    if not 1 < len(g.levels) <= len(g.index) // 3 or np.ptp(v) == 0.0:
        return ()
    over = power_text(variable, origin(v), 1)
    labels = tuple(f"C({group})[{level}]:{over}" for level in g.levels[1:])
    return (TableTerm(labels, g.indicators[:, 1:] * (v - origin(v))[:, None], of_levels=True),)


def combined(scene: TableScene, first: str, second: str) -> Terms:
    """One column for each pair of levels, beyond those of either grouping."""
    a, b = scene.groups[first], scene.groups[second]
    if len(a.levels) < 2 or len(b.levels) < 2 or len(a.levels) * len(b.levels) > len(a.index) // 3:
        return ()
    pairs = [(i, j) for i in range(1, len(a.levels)) for j in range(1, len(b.levels))]
    columns = [a.indicators[:, i] * b.indicators[:, j] for i, j in pairs]
    kept = [k for k, column in enumerate(columns) if column.any()]
    if not kept:
        return ()
    labels = [f"C({first})[{a.levels[pairs[k][0]]}]:C({second})[{b.levels[pairs[k][1]]}]" for k in kept]
    return (TableTerm(tuple(labels), np.column_stack([columns[k] for k in kept])),)


def bit_weights(scene: TableScene, _names: str) -> Terms:
    """All bits, each with its own weight."""
    return (TableTerm(scene.bits, np.column_stack([scene.of(name) for name in scene.bits])),)


def bit_pairs(scene: TableScene, _names: str) -> Terms:
    """Products of two bits."""
    pairs = list(combinations(scene.bits, 2))
    columns = np.column_stack([scene.of(a) * scene.of(b) for a, b in pairs])
    return (TableTerm(tuple(f"{a}:{b}" for a, b in pairs), columns),) if len(pairs) <= scene.n // 4 else ()


def bit_weights_by(scene: TableScene, _names: str, group: str) -> Terms:
    """A weight of each bit for each level except the first."""
    g = scene.groups[group]
    count = (len(g.levels) - 1) * len(scene.bits)
    if not 0 < count <= len(g.index) // 3:
        return ()
    labels = [f"C({group})[{level}]:{bit}" for bit in scene.bits for level in g.levels[1:]]
    columns = [g.indicators[:, 1:] * scene.of(bit)[:, None] for bit in scene.bits]
    return (TableTerm(tuple(labels), np.column_stack(columns)),)
