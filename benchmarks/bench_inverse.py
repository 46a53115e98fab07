"""Three-axis inference a second, beside MINPACK.

    python -m benchmarks.bench_inverse

Corrections alone take one core; with standard deviations, intervals and flags, blocks of readings share all. So both
rates are printed: by the clock, and by processor time of all cores together.

The bench is proving/truth/attitude.py, written from rotations. How near corrections come to
iteration to the end: tests/infer/test_inverse_fast.py. Whether intervals hold: proving/statistics/inference.py.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # figures are per core

import time

import numpy as np
from scipy.optimize import leastsq

from proving.truth.attitude import D1, Bench, simulate, volts
from rig.procedures.attitude.infer import ThreeAxis, calibrate_package, infer_attitude
from rig.procedures.attitude.infer.blocks import cores

BENCH = Bench()
READINGS = 2_000_000
ROUNDS = 7


def speed():
    calibration = calibrate_package(simulate(BENCH, D1(180, 19, 13), 0)[0])
    rng = np.random.default_rng(1)
    pitch, roll = rng.uniform(-89, 89, READINGS), rng.uniform(-180, 180, READINGS)
    v = volts(BENCH, pitch, roll) + rng.normal(size=(READINGS, 3)) * calibration.sigma_V
    three = ThreeAxis.of(calibration.offsets_V, calibration.matrix, calibration.sigma_V)
    few = 20_000
    best = minpack(calibration, v[:few])
    print(f"{READINGS:,} readings of three axes, {cores()} cores, medians of {ROUNDS}; errors: MINPACK on {few:,}")
    for label, action in (
        ("one correction", lambda: three.angles_deg(v, 1)),
        ("two corrections", lambda: three.angles_deg(v, 2)),
        ("with sd, 95 % intervals, flags", lambda: _angles(infer_attitude(calibration, v))),
    ):
        took = []
        for _ in range(ROUNDS):
            start = time.perf_counter(), time.process_time()
            found = action()
            took.append((time.perf_counter() - start[0], time.process_time() - start[1]))
        by_clock, by_processor = READINGS / np.median(took, axis=0) / 1e6
        error = max(np.abs(_turn(f[:few] - b)).max() for f, b in zip(_scaled(found), _scaled(best), strict=True))
        print(f"  {label:32s} {by_clock:7.1f} million/s, {by_processor:.1f} by processor time, within {error:.1e} rad")
    start = time.perf_counter()
    minpack(calibration, v[:few])
    print(f"  {'MINPACK (leastsq), a call each':32s} {few / (time.perf_counter() - start) / 1e6:7.3f} million/s")


def _angles(found):
    return found.pitch_deg, found.roll_deg


def _scaled(angles):
    """Pitch, and roll times cos(pitch): what turns the package by as much at every attitude; rad."""
    pitch, roll = np.radians(angles)
    return pitch, np.where(np.isnan(roll), np.nan, roll) * np.cos(pitch[: len(roll)])


def _turn(difference):
    """Full turns of roll, which come scaled, are told by their size."""
    return np.where(np.abs(difference) > 1e-2, 0.0, np.nan_to_num(difference))


def minpack(calibration, v):
    b, m, sigma = calibration.offsets_V, calibration.matrix, calibration.sigma_V
    start = ThreeAxis.of(b, m, sigma).angles_deg(v, 1)
    out = np.empty((2, len(v)))
    for i, (row, pitch, roll) in enumerate(zip(v, *np.radians(start), strict=True)):

        def misfit(z, row=row):
            sa, ca, sr, cr = np.sin(z[0]), np.cos(z[0]), np.sin(z[1]), np.cos(z[1])
            return (row - b - m @ np.array([sa, -sr * ca, -cr * ca])) / sigma

        out[:, i] = leastsq(misfit, (pitch, roll), xtol=1e-14, ftol=1e-14)[0]
    return np.degrees(out)


if __name__ == "__main__":
    speed()
