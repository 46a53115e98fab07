"""Figures of the fitter and the tracer, each by one command from the project's root.

    python -m benchmarks.bench_fit speed    time of a fit and of a trace, 2,886 points, three sensors
    python -m benchmarks.bench_fit demo     20 nights with isolation pads and a temperature coefficient nobody declared
    python -m benchmarks.bench_fit clean    100 runs of each kind in which nothing is missing
    python -m benchmarks.bench_fit noise    the same with replications that wander, shaking heads, missing points
    python -m benchmarks.bench_fit delta    how often a true cause does not lead its alias class, by its width

The bench is the one of the fitter's tests (proving/truth/attitude.py), written from rotations.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # tall thin matrices: threads cost more than they bring

import sys
import time
from collections import Counter
from dataclasses import replace

import numpy as np

from fitter.trace import aliases
from procedures.attitude.fit import fit_attitude
from procedures.attitude.model import attitude_columns, fit_columns
from procedures.attitude.trace import trace
from proving.truth.attitude import D1, Bench, Plan, Sensor, simulate, told_the_truth

CLEAN = Bench()
# sigma_prec 1.5e-4 deg; pads 4e-4 deg on x; temperature as row 28(a) to (b) of Table 2
DEMO = Bench(
    sensors=tuple(Sensor(axis, S_per_degC=1.1e-4) for axis in "xyz"),
    compliance={("y", "x"): 8e-4},
)
WITHOUT = (replace(DEMO, compliance={}), replace(DEMO, sensors=CLEAN.sensors))
NIGHT = D1(180, 37, 13)
EXPECTED = {(f"{s}_V", "sensitivity-temperature") for s in "xyz"} | {
    (f"{s}_V", "isolation-pad-deflection") for s in "xz"
}


def names(found):
    return {(s, e.effect) for s, t in found.sensors.items() for e in t.effects}


def best_of(times, action):
    took = []
    for _ in range(times):
        start = time.perf_counter()
        action()
        took.append(time.perf_counter() - start)
    return min(took)


def speed():
    data, _ = simulate(DEMO, NIGHT, seed=0)
    columns = attitude_columns(data.pitch_deg, data.roll_deg)
    output = data.outputs["x_V"]
    print(f"least squares, 2,886 points          {best_of(50, lambda: fit_columns(columns, output)) * 1e3:8.3f} ms")
    print(f"  with its columns                   {best_of(50, lambda: _from_angles(data)) * 1e3:8.3f} ms")
    print(f"  with Table 2 (fit_attitude)        {best_of(20, lambda: fit_attitude(data, 'x_V')) * 1e3:8.3f} ms")
    print(f"trace, three sensors, two effects    {best_of(3, lambda: trace(data)) * 1e3:8.0f} ms")
    clean, _ = simulate(CLEAN, NIGHT, seed=0)
    print(f"trace, three sensors, nothing to add {best_of(3, lambda: trace(clean)) * 1e3:8.0f} ms")


def _from_angles(data):
    return fit_columns(attitude_columns(data.pitch_deg, data.roll_deg), data.outputs["x_V"])


def demo(seeds=20):
    named, besides, ratios = 0, 0, []
    for seed in range(seeds):
        data, clean = simulate(DEMO, NIGHT, seed)
        found = trace(data)
        got = names(found)
        named += got >= EXPECTED
        besides += bool(got - EXPECTED)
        ratios += [_error_ratio(data, clean, found, sensor) for sensor in data.sensors]
    print(f"both effects named on {named} of {seeds} seeds; anything besides on {besides}")
    print(f"noise-free prediction error over that of a fit told the truth: median {np.median(ratios):.3f}, ", end="")
    print(f"90 % below {np.quantile(ratios, 0.9):.3f}")


def _error_ratio(data, clean, found, sensor):
    """RMS error of the traced fit over that of least squares given the true columns."""
    predictions = found.predict(data)[sensor], told_the_truth(DEMO, WITHOUT, data, sensor)
    traced, told = (np.sqrt(np.mean((p - clean[sensor]) ** 2)) for p in predictions)
    return traced / told


def delta(seeds=120):
    lost = Counter()
    for seed in range(3000, 3000 + seeds):
        data, _ = simulate(DEMO, D1(180, 13, 13), seed)
        for width in (6.0, 9.0):
            aliases.DELTA = width
            lost[width] += not names(trace(data)) >= EXPECTED
    for width, count in lost.items():
        print(f"class {width:g} wide: a true cause not leading its class in {count} of {seeds} runs")


def false_alarms(label, bench, plan, seeds=100, **options):
    runs, what = 0, Counter()
    for seed in range(seeds):
        got = names(trace(simulate(bench, plan, 1000 + seed, **options)[0]))
        runs += bool(got)
        what.update(effect for _, effect in got)
    print(f"{label:44s} something reported in {runs:3d} of {seeds} runs  {dict(what)}", flush=True)


def clean():
    false_alarms("13 x 25, +-30 deg, 6 replications", CLEAN, D1(30, 13, 25))
    false_alarms("19 x 13, +-90 deg", CLEAN, D1(90, 19))
    false_alarms("37 x 13, +-180 deg", CLEAN, NIGHT)


def noise():
    false_alarms("offsets of replications, 1 sd", replace(CLEAN, offset_sd=1.0), D1(90, 19))
    false_alarms(
        "offsets of replications, random walk 5 sd", replace(CLEAN, offset_sd=5.0, offset_walk=True), D1(90, 19)
    )
    false_alarms("offset wandering through the run, 2 sd", replace(CLEAN, wander=2.0), D1(90, 19))
    false_alarms("offset wandering through the run, 10 sd", replace(CLEAN, wander=10.0), D1(90, 19))
    false_alarms("head shaking by 2e-4 deg", replace(CLEAN, jitter_deg=2e-4), D1(90, 19))
    false_alarms("random order, a tenth of the points missing", CLEAN, D1(90, 19, order="random"), drop=0.1)
    false_alarms("same path in every replication", CLEAN, D1(90, 19, order="same"))
    false_alarms("13 x 7, 4 replications", CLEAN, D1(180, 13, 7, replications=4))
    line = Plan(np.linspace(-180, 180, 73), np.array([0.0]))
    one = replace(CLEAN, sensors=(Sensor("x"),))
    false_alarms("one sensor, no roll, 73 points", one, line)
    false_alarms("one sensor, no roll, random walk 1 sd", replace(one, offset_sd=1.0, offset_walk=True), line)
    false_alarms("one replication", CLEAN, D1(90, 19, replications=1))


if __name__ == "__main__":
    for name in sys.argv[1:] or ["speed"]:
        {"speed": speed, "demo": demo, "clean": clean, "noise": noise, "delta": delta}[name]()
