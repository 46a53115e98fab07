"""Errors of whole plots that transducers have in common: something acts on all of them that was not recorded."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from rig.fitter import ties
from rig.fitter.arrays import FloatArray
from rig.fitter.trace.engine.beside import View
from rig.procedures.pressure.trace.problem import Problem

LEAST_DF = 4
"""Degrees of freedom of a correlation, at least."""


@dataclass(frozen=True)
class Common:
    """The transducer whose whole plots' errors are most like those of another one.

    Attributes:
        other: its name.
        correlation: of both.
        p: probability of so much by chance, over all others.

    """

    other: str
    correlation: float
    p: float


def common_error(problem: Problem, view: View, i: int) -> Common | None:
    """What transducer `i` has in common with another one; None where there is none to ask.

    Neighbours in time that are alike make two courses correlate by chance; their degrees of freedom are fewer
    (Bartlett, J. R. Stat. Soc. 98 (1935) 536).

    Args:
        problem: the run.
        view: its whole plots beside the model.
        i: the transducer.
    """
    errors, found = view.outputs[:, problem.plots_in_time], list[Common]()
    for k, other in enumerate(problem.sensors):
        df = float(min(view.df[i], view.df[k]))
        square = float(errors[i] @ errors[i]) * float(errors[k] @ errors[k])
        if k == i or df < LEAST_DF or square <= 0.0:
            continue
        r = float(errors[i] @ errors[k]) / np.sqrt(square)
        alike = max(_memory(errors[i]) * _memory(errors[k]), 0.0)
        free = max(df * (1.0 - alike) / (1.0 + alike) - 1.0, 1.0)
        t = abs(r) * np.sqrt(free / max(1.0 - r**2, np.finfo(float).eps))
        found.append(Common(other, r, min(2.0 * float(special.stdtr(free, -t)) * (len(problem.sensors) - 1), 1.0)))
    return ties.least(found, key=lambda one: one.p) if found else None


def _memory(errors: FloatArray) -> float:
    """Correlation of neighbours."""
    return float(errors[1:] @ errors[:-1]) / float(errors @ errors)
