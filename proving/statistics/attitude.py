"""How far the trace of pitch-roll runs can be trusted: every effect alone and with others, clean runs, noise.

The bench is proving/truth/attitude.py, written from rotations; pitch and roll 25 x 13 over +-180 deg, six replications,
three sensors, unless said otherwise. Sizes are rms beyond the declared model over the reading's standard deviation.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import fields, replace
from functools import cache, partial
from typing import Any
from unittest.mock import patch

import numpy as np

from proving.frame import Figures, Part, Results, Study, pooled
from proving.ledger import Result
from proving.truth.attitude import D1, Bench, Outputs, Plan, Sensor, simulate, told_the_truth
from proving.truth.attitude_hidden import CLEAN, HIDDEN, PADS_AND_TEMPERATURE, sized, together
from rig.fitter.trace import aliases
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.trace import trace
from rig.procedures.attitude.trace.result import Trace

GRID = D1(180, 25, 13)
NO_ROLL = Plan(np.linspace(-180, 180, 37), np.array([0.0]))
X_ONLY = replace(CLEAN, sensors=CLEAN.sensors[:1])
CLEAN_RUNS: dict[str, tuple[Bench, Plan, dict[str, Any]]] = {
    "25 x 13, +-180 deg": (CLEAN, GRID, {}),
    "13 x 25, +-30 deg": (CLEAN, D1(30, 13, 25), {}),
    "19 x 13, +-90 deg, an interruption": (CLEAN, D1(90, 19), {"break_at": 0.4}),
    "19 x 13, random order": (CLEAN, D1(90, 19, order="random"), {}),
    "19 x 13, the same path": (CLEAN, D1(90, 19, order="same"), {}),
    "37 x 1, one sensor": (X_ONLY, NO_ROLL, {}),
    "37 x 1, one sensor, the same path": (X_ONLY, replace(NO_ROLL, order="same"), {}),
    "13 x 13, 1 replication": (CLEAN, D1(90, 13, replications=1), {}),
    "13 x 13, 2 replications": (CLEAN, D1(90, 13, replications=2), {}),
    "13 x 13, 3 replications": (CLEAN, D1(90, 13, replications=3), {}),
    "13 x 13, 12 replications": (CLEAN, D1(90, 13, replications=12), {}),
    "13 x 13, 6 replications that drift": (replace(CLEAN, offset_sd=3.0), D1(90, 13), {}),
    "13 x 13, 6 replications that walk": (replace(CLEAN, offset_sd=3.0, offset_walk=True), D1(90, 13), {}),
}
LINE, ONE = Plan(np.linspace(-180, 180, 73), np.array([0.0])), replace(CLEAN, sensors=(Sensor("x"),))
NOISE: dict[str, tuple[Bench, Plan, dict[str, Any]]] = {
    "19 x 13, +-90 deg": (CLEAN, D1(90, 19), {}),
    "37 x 13, +-180 deg": (CLEAN, D1(180, 37, 13), {}),
    "offsets of replications, 1 sd": (replace(CLEAN, offset_sd=1.0), D1(90, 19), {}),
    "random walk of offsets, 5 sd": (replace(CLEAN, offset_sd=5.0, offset_walk=True), D1(90, 19), {}),
    "offset wandering through the run, 2 sd": (replace(CLEAN, wander=2.0), D1(90, 19), {}),
    "offset wandering through the run, 10 sd": (replace(CLEAN, wander=10.0), D1(90, 19), {}),
    "head shaking by 2e-4 deg": (replace(CLEAN, jitter_deg=2e-4), D1(90, 19), {}),
    "random order, a tenth of the points missing": (CLEAN, D1(90, 19, order="random"), {"drop": 0.1}),
    "same path in every replication": (CLEAN, D1(90, 19, order="same"), {}),
    "13 x 7, 4 replications": (CLEAN, D1(180, 13, 7, replications=4), {}),
    "one sensor, no roll, 73 points": (ONE, LINE, {}),
    "one sensor, no roll, random walk 1 sd": (replace(ONE, offset_sd=1.0, offset_walk=True), LINE, {}),
    "one replication": (CLEAN, D1(90, 19, replications=1), {}),
}
WANDER: dict[str, tuple[Bench, Plan, dict[str, Any]]] = {
    f"random walk to {sd:g} sd": (replace(CLEAN, wander=sd), D1(90, 19), {}) for sd in (1.0, 2.0, 4.0, 10.0)
}
WITHOUT = (replace(PADS_AND_TEMPERATURE, compliance={}), replace(PADS_AND_TEMPERATURE, sensors=CLEAN.sensors))
EXPECTED = {("x", "isolation-pad-deflection"), ("z", "isolation-pad-deflection")} | {
    (axis, "sensitivity-temperature") for axis in "xyz"
}

TOLD = {1: 3.60, 2: 3.93}
"""Standard errors that an effect must amount to for a single test at 5 %, told which one it is, to find it in 95 %, by
its columns: of an error of the head the phase is not told."""
WITHIN = {
    "pads": 1,
    "square": 1,
    "cube": 1,
    "product": 1,
    "gear, pitch": 2,
    "pitch scale, once": 2,
    "creep": 1,
    "backlash, roll": 1,
    "hysteresis, pitch": 1,
    "voltmeter bends": 1,
}
"""Effects that show within replications, and their columns; of others it depends on which test of few is told."""


def reported(found: Trace) -> dict[frozenset[str], str]:
    """Classes reported, each the names that the data cannot tell apart, over all sensors."""
    return {frozenset({e.effect, *e.aliases}): e.effect for t in found.sensors.values() for e in t.added}


def verdict(found: Trace, hidden: Collection[str]) -> Result:
    """Whether all are named, whether there is more than hidden effects, and names that led."""
    classes = reported(found)
    leading = sorted(set(classes.values()))
    named = all(any(name in one for one in classes) for name in hidden)
    return {"named": named, "more": len(leading) > len(hidden), "effects": leading}


def error_ratios(
    found: Trace, data: AttitudeData, truth: Outputs, bench: Bench, without: Sequence[Bench]
) -> list[float]:
    """Noise-free rms error of the traced fit over that of a fit told the truth, by sensor."""
    out = []
    for sensor, traced in found.predict(data).items():
        told = told_the_truth(bench, without, data, sensor)
        ratio = np.sqrt(np.mean((traced - truth[sensor]) ** 2) / np.mean((told - truth[sensor]) ** 2))
        out.append(float(ratio))
    return out


_sized = cache(lambda name, rms: sized(name, rms, GRID))


def singles(rms: float = 0.5) -> Study:
    """Each effect alone: named, more than hidden, error ratio."""
    return Study({name: partial(_single, name=name, rms=rms) for name in HIDDEN}, _counted, pooled(_counted))


def _single(seed: int, name: str, rms: float) -> Result:
    hidden, bench = HIDDEN[name], _sized(name, rms)
    data, truth = simulate(bench, GRID, 100 + seed, **hidden.options)
    found = trace(data, validate=False)
    ratios = error_ratios(found, data, truth, bench, [CLEAN])
    return {"hidden": [hidden.effect], "ratios": ratios, **verdict(found, [hidden.effect])}


def _counted(results: Results) -> Figures:
    ratios = [ratio for one in results for ratio in one["ratios"]]
    besides = Counter(name for one in results for name in one["effects"] if name not in one["hidden"])
    return {
        "named": sum(one["named"] for one in results),
        "more than hidden": sum(one["more"] for one in results),
        "of": len(results),
        "error ratio": float(np.median(ratios)),
        "95 %": float(np.quantile(ratios, 0.95)),
        "besides": dict(besides),
    }


def pairs(rms: float = 0.5) -> Study:
    """Two effects at once, drawn at random."""
    return Study({"two at once": partial(_several, count=2, rms=rms)}, _lost)


def triples(rms: float = 0.5) -> Study:
    """Three effects at once, drawn at random."""
    return Study({"three at once": partial(_several, count=3, rms=rms)}, _lost)


def _several(seed: int, count: int, rms: float) -> Result:
    names = _drawn(count, seed)
    benches = [_sized(name, rms) for name in names]
    options = {k: v for name in names for k, v in HIDDEN[name].options.items()}
    found = trace(simulate(together(benches), GRID, 500 + seed, **options)[0], validate=False)
    return {"hidden": names, **verdict(found, [HIDDEN[name].effect for name in names])}


def _lost(results: Results) -> Figures:
    wrong = [f"{one['hidden']} as {one['effects']}" for one in results if not one["named"] or one["more"]]
    return {
        "named": sum(one["named"] for one in results),
        "more than hidden": sum(one["more"] for one in results),
        "of": len(results),
        "otherwise": wrong,
    }


def _drawn(count: int, seed: int) -> list[str]:
    """Hidden effects that share no field of the bench: a seed's are drawn after those of all seeds before it."""
    rng = np.random.default_rng(count)
    for _ in range(seed):
        _draw(rng, count)
    return _draw(rng, count)


def _draw(rng: np.random.Generator, count: int) -> list[str]:
    while True:
        names = [str(name) for name in rng.choice(list(HIDDEN), count, replace=False)]
        touched = [field for name in names for field in _fields_of(name)]
        if len(set(touched)) == len(touched):
            return names


@cache
def _fields_of(name: str) -> list[str]:
    """Names of what differs from a clean bench, the sensor's own errors included."""
    bench = HIDDEN[name].bench(HIDDEN[name].unit)
    own = [
        f"{sensor.axis} {f.name}"
        for sensor, clean in zip(bench.sensors, CLEAN.sensors, strict=True)
        for f in fields(sensor)
        if getattr(sensor, f.name) != getattr(clean, f.name)
    ]
    return own + [
        f.name for f in fields(bench) if f.name != "sensors" and getattr(bench, f.name) != getattr(CLEAN, f.name)
    ]


def clean() -> Study:
    """Nothing missing, designs and orders: runs in which anything outside stratum "noise" is reported."""
    return Study({name: partial(_clean, case=name) for name in CLEAN_RUNS}, _alarms, block=2)


def noise() -> Study:
    """The same with further designs, replications that wander, shaking heads, missing points."""
    return Study({name: partial(_clean, case=name) for name in NOISE}, _alarms, block=2)


def wander() -> Study:
    """An offset that takes a random walk through the night."""
    return Study({name: partial(_clean, case=name) for name in WANDER}, _alarms)


def _clean(seed: int, case: str) -> Result:
    """Without left-out errors, which decide nothing."""
    bench, plan, options = {**CLEAN_RUNS, **NOISE, **WANDER}[case]
    found = trace(simulate(bench, plan, seed, **options)[0], validate=False)
    return {"seed": seed, "effects": sorted(set(reported(found).values()))}


def _alarms(results: Results) -> Figures:
    which = Counter(name for one in results for name in one["effects"])
    when = {f"seed {one['seed']}": one["effects"] for one in results if one["effects"]}
    return {"reported": len(when), "of": len(results), "effects": dict(which), "in": when}


def power() -> Study:
    """How often effects of 1.4 and of 1.6 times the size that a told test needs are named."""
    which = [(name, times) for name in WITHIN for times in (1.4, 1.6)]
    cases = {f"{name}, {times:g} times": partial(_power, name=name, times=times) for name, times in which}
    return Study(cases, _named, _by_times)


@cache
def _at_power(name: str, times: float) -> Bench:
    rows = len(simulate(CLEAN, GRID, 0)[0])
    return sized(name, times * TOLD[WITHIN[name]] / np.sqrt(rows * _witnesses(name)), GRID)


def _power(seed: int, name: str, times: float) -> Result:
    hidden = HIDDEN[name]
    data, _ = simulate(_at_power(name, times), GRID, 300 + seed, **hidden.options)
    return {"times": f"{times:g} times", **verdict(trace(data, validate=False), [hidden.effect])}


def _named(results: Results) -> Figures:
    return {"named": sum(one["named"] for one in results), "of": len(results)}


def _by_times(found: Mapping[str, Results]) -> Mapping[str, Figures]:
    every = [one for results in found.values() for one in results]
    sizes = sorted({one["times"] for one in every})
    return {f"all, {size}": _named([one for one in every if one["times"] == size]) for size in sizes}


def _witnesses(name: str) -> float:
    """Sum of squares of an effect over all sensors, over that of the sensor that shows most of it."""
    hidden, squares = HIDDEN[name], []
    data, with_it = simulate(hidden.bench(hidden.unit), GRID, 0, **hidden.options)
    without = simulate(CLEAN, GRID, 0, **hidden.options)[1]
    a, r = np.radians(data.pitch_deg), np.radians(data.roll_deg)
    model = np.linalg.qr(np.column_stack([np.ones_like(a), np.sin(a), np.cos(a) * np.sin(r), np.cos(a) * np.cos(r)]))[0]
    for sensor in CLEAN.sensors:
        shape = with_it[f"{sensor.axis}_V"] - without[f"{sensor.axis}_V"]
        rest = shape - model @ (model.T @ shape)
        squares.append(float(np.sum(rest**2)) / sensor.S**2)
    return sum(squares) / max(squares)


def outliers() -> Study:
    """Five readings off by 10 to 200 sd, with and without an effect."""
    cases = {"nothing missing": partial(_outliers, cube=False), "a cube of rms 0.5": partial(_outliers, cube=True)}
    return Study(cases, _pointed)


def _outliers(seed: int, cube: bool) -> Result:
    data, _ = simulate(_sized("cube", 0.5) if cube else CLEAN, GRID, 700 + seed)
    rng = np.random.default_rng(seed)
    rows, y = rng.choice(len(data), 5, replace=False), data.outputs["x_V"].copy()
    y[rows] += rng.choice([-1, 1], 5) * rng.uniform(10, 200, 5) * np.radians(1.5e-4) * 5.0
    found = trace(replace(data, outputs={**data.outputs, "x_V": y}))
    leading = set(reported(found).values())
    name = "sensor-third-order"
    pointed = len(set(found.outliers) & set(rows.tolist()))
    return {"cube named": name in leading, "besides": bool(leading - {name}), "readings pointed at": pointed}


def _pointed(results: Results) -> Figures:
    counts = {name: sum(one[name] for one in results) for name in results[0]}
    return {**counts, "of": len(results), "of readings": 5 * len(results)}


def night() -> Study:
    """Pads and a temperature coefficient at the paper's sizes, 37 x 13: both named on every sensor, error ratio."""
    return Study({"pads and temperature": _night}, _both)


def _night(seed: int) -> Result:
    data, truth = simulate(PADS_AND_TEMPERATURE, D1(180, 37, 13), seed)
    found = trace(data)
    got = _by_sensor(found)
    ratios = error_ratios(found, data, truth, PADS_AND_TEMPERATURE, WITHOUT)
    return {"named": got >= EXPECTED, "besides": bool(got - EXPECTED), "ratios": ratios}


def _by_sensor(found: Trace) -> set[tuple[str, str]]:
    return {(sensor.removesuffix("_V"), e.effect) for sensor, t in found.sensors.items() for e in t.added}


def _both(results: Results) -> Figures:
    ratios = [ratio for one in results for ratio in one["ratios"]]
    return {
        "named": sum(one["named"] for one in results),
        "besides": sum(one["besides"] for one in results),
        "of": len(results),
        "error ratio": float(np.median(ratios)),
        "90 %": float(np.quantile(ratios, 0.9)),
    }


def width() -> Study:
    """How often a true cause does not lead its alias class, by the width of classes."""
    return Study({f"class {width:g} wide": partial(_width, width=width) for width in (6.0, 9.0)}, _not_leading)


def _width(seed: int, width: float) -> Result:
    data, _ = simulate(PADS_AND_TEMPERATURE, D1(180, 13, 13), seed)
    with patch.object(aliases, "DELTA", width):
        return {"lost": not _by_sensor(trace(data)) >= EXPECTED}


def _not_leading(results: Results) -> Figures:
    return {"not leading": sum(one["lost"] for one in results), "of": len(results)}


PARTS = {
    "singles": Part(singles),
    "pairs": Part(pairs, 100),
    "triples": Part(triples, 100),
    "clean": Part(clean, 50, 1000),
    "noise": Part(noise, 100, 1000),
    "power": Part(power),
    "wander": Part(wander, 50, 1000),
    "outliers": Part(outliers),
    "night": Part(night),
    "width": Part(width, 120, 3000),
}
