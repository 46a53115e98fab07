"""Columns of a laboratory's own effects: arithmetic on named quantities, in the grammar of `rig.fitter.formula`."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np

from rig.fitter.arithmetic import FUNCTIONS, Expression
from rig.fitter.arithmetic_text import FormulaError, parse_expression
from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError

LONGEST = 500
"""Maximum length of a formula, characters."""


@dataclass(frozen=True)
class OwnFormula:
    """One column of an effect.

    Attributes:
        text: its text.
        expression: the parsed text.
    """

    text: str
    expression: Expression

    @classmethod
    def of(cls, effect: str, text: str, names: Collection[str]) -> OwnFormula:
        """Check a text: arithmetic on `names`.

        Raises:
            FitError: with the effect and the place of the error.
        """
        if not isinstance(text, str) or not 0 < len(text) <= LONGEST:
            raise FitError(f"effect {effect}: a column is a text of up to {LONGEST} characters, not {text!r:.40}")
        try:
            expression = parse_expression(text)
        except FormulaError as error:
            raise FitError(f"effect {effect}: a column is not understood: {error}") from error
        unknown = [name for name in expression.names if name not in names]
        if unknown:
            raise FitError(
                f"effect {effect}: {unknown[0]} in {text!r} is not understood; a column has numbers, + - * / ^, "
                f"comparisons, {', '.join(FUNCTIONS)}, and {', '.join(names)}"
            )
        return cls(text, expression)

    @property
    def used(self) -> frozenset[str]:
        """Names in it."""
        return frozenset(self.expression.names)

    def column(self, value_of: Callable[[str], FloatArray], n: int) -> FloatArray:
        """(n,) its values, from those of the names."""
        values = np.broadcast_to(self.expression.value({name: value_of(name) for name in self.used}), (n,))
        if not np.all(np.isfinite(values)):
            raise FitError(f"an effect's column {self.text!r} is not a finite number at every observation")
        return values.astype(np.float64)
