"""Declaration of a standard model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray


@dataclass(frozen=True)
class Quantity:
    """A column of a model.

    Attributes:
        name: in words.
        unit: of the model; "" for any.
    """

    name: str
    unit: str


@dataclass(frozen=True)
class Parameter:
    """A parameter of a model.

    Attributes:
        name: its symbol.
        unit: "" for a number.
        meaning: in words.
    """

    name: str
    unit: str
    meaning: str


@dataclass(frozen=True)
class Derived(Parameter):
    """A number that follows from the parameters, with an error by the delta method.

    Attributes:
        of: its value from the k parameters, complex ones too.
    """

    of: Callable[[Sequence[Any]], Any]


@dataclass(frozen=True)
class StandardModel:
    """A response as a function of one abscissa.

    Attributes:
        name: for `--model`.
        title: in words.
        source: where its equation and numbers are printed.
        abscissa: what is set.
        response: what is read.
        valid: lowest and highest abscissa of the equation, in its unit.
        parameters: k, in order.
        curve: response for k parameters and (n,) abscissas; of complex values too, with the imaginary part carried
            along. NaN where it is undefined.
        start: k parameters to begin a search with, from (n,) abscissas and responses.
        derived: further results.
        hint: what to do where the rows do not determine every parameter.
    """

    name: str
    title: str
    source: str
    abscissa: Quantity
    response: Quantity
    valid: tuple[float, float]
    parameters: tuple[Parameter, ...]
    curve: Callable[[Sequence[Any], Any], Any]
    start: Callable[[FloatArray, FloatArray], FloatArray]
    derived: tuple[Derived, ...] = ()
    hint: str = ""


def straight(*columns: FloatArray, y: FloatArray) -> FloatArray:
    """(k,) plain least-squares coefficients of k columns, for a start; dependent columns get the shortest solution."""
    matrix = np.column_stack(columns)
    length = np.linalg.norm(matrix, axis=0)
    length[length == 0.0] = 1.0
    return np.asarray(np.linalg.lstsq(matrix / length, y, rcond=None)[0] / length)


def power_series(b: Sequence[Any], x: Any) -> Any:
    """b[0] + b[1] x + b[2] x^2 + ..., by Horner's rule."""
    total: Any = np.zeros_like(x)
    for one in reversed(list(b)):
        total = total * x + one
    return total
