"""Whether a step found in a table is sudden."""

from __future__ import annotations

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.trace.aliases import DELTA
from rig.fitter.trace.sudden import lead_over_slopes, slopes
from rig.procedures.general.effects.columns import origin
from rig.procedures.general.effects.of_time import SENSITIVITY_STEP, STEP
from rig.procedures.general.trace.unmodelled import UnmodelledSmooth


def not_sudden(unmodelled: UnmodelledSmooth) -> frozenset[str]:
    """Names of steps found that are no better than a change that goes on for a good part of the run."""
    judge, scene = unmodelled.judge, unmodelled.data.scene
    if scene.time is None or not unmodelled.able:
        return frozenset()
    at, found = judge.beside(unmodelled.chosen).best, set[str]()
    view, left = judge.view(at), unmodelled.left_under(at)
    variance = float(left @ left) / max(left.size - view.taken(unmodelled.chosen).shape[1], 1)
    for j in unmodelled.chosen:
        effect = judge.candidates[j].effect
        if effect.kind not in (STEP, SENSITIVITY_STEP):
            continue
        taken = view.taken(tuple(k for k in unmodelled.chosen if k != j))
        y = judge.white(at, unmodelled.chosen)
        y = y - taken @ (taken.T @ y)

        def project(columns: FloatArray, taken: FloatArray = taken) -> FloatArray:
            white = unmodelled.white(columns, at)
            return np.asarray(white - taken @ (taken.T @ white))

        changes = slopes(scene.time.values)
        if effect.kind == SENSITIVITY_STEP:
            setting = scene.of(effect.columns[1])
            changes = changes * (setting - origin(setting))[:, None]
        if lead_over_slopes(y, float(y @ y - left @ left), variance, changes, project) <= DELTA:
            found.add(effect.name)
    return frozenset(found)
