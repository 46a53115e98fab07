"""Whether two names are one name with a coefficient that changes.

A cause whose strength depends on something (a line that freezes in the cold, friction that grows with the load) is
found as two: the nearest law with a constant coefficient, and another one that takes up how it changes. If the first
law times a smooth function of what was recorded does the work of the second, both names are doubtful.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import permutations

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.linear import orthonormal
from rig.fitter.trace.aliases import DELTA, PER_COLUMN
from rig.fitter.trace.doubts import one_that_changes
from rig.fitter.trace.flexible import NOTHING_LEFT, Block


def exchanges(names: Iterable[str], over: Callable[[str, str], str | None]) -> dict[str, str]:
    """Reasons for doubt about names of which one with a coefficient that changes does the work of both.

    Args:
        names: found in one place.
        over: the variable with which the coefficient of the first name would change instead of the second name.

    """
    out: dict[str, str] = {}
    for name, other in permutations(names, 2):
        variable = over(name, other)
        if variable is not None:
            out |= {one: one_that_changes(name, other, variable) for one in (name, other) if one not in out}
    return out


def stands_in(
    y: FloatArray,
    other: FloatArray,
    blocks: Iterable[Block],
    project: Callable[[FloatArray], FloatArray],
    variance: float,
) -> str | None:
    """The variable with which a coefficient would change, if that explains as much as another name; else None.

    Args:
        y: (n,) residual without the other name.
        other: (n, q) columns of the other name, beside the rest of the model.
        blocks: what the first name adds, times smooth functions of each variable.
        project: removes the rest of the model from columns (n, m).
        variance: of the error beside both names.

    """
    basis = orthonormal(other)
    least = float(np.sum((basis.T @ y) ** 2)) / variance - PER_COLUMN * basis.shape[1] - DELTA
    best, over = max(least, DELTA), None  # a weak name is as good as many by chance
    for block in blocks:
        for columns in (block.columns[:, :1], block.columns):
            own = orthonormal(project(columns), np.linalg.norm(columns, axis=0), NOTHING_LEFT)
            gain = float(np.sum((own.T @ y) ** 2)) / variance - PER_COLUMN * own.shape[1]
            if gain >= best:
                best, over = gain, block.place
    return over
