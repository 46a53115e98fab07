"""Coverage of intervals of runs that stop once they are narrow enough, and replications beside an oracle's.

python -m proving goals [--seeds 5] [--add points] [--type_b 1.0] [--shape rectangular] [--effect 1.0] [--power 2]

Each run is a straight line over five settings with normal errors, three replications at first and thirty at most, and a
goal of its own for the slope. With `--type_b` the reference has an error as well, of so many standard errors of a run
that just meets the goal; the goal is then an expanded uncertainty with it. The oracle knows the error's standard
deviation, and which model is true.

With `--add points` not whole replications are added but a reading at either end, where a slope is known best; the
oracle adds these, too.

With `--effect` the declared model lacks a square, or a cube of the setting (`--power`), whose rms beside that model is
so many standard deviations of a reading. As in a loop, every look is by the model so far; a test as strict as a trace's
finds the effect in the replications, and a further run, as long as its size there asks for, has to show it. Then it is
in the model, and replications go on by this one.
"""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass
from functools import partial
from typing import Any

import numpy as np

from proving.frame import Figures, Part, Results, Study
from proving.ledger import Result
from rig.fitter.arrays import FloatArray
from rig.fitter.budget import Influence, TypeA, budgets
from rig.fitter.confirm.predict import SELECTED
from rig.fitter.quantiles import DISTINGUISHED, f_tail, t_limit
from rig.fitter.sequential import LEVEL, t_of, widening

X = np.linspace(-1.0, 1.0, 5)
FIRST, MOST, SLOPE = 3, 30, 0.7
SHOWS = np.linspace(-1.0, 1.0, 6)
"""Settings of a further run, each as often as is needed."""
RUNS, LONGEST = 3, 20
"""Maximum number of further runs, and of readings at each of their settings."""
SURE = 1.645
"""Standard errors beyond the limit that are exceeded with a probability of 95 %."""


@dataclass(frozen=True)
class Stopped:
    """A run that has stopped: whether its interval has the true slope, by Student's t alone too, and replications."""

    covered: bool
    by_t: bool
    replications: float
    oracle: float
    met: bool
    confirmed: bool = False


def stopped(
    rng: np.random.Generator,
    type_b: float = 0.0,
    shape: Any = "normal",
    effect: float = 0.0,
    power: int = 2,
    added: FloatArray = X,
) -> Stopped:
    """Simulate one run; the reference's error is `type_b` standard errors of a run that just meets the goal.

    Args:
        rng: of the run.
        type_b: the reference's error.
        shape: its distribution.
        effect: rms of what the declared model lacks, over the standard deviation of a reading.
        power: of the setting in it.
        added: settings of what is added at once.
    """
    sigma = math.exp(rng.uniform(-1.0, 1.0))
    looks, part = round((MOST - FIRST) * len(X) / len(added)) + 1, len(added) / len(X)
    every = np.concatenate([np.tile(X, FIRST), np.tile(added, looks - 1)])
    used = every[: len(X) * FIRST], *(every[: len(X) * FIRST + n * len(added)] for n in range(1, looks))
    powers = power if effect else None
    errors = [_error(_model(x, powers)) for x in used]
    needed = math.exp(rng.uniform(math.log(2.0), math.log(36.0)))
    at_goal = _error(_model(X, powers)) / math.sqrt(needed) if part == 1.0 else _between(errors, needed / MOST)
    u_b = type_b * sigma * at_goal
    wrong = u_b * (rng.standard_normal() if shape == "normal" else math.sqrt(3.0) * rng.uniform(-1.0, 1.0))
    goal = 1.96 * math.hypot(sigma * at_goal, u_b)
    oracle = next((n for n, error in enumerate(errors) if error <= at_goal * (1.0 + 1e-9)), looks - 1)
    declared = _model(X)
    size = effect * sigma / math.sqrt(_squares(declared, X**power) / len(X))
    df_first = FIRST * len(X) - 2
    more = float(len(X)) if part == 1.0 else round(df_first / FIRST * part, 1)
    factor = widening(float(df_first), more, looks, FIRST / part)
    y = SLOPE * every + size * every**power + sigma * rng.standard_normal(len(every))
    confirmed, runs = False, 0
    for n, x in enumerate(used):
        read = y[: len(x)]
        if effect and not confirmed and runs < RUNS and (seen := _found(x, read, power)):
            runs, confirmed = runs + 1, _shown(rng, size, sigma, power, seen)
        model = _model(x, power if confirmed else None)
        fitted = np.linalg.lstsq(model, read, rcond=None)[0]
        df = len(x) - model.shape[1]
        s = math.sqrt(_squares(model, read) / df) * _error(model)
        half = _expanded(factor * s, df, u_b, shape)
        if half <= goal or n == looks - 1:
            off = abs(float(fitted[1]) + wrong - SLOPE)
            made, best = (FIRST + part * count for count in (n, oracle))
            return Stopped(off <= half, off <= _expanded(s, df, u_b, shape), made, best, half <= goal, confirmed)
    raise AssertionError


def _between(errors: list[float], part: float) -> float:
    """A standard error of the slope that the first look exceeds, or the last one does not reach, by this part."""
    return math.exp(np.interp(part, [2.0 / MOST, 36.0 / MOST], np.log([1.2 * errors[0], 0.9 * errors[-1]])))


def _model(x: FloatArray, power: int | None = None) -> FloatArray:
    """Columns of a straight line, and of a power beside it."""
    return np.column_stack([np.ones_like(x), x, *([] if power is None else [x**power])])


def _error(model: FloatArray) -> float:
    """Standard error of the slope, over the standard deviation of a reading."""
    return math.sqrt(float(np.linalg.inv(model.T @ model)[1, 1]))


def _squares(model: FloatArray, y: FloatArray) -> float:
    """Residual sum of squares."""
    return float(np.sum((y - model @ np.linalg.lstsq(model, y, rcond=None)[0]) ** 2))


def _found(x: FloatArray, y: FloatArray, power: int) -> float:
    """Size of the effect over the standard deviation of a reading, if a trace of these readings finds it; or 0."""
    lacking = _model(x, power)
    without, beside = (_squares(one, y) for one in (_model(x), lacking))
    df = len(y) - lacking.shape[1]
    if f_tail((without - beside) / (beside / df), 1, df) >= SELECTED:
        return 0.0
    return abs(float(np.linalg.lstsq(lacking, y, rcond=None)[0][2])) / math.sqrt(beside / df)


def _shown(rng: np.random.Generator, size: float, sigma: float, power: int, seen: float) -> bool:
    """Whether a further run shows the effect by itself; its length is planned by the size that was seen."""
    for count in range(2, LONGEST + 1):
        model = _model(np.tile(SHOWS, count), power)
        error, df = math.sqrt(float(np.linalg.inv(model.T @ model)[2, 2])), len(model) - model.shape[1]
        limit = t_limit(DISTINGUISHED, df)
        if seen > error * (limit + SURE):
            break
    y = size * model[:, 2] + sigma * rng.standard_normal(len(model))
    fitted, s = np.linalg.lstsq(model, y, rcond=None)[0], math.sqrt(_squares(model, y) / df)
    return bool(abs(float(fitted[2])) > limit * error * s)


def _expanded(s: float, df: float, u_b: float, shape: Any) -> float:
    """Expanded uncertainty of the slope, 95 %."""
    if u_b == 0.0:
        return t_of(df) * s
    by = Influence("reference", "", "B", np.array([u_b]), distribution=shape)
    slope = TypeA(np.array([[s * s]]), df)
    told = budgets(["slope"], [""], np.zeros(1), slope, [by], shapes="where limits dominate", forecast=True)
    return told[0].expanded_uncertainty


def goals(
    runs: int = 1000, type_b: float = 0.0, shape: str = "normal", effect: float = 0.0, power: int = 2,
    add: str = "replications",
) -> Study:  # fmt: skip
    """Coverage of intervals, to be 94 to 96 %; `--type_b` in standard errors of a run, `--shape` normal or rectangular,
    `--effect` in standard deviations of a reading, `--power` of the setting, `--add` replications or points.

    A seed is a stream of runs.
    """
    case = partial(_stream, runs=runs, how=(type_b, shape, effect, power), ends=add == "points")
    return Study({"runs": case}, _figures, fails=lambda rows: not 0.94 <= rows["runs"]["intervals that hold"] <= 0.96)


def _stream(seed: int, runs: int, how: tuple[float, Any, float, int], ends: bool) -> Result:
    rng, added = np.random.default_rng(seed), X[[0, -1]] if ends else X
    return {"runs": [astuple(stopped(rng, *how, added)) for _ in range(runs)]}


def _figures(results: Results) -> Figures:
    told = [Stopped(*one) for result in results for one in result["runs"]]
    met = [one for one in told if one.met]
    confirmed = [one.covered for one in told if one.confirmed]
    early = [one.covered for one in told if one.replications < one.oracle]
    ratio = np.mean([one.replications for one in met]) / np.mean([one.oracle for one in met])
    return {
        "intervals that hold": float(np.mean([one.covered for one in told])),
        "stated": LEVEL,
        "by Student's t alone": float(np.mean([one.by_t for one in told])),
        "of runs that stopped before the oracle": float(np.mean(early)),
        "with a confirmed effect": len(confirmed),
        "of these, intervals that hold": float(np.mean(confirmed)) if confirmed else None,
        "goal met": len(met),
        "replications over the oracle's": float(ratio),
        "of": len(told),
    }


PARTS = {"": Part(goals, 5, 1)}
