"""How far the attitude tracer can be trusted: every effect of the catalogue alone and with others, clean runs, noise.

    python -m benchmarks.trace_campaign singles [seeds] [rms]   each effect alone: named, error ratio
    python -m benchmarks.trace_campaign pairs [runs] [rms]      two effects at once, drawn at random
    python -m benchmarks.trace_campaign triples [runs] [rms]    three
    python -m benchmarks.trace_campaign clean [runs] [design] [first seed]   nothing missing: designs and orders
    python -m benchmarks.trace_campaign power [seeds] [effect]  against a test told what to look for
    python -m benchmarks.trace_campaign wander [runs]           an offset that takes a random walk through the night
    python -m benchmarks.trace_campaign outliers [runs]         a few readings far off, with and without an effect
    python -m benchmarks.trace_campaign speed                   time and memory

The bench is the one of the fitter's tests (proving/truth/attitude.py), written from rotations; pitch and roll 25 x 13
over +-180 deg, six replications, three sensors, unless said otherwise.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # tall thin matrices: threads cost more than they bring

import resource
import sys
import time
from collections import Counter
from dataclasses import fields, replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from procedures.attitude.trace import trace
from proving.truth.attitude import D1, Plan, simulate, told_the_truth
from proving.truth.attitude_hidden import CLEAN, HIDDEN, sized, together

GRID = D1(180, 25, 13)


def reported(found):
    """Classes reported, each the names that the data cannot tell apart, over all sensors."""
    return {frozenset({e.effect, *e.aliases}): e.effect for t in found.sensors.values() for e in t.effects}


def verdict(found, hidden):
    """(all named, how many more classes than hidden effects, names that led)."""
    classes = reported(found)
    named = all(any(name in one for one in classes) for name in hidden)
    leading = set(classes.values())
    return named, max(len(leading) - len(hidden), 0), leading


def error_ratios(found, data, truth, bench, without):
    """Noise-free rms error of the traced fit over that of a fit told the truth, by sensor."""
    out = []
    for sensor, traced in found.predict(data).items():
        told = told_the_truth(bench, without, data, sensor)
        out.append(np.sqrt(np.mean((traced - truth[sensor]) ** 2) / np.mean((told - truth[sensor]) ** 2)))
    return out


def singles(seeds=20, rms=0.5, only=""):
    total, good, more, ratios = 0, 0, 0, []
    for name, hidden in HIDDEN.items():
        if only and only not in name:
            continue
        bench, named, extra, besides, own = sized(name, rms, GRID), 0, 0, Counter(), []
        for seed in range(seeds):
            data, truth = simulate(bench, GRID, 100 + seed, **hidden.options)
            found = trace(data, validate=False)
            ok, surplus, leading = verdict(found, [hidden.effect])
            named, extra = named + ok, extra + (surplus > 0)
            besides.update(leading - {hidden.effect})
            own += error_ratios(found, data, truth, bench, [CLEAN])
        total, good, more = total + seeds, good + named, more + extra
        ratios += own
        print(
            f"{name:26s} rms {rms:4.2f}: named {named:3d} of {seeds}, more than hidden {extra:2d}, "
            f"error ratio {np.median(own):5.2f} {np.quantile(own, 0.95):5.2f}  {dict(besides)}",
            flush=True,
        )
    print(
        f"all: named {good} of {total}, more than hidden in {more}; error ratio median {np.median(ratios):.2f}, ",
        end="",
    )
    print(f"95 % below {np.quantile(ratios, 0.95):.2f}")


def several(count, runs, rms):
    rng, good, more, lost = np.random.default_rng(count), 0, 0, Counter()
    for run in range(runs):
        names = draw(rng, count)
        benches = [sized(name, rms, GRID) for name in names]
        options = {k: v for name in names for k, v in HIDDEN[name].options.items()}
        found = trace(simulate(together(benches), GRID, 500 + run, **options)[0], validate=False)
        ok, surplus, leading = verdict(found, [HIDDEN[name].effect for name in names])
        good, more = good + ok, more + (surplus > 0)
        if not ok or surplus:
            lost[f"{names} as {sorted(leading)}"] += 1
    print(f"{count} effects at rms {rms}: all named in {good} of {runs} runs, more reported than hidden in {more}")
    for what in lost:
        print("   ", what)


def draw(rng, count):
    """Names of hidden effects that do not share a field of the bench, drawn at random."""
    while True:
        names = [str(name) for name in rng.choice(list(HIDDEN), count, replace=False)]
        touched = [field for name in names for field in fields_of(HIDDEN[name].bench(HIDDEN[name].unit))]
        if len(set(touched)) == len(touched):
            return names


def fields_of(bench):
    """Names of what differs from a clean bench, the sensor's own errors included."""
    own = [
        f"{sensor.axis} {f.name}"
        for sensor, clean in zip(bench.sensors, CLEAN.sensors, strict=True)
        for f in fields(sensor)
        if getattr(sensor, f.name) != getattr(clean, f.name)
    ]
    return own + [
        f.name for f in fields(bench) if f.name != "sensors" and getattr(bench, f.name) != getattr(CLEAN, f.name)
    ]


def pairs(runs=100, rms=0.5):
    several(2, runs, rms)


def triples(runs=100, rms=0.5):
    several(3, runs, rms)


NO_ROLL = Plan(np.linspace(-180, 180, 37), np.array([0.0]))
X_ONLY = replace(CLEAN, sensors=CLEAN.sensors[:1])
CLEAN_RUNS = {
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


def clean(runs=50, only="", first=1000):
    for label, (bench, plan, options) in CLEAN_RUNS.items():
        if only in label:
            _count(label, bench, plan, runs, options, first)


def wander(runs=50):
    for sd in (1.0, 2.0, 4.0, 10.0):
        _count(f"random walk to {sd:g} sd over the night", replace(CLEAN, wander=sd), D1(90, 19), runs, {})


def _count(label, bench, plan, runs, options, first=1000):
    """Runs in which anything outside stratum "noise" is reported; without left-out errors, which decide nothing."""
    alarms, what, when = 0, Counter(), {}
    for seed in range(first, first + runs):
        found = trace(simulate(bench, plan, seed, **options)[0], validate=False)
        leading = set(reported(found).values())
        alarms += bool(leading)
        what.update(leading)
        if leading:
            when[seed] = sorted(leading)
    print(f"{label:44s} something reported in {alarms:3d} of {runs} runs  {dict(what)}", flush=True)
    for seed, names in when.items():
        print(f"    seed {seed}: {', '.join(names)}", flush=True)


TOLD = {1: 3.60, 2: 3.93}
"""Standard errors that an effect must amount to for a single test at 5 %, told which one it is, to find it in 95 %, by
its columns: of an error of the head the phase is not told."""


def power(seeds=20, only=""):
    """How often effects of 1.4 and of 1.6 times that size are named."""
    found = {1.4: 0, 1.6: 0}
    names = [name for name in WITHIN if only in name]
    for name in names:
        hidden, own = HIDDEN[name], {}
        for times in found:
            rms = times * TOLD[WITHIN[name]] / np.sqrt(len(simulate(CLEAN, GRID, 0)[0]) * witnesses(name))
            bench = sized(name, rms, GRID)
            runs = (simulate(bench, GRID, 300 + seed, **hidden.options)[0] for seed in range(seeds))
            own[times] = sum(verdict(trace(data, validate=False), [hidden.effect])[0] for data in runs)
            found[times] += own[times]
        print(f"{name:26s} found of {seeds} at so many times what a told test needs: {own}", flush=True)
    print(f"all: of {seeds * len(names)}: {found}")


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


def witnesses(name):
    """Sum of squares of an effect over all sensors, over that of the sensor that shows most of it."""
    hidden, squares = HIDDEN[name], []
    data, with_it = simulate(hidden.bench(hidden.unit), GRID, 0, **hidden.options)
    without = simulate(CLEAN, GRID, 0, **hidden.options)[1]
    a, r = np.radians(data.pitch_deg), np.radians(data.roll_deg)
    model = np.linalg.qr(np.column_stack([np.ones_like(a), np.sin(a), np.cos(a) * np.sin(r), np.cos(a) * np.cos(r)]))[0]
    for sensor in CLEAN.sensors:
        shape = with_it[f"{sensor.axis}_V"] - without[f"{sensor.axis}_V"]
        squares.append(np.sum((shape - model @ (model.T @ shape)) ** 2) / sensor.S**2)
    return sum(squares) / max(squares)


def outliers(runs=20):
    for label, bench in (("nothing missing", CLEAN), ("a cube of rms 0.5", sized("cube", 0.5, GRID))):
        named, besides, flagged = 0, 0, 0
        for seed in range(runs):
            data, _ = simulate(bench, GRID, 700 + seed)
            rng = np.random.default_rng(seed)
            rows, y = rng.choice(len(data), 5, replace=False), data.outputs["x_V"].copy()
            y[rows] += rng.choice([-1, 1], 5) * rng.uniform(10, 200, 5) * np.radians(1.5e-4) * 5.0
            found = trace(replace(data, outputs={**data.outputs, "x_V": y}))
            leading = set(reported(found).values())
            named += "sensor-third-order" in leading
            besides += bool(leading - {"sensor-third-order"})
            flagged += len(set(found.outliers) & set(rows.tolist()))
        print(f"five readings off by 10 to 200 sd, {label}: cube named in {named} of {runs}, ", end="")
        print(f"anything besides in {besides}, {flagged} of {5 * runs} readings pointed at")


def speed():
    plan = D1(180, 37, 13)
    for label, bench in (
        ("nothing to add", CLEAN),
        ("two effects", together([sized("pads", 2, plan), sized("cube", 2, plan)])),
    ):
        data, _ = simulate(bench, plan, 0)
        start = time.process_time()
        trace(data)
        print(f"{len(data)} points, three sensors, {label}: {time.process_time() - start:.2f} s of processor time")
    print(f"largest memory of the process {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB")


if __name__ == "__main__":
    command, *numbers = sys.argv[1:] or ["speed"]
    arguments = [float(n) if "." in n else int(n) if n.isdigit() else n for n in numbers]
    {f.__name__: f for f in (singles, pairs, triples, clean, power, wander, outliers, speed)}[command](*arguments)
