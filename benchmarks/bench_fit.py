"""Time of a fit and of a trace on one core: 2,886 points, three sensors.

    python -m benchmarks.bench_fit

The bench is proving/truth/attitude.py, written from rotations.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # tall thin matrices: threads cost more than they bring

import time

from procedures.attitude.fit import fit_attitude
from procedures.attitude.model import attitude_columns, fit_columns
from procedures.attitude.trace import trace
from proving.truth.attitude import D1, Bench, simulate
from proving.truth.attitude_hidden import PADS_AND_TEMPERATURE

NIGHT = D1(180, 37, 13)


def best_of(times, action):
    took = []
    for _ in range(times):
        start = time.perf_counter()
        action()
        took.append(time.perf_counter() - start)
    return min(took)


def speed():
    data, _ = simulate(PADS_AND_TEMPERATURE, NIGHT, seed=0)
    columns = attitude_columns(data.pitch_deg, data.roll_deg)
    output = data.outputs["x_V"]
    print(f"least squares, 2,886 points          {best_of(50, lambda: fit_columns(columns, output)) * 1e3:8.3f} ms")
    print(f"  with its columns                   {best_of(50, lambda: _from_angles(data)) * 1e3:8.3f} ms")
    print(f"  with Table 2 (fit_attitude)        {best_of(20, lambda: fit_attitude(data, 'x_V')) * 1e3:8.3f} ms")
    print(f"trace, three sensors, two effects    {best_of(3, lambda: trace(data)) * 1e3:8.0f} ms")
    clean, _ = simulate(Bench(), NIGHT, seed=0)
    print(f"trace, three sensors, nothing to add {best_of(3, lambda: trace(clean)) * 1e3:8.0f} ms")


def _from_angles(data):
    return fit_columns(attitude_columns(data.pitch_deg, data.roll_deg), data.outputs["x_V"])


if __name__ == "__main__":
    speed()
