"""Error of predicting a later run from the first one, without and with effects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.confirm.together import Candidates, Together, left, solve
from rig.fitter.linear import orthonormal


@dataclass(frozen=True, eq=False)
class SensorError:
    """Error of predicting the later run of one sensor from the first alone, rms in units of the output.

    Attributes:
        before: by the declared model.
        after: with the effects found in it.
        sigma: scatter of one reading, which no model goes below.
        slope: output per unit of what is inferred: V/g, or mV/psi.
        residual_after: (m,) of the readings of the later run, with the effects.

    """

    before: float
    after: float
    sigma: float
    slope: float
    residual_after: FloatArray


def prediction_errors(
    both: Together, effects: Mapping[str, Candidates]
) -> tuple[dict[str, SensorError], dict[tuple[str, str], FloatArray]]:
    """Error of predicting the later run from the first alone, without and with effects, and the contribution of each.

    The later run's own parameters (`Together.loose`) are removed for both.
    """
    first, terms = both.only(~both.fresh), [term for own in effects.values() for term in own]
    gamma = solve(first.columns_of(terms), first.outputs)
    raw, resized, outputs = both.raw(terms), both.resized(terms).raw, both.raw_outputs
    at = both.fresh
    errors, adds = {}, {}
    for i, sensor in enumerate(both.sensors):
        model, own = both.declared[i], np.column_stack([both.loose[at], resized[i][at]])
        lost = orthonormal(own).shape[1]

        def left_of(y: FloatArray, model: FloatArray = model, own: FloatArray = own) -> FloatArray:
            return left(own, (y - model @ solve(model[~at], y[~at]))[at])

        rests = [left_of(outputs[i]), left_of(outputs[i] - raw[i] @ gamma)]
        free = outputs[i][at].size - lost
        before, after = (float(np.sqrt(np.sum(r**2) / free)) if free > 0 else float("nan") for r in rests)
        sigma = float(np.sqrt(np.mean(both.sigma[i][at] ** 2)))
        errors[sensor] = SensorError(before, after, sigma, float(both.slope[i]), rests[1])
        start = 0
        for name, mine in effects.items():
            part = slice(start, start + len(mine))
            adds[name, sensor] = left_of(raw[i][:, part] @ gamma[part])
            start += len(mine)
    return errors, adds
