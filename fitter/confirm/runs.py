"""Concatenated observations of two runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any, ClassVar, Protocol, TypeVar

import numpy as np

from fitter.arrays import FloatArray
from fitter.errors import FitError


class Observations(Protocol):
    """Observations of any kind, a dataclass of arrays of equal length."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def outputs(self) -> Mapping[str, FloatArray]:
        """(n,) by sensor."""


Data = TypeVar("Data", bound=Observations)

_NUMBERED = ("replicate", "order", "block", "whole_plot")
_APART = ("outputs", "axes", "mounting")


def join(first: Data, later: Data, after_s: float, **more: Any) -> Data:
    """The observations of both runs, those of the first run first.

    Args:
        first: the traced run.
        later: the confirming run; with the same sensors.
        after_s: time from the first run's zero of elapsed time to the later one's, seconds.
        more: attributes that are not simply concatenated.

    Raises:
        FitError: the later run lacks a sensor of the first.
    """
    missing = [name for name in first.outputs if name not in later.outputs]
    if missing:
        raise FitError(f"the confirming run has no {missing[0]}, which the traced run has")
    given: dict[str, Any] = {}
    for name in (f.name for f in fields(first) if f.init and f.name not in _APART):
        a, b = getattr(first, name), getattr(later, name)
        if name in _NUMBERED:
            b = b - b.min() + a.max() + 1
        elif name == "elapsed_s":
            b = b + after_s
        given[name] = None if a is None or b is None else np.concatenate([a, b])
    given["outputs"] = {name: np.concatenate([v, later.outputs[name]]) for name, v in first.outputs.items()}
    return type(first)(**given, **more)
