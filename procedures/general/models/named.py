"""Standard models by name, and one of them over a column of a table."""

from __future__ import annotations

import pkgutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from rig.fitter.arithmetic import quoted
from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.fitter.nonlinear import ByStep
from rig.procedures.general.models.entry import StandardModel


@cache
def standard_models() -> Mapping[str, StandardModel]:
    """Every standard model by name."""
    found: dict[str, StandardModel] = {}
    for module in sorted(each.name for each in pkgutil.iter_modules([str(Path(__file__).parent)])):
        for model in getattr(import_module(f"{__package__}.{module}"), "MODELS", ()):
            found[model.name] = model
    return MappingProxyType(found)


def standard_model(name: str) -> StandardModel:
    """One of them. Raises `FitError` with the names of all."""
    if name not in standard_models():
        raise FitError(f"there is no model {name!r}; there are {', '.join(standard_models())}")
    return standard_models()[name]


@dataclass(frozen=True)
class NamedCurve(ByStep):
    """A standard model over a column, in the units of the columns.

    Attributes:
        model: the entry.
        variable: the column of the abscissa.
        abscissa: factor and offset from the column's unit to the model's.
        response: the same of the response.
    """

    model: StandardModel
    variable: str
    abscissa: tuple[float, float] = field(default=(1.0, 0.0))
    response: tuple[float, float] = field(default=(1.0, 0.0))

    @property
    def names(self) -> tuple[str, ...]:
        """Required columns."""
        return (self.variable,)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the k parameters."""
        return tuple(one.name for one in self.model.parameters)

    def at(self, b: Sequence[Any], table: Mapping[str, Any]) -> Any:
        """(n,) values of the curve, of complex numbers too: derivatives are taken by a complex step."""
        factor, offset = self.response
        return (self.model.curve(b, self.of_model(table[self.variable])) - offset) / factor

    def of_model(self, x: Any) -> Any:
        """(n,) abscissas in the model's unit."""
        return x * self.abscissa[0] + self.abscissa[1]

    def start(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """(k,) parameters to begin a search with."""
        with np.errstate(all="ignore"):
            found = self.model.start(self.of_model(x), y * self.response[0] + self.response[1])
        if not np.isfinite(found).all():
            raise FitError(f"no start values for {self.model.name} can be made of these rows; give them with --start")
        return found

    def outside(self, x: FloatArray) -> int:
        """Number of abscissas beyond the validity of the model's equation."""
        low, high = self.model.valid
        t, room = self.of_model(x), 1e-9 * (high - low)
        return int(np.sum((t < low - room) | (t > high + room)))

    def __str__(self) -> str:
        return f"{self.model.name}({quoted(self.variable)})"
