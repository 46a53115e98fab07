"""Checks of given arrays: one dimension, the right length, only finite numbers."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.errors import FitError


def finite(name: str, values: ArrayLike, count: int) -> FloatArray:
    """(count,) `values`, read-only.

    Raises:
        FitError: a value is not finite. ValueError: another shape. The message names the array.
    """
    if isinstance(values, np.ndarray) and values.dtype == np.float64 and not values.flags.writeable:
        array: FloatArray = values  # nobody changes it: of a million rows, a copy is as much memory as the table
    else:
        array = np.array(values, dtype=np.float64)
    if array.shape != (count,):
        raise ValueError(f"{name}: expected {count} values in one dimension, found shape {array.shape}")
    bad = np.flatnonzero(~np.isfinite(array))
    if bad.size:
        raise FitError(f"{name}: row {bad[0]} holds {array[bad[0]]}, not a finite number")
    array.flags.writeable = False
    return array


def whole(name: str, values: ArrayLike, count: int) -> IntArray:
    """(count,) `values` as integers, read-only.

    Raises:
        FitError: a value is not a whole number. ValueError: another shape. The message names the array.
    """
    array = finite(name, values, count)
    bad = np.flatnonzero(array != np.round(array))
    if bad.size:
        raise FitError(f"{name}: row {bad[0]} holds {array[bad[0]]:g}, not a whole number")
    integers = array.astype(np.int64)
    integers.flags.writeable = False
    return integers
