"""Reasons for doubt about a name of one transducer: what another one has, or follows, at the same time."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from rig.fitter.trace.doubts import shown_by_another, under_another_name
from rig.fitter.trace.engine.beside import LEVELS
from rig.fitter.trace.limits import limit
from rig.procedures.pressure.trace.unmodelled import UnmodelledSmooth

UNEXPLAINED = limit("unexplained", "whole-plot")
"""Probability of a remainder, over all that is tried, below which it is said."""


def of_another(unmodelled: UnmodelledSmooth, name: str, i: int) -> str | None:
    """Doubt about a name of transducer `i` where another one, without it, follows a shape in the same stratum.

    They are of one make and on one line, so that one cause of both is likelier than two.
    """
    sensors = unmodelled.problem.sensors
    for level in LEVELS:
        having = [k for k in range(len(sensors)) if name in unmodelled.names_in(k, level)]
        for k in range(len(sensors)):
            left = unmodelled.left_in(k, level) if i in having and k not in having else None
            if left is not None and left.p < UNEXPLAINED:
                return shown_by_another(sensors[k], left.place.text)
    return None


def of_alias(
    unmodelled: UnmodelledSmooth, aliases: Sequence[str], i: int, doubt: Callable[[str, int], str | None]
) -> str | None:
    """Doubt about a name of transducer `i` of which another one has an alias, where that is doubtful.

    Args:
        unmodelled: the run with its findings.
        aliases: of the name.
        i: the transducer.
        doubt: of a name in a transducer.

    """
    for k, sensor in enumerate(unmodelled.problem.sensors):
        for other in (name for level in LEVELS for name in unmodelled.names_in(k, level) if k != i):
            if other in aliases and doubt(other, k) is not None:
                return under_another_name(sensor, other)
    return None
