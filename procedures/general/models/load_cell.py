"""Force transducers: polynomials of the force through zero, or with a zero signal."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.procedures.general.models.entry import Parameter, Quantity, StandardModel, power_series, straight

_SOURCE = "ISO 376:2011, 7.5 and annex: interpolation equation of degree 1, 2 or 3"


def _through_zero(b: Sequence[Any], force: Any) -> Any:
    return power_series((0.0, *b), force)


def _start(force: FloatArray, y: FloatArray, first: int, last: int) -> FloatArray:
    return straight(*(force**i for i in range(first, last + 1)), y=y)


def _model(name: str, words: str, first: int, last: int) -> StandardModel:
    units = ["", "1/force", "1/force^2", "1/force^3"]
    meanings = ["signal without force", "sensitivity", "quadratic coefficient", "cubic coefficient"]
    return StandardModel(
        name,
        words,
        _SOURCE,
        Quantity("force", ""),
        Quantity("deflection", ""),
        (-np.inf, np.inf),
        tuple(Parameter(f"b{i}", units[i], meanings[i]) for i in range(first, last + 1)),
        power_series if first == 0 else _through_zero,
        partial(_start, first=first, last=last),
        hint="it takes as many different forces as it has coefficients",
    )


MODELS = (
    _model("load-cell-line", "force transducer: b1 F, of tared deflections", 1, 1),
    _model("load-cell-square", "force transducer: b1 F + b2 F^2, of tared deflections", 1, 2),
    _model("load-cell-cubic", "force transducer: b1 F + b2 F^2 + b3 F^3, of tared deflections", 1, 3),
    _model("load-cell-cubic-zero", "force transducer: b0 + b1 F + b2 F^2 + b3 F^3, of signals", 0, 3),
)
