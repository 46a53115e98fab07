"""All reasons for doubt about the names found in a table."""

from __future__ import annotations

from rig.fitter.trace.constancy import changing
from rig.fitter.trace.doubts import not_sudden
from rig.fitter.trace.search import led_by_history
from rig.procedures.general.trace.constant import changes, exchanged
from rig.procedures.general.trace.few_rows import resting
from rig.procedures.general.trace.laws import other_laws
from rig.procedures.general.trace.sudden import not_sudden as lasting
from rig.procedures.general.trace.unmodelled import UnmodelledSmooth


def doubts_of(unmodelled: UnmodelledSmooth) -> dict[str, str]:
    """A sentence by name: a history first, then rows that alone show a name, then shapes without a
    name.
    """
    judge = unmodelled.judge
    led = led_by_history(judge, unmodelled.chosen, judge.lead)
    return {**new_doubts(unmodelled), **unmodelled.doubts, **resting(unmodelled), **led}


def new_doubts(unmodelled: UnmodelledSmooth) -> dict[str, str]:
    """Of names that are one whose coefficient changes, of coefficients that are no constants, of steps that last, of
    curves that may be others.
    """
    return {
        **other_laws(unmodelled),
        **exchanged(unmodelled),
        **dict.fromkeys(sorted(lasting(unmodelled)), not_sudden()),
        **changing(changes(unmodelled)),
    }
