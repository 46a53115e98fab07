"""All reasons for doubt about the names found in a table."""

from __future__ import annotations

import numpy as np

from rig.fitter import ties
from rig.fitter.arrays import FloatArray
from rig.fitter.trace.aliases import DELTA
from rig.fitter.trace.constant import ENDS, changing
from rig.fitter.trace.doubts import another_law, not_sudden
from rig.fitter.trace.engine.constant import Constant
from rig.fitter.trace.engine.rivals import ALIKE, costs
from rig.fitter.trace.flexible import waves
from rig.fitter.trace.search import led_by_history, names_of
from rig.fitter.trace.sudden import lead_over_slopes, slopes
from rig.procedures.general.effects.columns import origin
from rig.procedures.general.effects.of_settings import CLIP, KINK
from rig.procedures.general.effects.of_time import SENSITIVITY_STEP, STEP
from rig.procedures.general.trace.few_rows import resting
from rig.procedures.general.trace.run import TableData
from rig.procedures.general.trace.unmodelled import UnmodelledSmooth

CURVES = "nonlinearity"
TO_A_LEVEL = 6
"""Rows in a level of a group, on average, from which on a coefficient is asked to be the same in all levels."""


def doubts_of(unmodelled: UnmodelledSmooth) -> dict[str, str]:
    """A sentence by name: a history first, then rows that alone show a name, then shapes without a
    name; last names that are one whose coefficient changes, coefficients that are no constants, steps that last, and
    curves that may be others.
    """
    led, constant = led_by_history(unmodelled.judge, unmodelled.chosen, unmodelled.judge.lead), constant_of(unmodelled)
    return {
        **other_laws(unmodelled),
        **constant.exchanged,
        **dict.fromkeys(sorted(lasting(unmodelled)), not_sudden()),
        **changing(constant.changes),
        **unmodelled.doubts,
        **resting(unmodelled),
        **led,
    }


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


def other_laws(unmodelled: UnmodelledSmooth) -> dict[str, str]:
    """A sentence for each name of a curve over a setting that another curve over it may have as well.

    A square and a cube are what most curves look like over a small range: they are doubtful where another curve is more
    probable; other curves where another one is about as probable.
    """
    judge, chosen, out = unmodelled.judge, unmodelled.chosen, dict[str, str]()
    for name in names_of(judge.candidates, chosen) if unmodelled.able else ():
        every = [
            (cost, judge.candidates[rival.terms[0]].effect)
            for rival, cost in costs(judge.problem, judge.rivals(chosen, name)).items()
        ]
        own = next((one for one in every if one[1].name == name), None)
        if own is None or own[1].source != "setting" or own[1].family != CURVES:
            continue
        near = [
            (cost, effect)
            for cost, effect in every
            if effect.name != name
            and (effect.source, effect.family, effect.columns) == (own[1].source, CURVES, own[1].columns)
            and cost - own[0] < (0.0 if unmodelled.plain_name(name) else ALIKE)
        ]
        if near:
            first = ties.least(near, key=lambda one: one[0], unit=1.0)[1]
            out[name] = another_law(first.name, corner=first.kind in (KINK, CLIP))
    return out


def lasting(unmodelled: UnmodelledSmooth) -> frozenset[str]:
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
