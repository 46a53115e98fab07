"""How often 95 % intervals hold: of inferred values, of the curve, of a new reading, and of the parameters.

Each seed is one calibration (proving/truth/curves.py) and a few readings with it. Inferred values have two intervals:
that of `rig infer`, all abscissas whose prediction interval covers the reading (Fieller's for a line), and that of the
delta method, t times the standard deviation of `rig infer`.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np

from proving.frame import Figures, Part, Results, Study
from proving.ledger import Result
from proving.truth.curves import TRUTHS, calibration, readings
from rig.procedures.general.declared import Declared, model_of
from rig.procedures.general.fit import calibration_of
from rig.procedures.general.infer import infer_curve
from rig.procedures.general.infer.calibration import student

DECLARED: Mapping[str, Declared] = {
    "line": Declared("1 + x"),
    "parabola": Declared("1 + x + x^2"),
    "logarithm": Declared("1 + log(x)"),
    "exponential": Declared("c + a * exp(-k * x)", start=["c=0,a=1,k=1"]),
    "thermistor": Declared("R * exp(B * (1 / (x + 273.15) - 1 / 298.15))", start=["R=1e4,B=3000"]),
    "callendar-van-dusen": Declared(model="callendar-van-dusen", abscissa="t_degC"),
    "antoine, weights": Declared(model="antoine", abscissa="t_degC", weight="w"),
    "stated": Declared("1 + x", u_y="u"),
    "errors in both": Declared("1 + x + x^2", u_y="u", u_x="0.1"),
    "whole plots": Declared("c + a * exp(-k * x)", start=["c=0,a=1,k=1"]),
}
_READINGS = 4


def coverage() -> Study:
    """Intervals of calibrations of each kind, in percent."""
    return Study({name: partial(_held, name=name) for name in DECLARED}, _shares)


def _held(seed: int, name: str) -> Result:
    rng = np.random.default_rng([seed, sorted(DECLARED).index(name)])
    truth, table = TRUTHS[name], calibration(name, rng)
    model = model_of(DECLARED[name], table, truth.y_name, ["plot"] if truth.plots else [], None)
    fit = model.rows.fitted()
    made = calibration_of(fit, truth.y_name, model, table, np.arange(len(table)), ())
    own = model.weight is not None or (model.stated is not None and np.ptp(model.stated) > 0.0)
    x, y = readings(name, 1 if own else _READINGS, rng)
    # A reading whose scatter is not that of a reading of weight 1, or not that of all others, is given its own.
    made = made.with_reading(float(truth.sigma(x)[0])) if own else made
    rows, curve = made.rows(x), made.curve(x)
    variance, df = made.curve_variance(rows)
    found = infer_curve(made, y)
    known = np.isfinite(found.value)
    at = made.rows(found.value[known])
    half = student(made.reading_variance(at)[1]) * found.sd[known]
    return {
        "curve": (np.abs(curve - truth.curve(x)) <= student(df) * np.sqrt(variance)).tolist(),
        "reading": (np.abs(y - curve) <= made.half_width(rows)).tolist(),
        "infer": (~(found.lo95 > x) & ~(found.hi95 < x))[known].tolist(),
        "delta": (np.abs(found.value[known] - x[known]) <= half).tolist(),
        "of": len(x),
    }


def _shares(results: Results) -> Figures:
    """In percent of all readings; of inferred values, of those that have one."""
    told: Figures = {}
    for key in ("infer", "delta", "reading", "curve"):
        every = [one for result in results for one in result[key]]
        told[key] = 100.0 * float(np.mean(every))
    outside = sum(one["of"] - len(one["infer"]) for one in results)
    return {**told, "without a value": outside, "of": len(results)}


PARTS = {"": Part(coverage, 5000)}
