"""Names of curves beside which another curve over the same setting explains as much."""

from __future__ import annotations

from rig.fitter import ties
from rig.fitter.trace.doubts import another_law
from rig.fitter.trace.engine.rivals import ALIKE, costs
from rig.fitter.trace.search import names_of
from rig.procedures.general.effects.of_settings import CLIP, KINK
from rig.procedures.general.trace.unmodelled import UnmodelledSmooth

CURVES = "nonlinearity"


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
