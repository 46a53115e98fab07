"""A simple model of every output for early warnings: the columns of all declared formulas at one setting."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from rig.fitter.errors import FitError
from rig.fitter.formula import Formula


def response_of(
    formulas: Sequence[str], factors: Sequence[str]
) -> Callable[[Mapping[str, float]], tuple[float, ...]] | None:
    """Columns of the formulas from quantities by name; None if they need more than the factors.

    Args:
        formulas: the declared ones.
        factors: names of the factors.
    """
    try:
        parsed = [Formula.parse(text) for text in formulas]
    except FitError:
        return None  # refused where the design is checked
    if not parsed:
        return None
    terms = dict.fromkeys(term for one in parsed for term in one.terms)
    model = Formula(tuple(sorted(terms, key=len)))
    if model.has_categories or not set(model.names) <= set(factors):
        return None

    def columns(given: Mapping[str, float]) -> tuple[float, ...]:
        table = {name: np.array([given[name]]) for name in model.names}
        return tuple(model.columns(table)[1][0].tolist()) if table else (1.0,)

    return columns
