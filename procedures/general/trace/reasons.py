"""All reasons for doubt about the names found in a table."""

from __future__ import annotations

from rig.fitter.trace.constant import changing
from rig.fitter.trace.doubts import not_sudden
from rig.fitter.trace.search import led_by_history
from rig.procedures.general.trace.constant import constant_of
from rig.procedures.general.trace.few_rows import resting
from rig.procedures.general.trace.laws import other_laws
from rig.procedures.general.trace.sudden import not_sudden as lasting
from rig.procedures.general.trace.unmodelled import UnmodelledSmooth


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
