"""Concatenated observations of a traced run and of further ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, ClassVar, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from rig.fitter.arrays import FloatArray
from rig.fitter.effects.manual_changes import Done
from rig.fitter.errors import FitError


class Observations(Protocol):
    """Observations of any kind, a dataclass of arrays of equal length."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def outputs(self) -> Mapping[str, FloatArray]:
        """(n,) by sensor."""


Data = TypeVar("Data", bound=Observations)

_NUMBERED = ("replicate", "order", "block", "whole_plot")
_APART = ("outputs", "axes", "mounting")


@dataclass(frozen=True, eq=False)
class Later:
    """A further run.

    Attributes:
        data: its observations.
        after_s: seconds from the begin of the first run to its begin.
        done: changes by a person, with masks over its observations.
    """

    data: Any
    after_s: float
    done: Sequence[Done] = ()


def numbers(first: int, later: Sequence[Later]) -> NDArray[np.int64]:
    """(n,) number of the run of each observation: 0 for `first` ones of the first run, then 1, 2."""
    return np.repeat(np.arange(1 + len(later)), [first, *(len(one.data) for one in later)])


def changes(first: int, later: Sequence[Later]) -> tuple[Done, ...]:
    """Changes by a person in all further runs, with masks over the observations of all runs."""
    starts = np.cumsum([first, *(len(one.data) for one in later)])
    every = zip(starts[:-1].tolist(), later, strict=True)
    return tuple(done.among(start, int(starts[-1])) for start, one in every for done in one.done)


def join_all(first: Data, later: Sequence[Later]) -> Data:
    """The observations of a first run and of further ones, in this order. Raises `FitError` as `join`."""
    for one in later:
        first = join(first, one.data, one.after_s)
    return first


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
