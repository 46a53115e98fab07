"""Platinum resistance thermometers by ITS-90: its reference functions and deviation functions of sub-ranges.

The deviation is a function of W = R / R_tpw itself: W - Wr(t) = a (W - 1) + b (W - 1)^2 + ... For a given temperature
and given coefficients W is found by Newton's method.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.procedures.general.models.entry import Parameter, Quantity, StandardModel, power_series, straight

_SOURCE = (
    "The International Temperature Scale of 1990, equations (9a), (10a) and tables 1 and 4; Metrologia 27 (1990) 3"
)
_TPW_K, _ICE_K, _STEPS = 273.16, 273.15, 12
_BELOW = (
    -2.13534729,
    3.18324720,
    -1.80143597,
    0.71727204,
    0.50344027,
    -0.61899395,
    -0.05332322,
    0.28021362,
    0.10715224,
    -0.29302865,
    0.04459872,
    0.11868632,
    -0.05248134,
)
_ABOVE = (
    2.78157254,
    1.64650916,
    -0.13714390,
    -0.00649767,
    -0.00234444,
    0.00511868,
    0.00187982,
    -0.00204472,
    -0.00046122,
    0.00045724,
)


def reference(t_degC: Any) -> Any:
    """(n,) Wr, the reference resistance ratio of ITS-90, from -259.3467 to 961.78 degC; NaN outside."""
    T = np.asarray(t_degC) + _ICE_K
    low = np.exp(power_series(_BELOW, (np.log(np.where(np.real(T) > 0.0, T, np.nan) / _TPW_K) + 1.5) / 1.5))
    high = power_series(_ABOVE, (T - 754.15) / 481.0)
    outside = (np.real(T) < 13.80) | (np.real(T) > 1234.94)
    return np.where(outside, np.nan, np.where(np.real(T) < _TPW_K, low, high))


def _powers(W: Any, count: int) -> list[tuple[Any, Any]]:
    """Terms of the deviation above 0 degC, and below it in short ranges, with their derivatives by W."""
    return [((W - 1.0) ** i, i * (W - 1.0) ** (i - 1)) for i in range(1, count + 1)]


def _with_logarithm(W: Any) -> list[tuple[Any, Any]]:
    """Terms of the deviation from 83.8058 K to 273.16 K."""
    return [(W - 1.0, np.ones_like(W)), ((W - 1.0) * np.log(W), np.log(W) + (W - 1.0) / W)]


_Terms = Callable[[Any], list[tuple[Any, Any]]]


def _curve(b: Sequence[Any], t: Any, terms: _Terms) -> Any:
    Wr = reference(t)
    W = Wr
    for _ in range(_STEPS):  # the last steps also carry a complex step to its full precision
        parts = terms(W)
        deviation = sum(c * part for c, (part, _) in zip(b[1:], parts, strict=True))
        slope = sum(c * change for c, (_, change) in zip(b[1:], parts, strict=True))
        W = W - (W - deviation - Wr) / (1.0 - slope)
    return b[0] * W


def _start(t: FloatArray, R: FloatArray, terms: _Terms) -> FloatArray:
    Wr = reference(t)
    columns = [Wr, *(part for part, _ in terms(Wr))]
    found = straight(*columns, y=R)
    return np.asarray([found[0], *(found[1:] / found[0])])


_MEANINGS = {"a": "coefficient of W - 1", "b": "of (W - 1)^2", "c": "of (W - 1)^3"}


def _model(name: str, words: str, valid: tuple[float, float], terms: _Terms, letters: str) -> StandardModel:
    shown = " + ".join(f"{one} (W - 1)^{i}" if i > 1 else f"{one} (W - 1)" for i, one in enumerate(letters, 1))
    logarithm = terms is _with_logarithm
    if logarithm:
        shown = "a (W - 1) + b (W - 1) ln W"
    meanings = _MEANINGS | ({"b": "of (W - 1) ln W"} if logarithm else {})
    return StandardModel(
        name,
        f"platinum thermometer, {words}: W - Wr = {shown}, W = R / R_tpw",
        _SOURCE,
        Quantity("temperature", "degC"),
        Quantity("resistance", "ohm"),
        valid,
        (
            Parameter("R_tpw", "ohm", "resistance at the triple point of water"),
            *(Parameter(one, "", meanings[one]) for one in letters),
        ),
        partial(_curve, terms=terms),
        partial(_start, terms=terms),
        hint="R_tpw needs a reading near 0.01 degC, and each coefficient another temperature; a shorter sub-range has "
        "fewer coefficients",
    )


_one, _two, _three = (partial(_powers, count=count) for count in (1, 2, 3))
MODELS = (
    _model("its90-ar", "-189.3442 to 0.01 degC", (-189.3442, 0.01), _with_logarithm, "ab"),
    _model("its90-hg-ga", "-38.8344 to 29.7646 degC", (-38.8344, 29.7646), _two, "ab"),
    _model("its90-ga", "0 to 29.7646 degC", (0.0, 29.7646), _one, "a"),
    _model("its90-in", "0 to 156.5985 degC", (0.0, 156.5985), _one, "a"),
    _model("its90-sn", "0 to 231.928 degC", (0.0, 231.928), _two, "ab"),
    _model("its90-zn", "0 to 419.527 degC", (0.0, 419.527), _two, "ab"),
    _model("its90-al", "0 to 660.323 degC", (0.0, 660.323), _three, "abc"),
)
