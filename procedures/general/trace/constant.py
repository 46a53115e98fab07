"""Whether the coefficients of the names found in a table are constants."""

from __future__ import annotations

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.trace.constant import ENDS
from rig.fitter.trace.engine.constant import Constant
from rig.fitter.trace.flexible import waves
from rig.procedures.general.trace.run import TableData
from rig.procedures.general.trace.unmodelled import UnmodelledSmooth

TO_A_LEVEL = 6
"""Rows in a level of a group, on average, from which on a coefficient is asked to be the same in all levels."""


def constant_of(unmodelled: UnmodelledSmooth) -> Constant:
    """Whether the coefficients of names found in a table are constants."""
    return Constant((unmodelled,), _variables(unmodelled.data))


def _variables(data: TableData) -> dict[str, FloatArray]:
    scene, n = data.scene, len(data.y)
    found = {f"with {name}": waves(v, ENDS) for name, v in scene.variables.items()}
    if scene.time is not None:
        found[f"with {scene.time.name}"] = waves(scene.time.values, ENDS)
    if scene.direction is not None:
        found[f"with {scene.direction[0]}"] = np.asarray(scene.direction[1], np.float64)[:, None]
    for name, group in {**scene.groups, **scene.labels}.items():
        if 1 < len(group.levels) <= n // TO_A_LEVEL:
            found[f"with {name}"] = group.indicators[:, 1:]
    if data.shared is not None and 0 < (most := int(data.shared.max())) < n // TO_A_LEVEL:
        found["from one group of rows with a common error to the next"] = (
            data.shared[:, None] == np.arange(1, most + 1)
        ).astype(np.float64)
    return found
