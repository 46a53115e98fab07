"""Figures of inferring attitude, each by one command from the project's root.

    python -m benchmarks.bench_inverse speed       three-axis inference a second on one core, beside MINPACK
    python -m benchmarks.bench_inverse coverage    95 % intervals over 10,000 simulated calibrations a cell
    python -m benchmarks.bench_inverse azimuth     the same of Omega, A and the sensitive axis, by how far it leans
    python -m benchmarks.bench_inverse drift       the same where offset and sensitivity differ between replications
    python -m benchmarks.bench_inverse coverage 500

The bench is the one of the fitter's tests (proving/truth/attitude.py), written from rotations.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # figures are per core

import sys
import time
from dataclasses import replace

import numpy as np
from scipy.optimize import leastsq

from fitter.quantiles import t_limit
from procedures.attitude.data import AttitudeData
from procedures.attitude.infer import ThreeAxis, calibrate_package, infer_attitude
from procedures.attitude.model import (
    attitude_columns,
    attitude_parameters,
    fit_columns,
    linear_coefficients,
    sensitive_axis,
)
from proving.truth.attitude import D1, Bench, Plan, Sensor, rows_of, simulate

BENCH = Bench()
NAMES = ("x_V", "y_V", "z_V")
READINGS = 2_000_000
ROUNDS = 7


def volts(bench, pitch, roll, names=NAMES):
    zero = np.zeros_like(pitch)
    out = bench.outputs(pitch, roll, zero + 23.0, zero + 14.0, zero, zero, zero)
    return np.column_stack([out[name] for name in names])


def speed():
    calibration = calibrate_package(simulate(BENCH, D1(180, 19, 13), 0)[0])
    rng = np.random.default_rng(1)
    pitch, roll = rng.uniform(-89, 89, READINGS), rng.uniform(-180, 180, READINGS)
    v = volts(BENCH, pitch, roll) + rng.normal(size=(READINGS, 3)) * calibration.sigma_V
    three = ThreeAxis.of(calibration.offsets_V, calibration.matrix, calibration.sigma_V)
    few = 20_000
    best = minpack(calibration, v[:few])
    print(f"{READINGS:,} readings of three axes, one core, median of {ROUNDS}; errors against MINPACK on {few:,}")
    for label, action in (
        ("one correction", lambda: three.angles_deg(v, 1)),
        ("two corrections", lambda: three.angles_deg(v, 2)),
        ("with sd, 95 % intervals, flags", lambda: _angles(infer_attitude(calibration, v))),
    ):
        took = []
        for _ in range(ROUNDS):
            start = time.perf_counter()
            found = action()
            took.append(time.perf_counter() - start)
        error = max(np.abs(_turn(f[:few] - b)).max() for f, b in zip(_scaled(found), _scaled(best), strict=True))
        print(f"  {label:32s} {READINGS / np.median(took) / 1e6:7.1f} million/s   within {error:.1e} rad")
    start = time.perf_counter()
    minpack(calibration, v[:few])
    print(f"  {'MINPACK (leastsq), a call each':32s} {few / (time.perf_counter() - start) / 1e6:7.3f} million/s")
    accuracy(three, rng)


def accuracy(three, rng):
    """Corrections against iteration to the end, for noise of other sizes."""
    pitch, roll = rng.uniform(-89, 89, 200_000), rng.uniform(-180, 180, 200_000)
    exact = volts(BENCH, pitch, roll)
    for noise in (1e-5, 1e-4, 1e-3):
        v = exact + rng.normal(0, 5 * noise, exact.shape)
        for ratio in (1.0, 10.0):
            weighed = ThreeAxis.of(three.offsets_V, _matrix(three), np.array([1.0, ratio, ratio]))
            end = _scaled(weighed.angles_deg(v, 6))
            errors = [
                max(np.abs(_turn(f - e)).max() for f, e in zip(_scaled(weighed.angles_deg(v, s)), end, strict=True))
                for s in (1, 2)
            ]
            print(
                f"  noise {noise:.0e} g, y and z weighed as {ratio:2.0f} times worse: "
                f"one correction {errors[0]:.0e} rad, two {errors[1]:.0e} rad"
            )


def _matrix(three):
    return np.linalg.inv(three.to_package @ three.to_principal)


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


# package, (pitch, roll): outside every singular zone of the package
CELLS = {
    "x, no roll": [(0, 0), (30, 0), (-60, 0), (80, 0)],
    "x, measured roll": [(0, 0), (30, 90), (-60, 150), (80, -45)],
    "x-y": [(0, 0), (30, 45), (-60, -60), (75, 30)],
    "x-y, measured roll": [(0, 0), (30, 90), (-60, 150), (89, 45)],
    "x-z": [(0, 90), (30, 45), (-60, 120), (75, 60)],
    "x-z, measured roll": [(0, 0), (30, 90), (90, 20), (120, -45)],
    "x-y-z": [(0, 0), (30, 90), (-60, 150), (85, -45)],
    "x-y-z, measured roll": [(0, 0), (30, 90), (90, 20), (150, -45)],
}
ROLL_SD_DEG = 2e-3


def coverage(calibrations=10_000):
    """Every calibration is simulated afresh: 5 x 8 points, twice; 13 points, twice, without roll; unequal sensors."""
    sensors = (Sensor("x"), Sensor("y", b=-0.003, S=5.1, Omega_deg=1.0), Sensor("z", b=0.001, S=4.9, A_deg=200.0))
    bench = replace(BENCH, sensors=sensors)
    sigma = np.radians(BENCH.sigma_deg) * np.array([5.0, 5 * 5.1, 5 * 4.9])  # y and z five times worse
    grid = Plan(np.linspace(-90, 90, 5), np.arange(8) * 45.0, 2)
    line = Plan(np.linspace(-90, 90, 13), np.zeros(1), 2)
    designs = {roll: _truth(bench, plan) for roll, plan in ((True, grid), (False, line))}
    rng = np.random.default_rng(20_000)
    held = {name: np.zeros((2, len(at))) for name, at in CELLS.items()}
    start = time.perf_counter()
    for _ in range(calibrations):
        calibrated = {}
        for roll, (data, exact) in designs.items():
            noisy = exact + rng.normal(size=exact.shape) * sigma
            run = replace(data, outputs=dict(zip(NAMES, noisy.T, strict=True)))
            names = NAMES if roll else NAMES[:1]
            calibrated[roll] = calibrate_package(run, names)
        for name, at in CELLS.items():
            pitch, roll = np.array(at, float).T
            axes = [f"{a}_V" for a in name.split(",")[0].split("-")]
            calibration = calibrated["no roll" not in name]
            package = calibration.only(axes)
            v = (
                volts(bench, pitch, roll, axes)
                + rng.normal(size=(len(at), len(axes))) * sigma[: len(NAMES)][[NAMES.index(a) for a in axes]]
            )
            given = {}
            if "measured" in name:
                given = {"roll_deg": roll + rng.normal(0, ROLL_SD_DEG, len(at)), "roll_sd_deg": ROLL_SD_DEG}
            found = infer_attitude(package, v, near_deg=(pitch, roll), **given)
            held[name][0] += (found.pitch_lo95_deg <= pitch) & (pitch <= found.pitch_hi95_deg)
            half = found.roll_hi95_deg - found.roll_deg
            held[name][1] += np.abs((found.roll_deg - roll + 180) % 360 - 180) <= half
    print(f"{calibrations:,} calibrations a cell, {time.perf_counter() - start:.0f} s; held by the 95 % interval, %")
    shares = []
    for name, at in CELLS.items():
        with_roll = name in ("x-y", "x-z", "x-y-z")
        for i, (pitch, roll) in enumerate(at):
            share = 100 * held[name][: 1 + with_roll, i] / calibrations
            shares += list(share)
            text = f"pitch {share[0]:.1f}" + (f", roll {share[1]:.1f}" if with_roll else "")
            print(f"  {name:22s} at pitch {pitch:4d}, roll {roll:4d} deg: {text}")
    print(f"least {min(shares):.1f}, greatest {max(shares):.1f}, mean {np.mean(shares):.2f}, of {len(shares)} cells")


def azimuth(calibrations=10_000):
    """An x sensor that leans by so many standard deviations of Omega, calibrated at 5 x 8 points, twice."""
    plan = Plan(np.linspace(-90, 90, 5), np.arange(8) * 45.0, 2)
    sigma_V, rng = 2.5e-5, np.random.default_rng(30_000)
    data, _ = _truth(BENCH, plan)
    h = attitude_columns(data.pitch_deg, data.roll_deg)
    sd_deg = np.degrees(sigma_V / 5.0 * np.sqrt(np.linalg.inv(h.T @ h)[2, 2]))  # across m; both ways alike here
    print(f"{calibrations:,} calibrations a cell; of 95 % intervals held, %, where one is shown")
    print("  Omega / sd     A   shown  Omega      A    m_x    m_y    m_z")
    for lean in (0.0, 2.0, 4.0, 5.0, 6.0, 8.0, 12.0, 50.0):
        for A in (20.0, 135.0, 180.0):
            c = linear_coefficients(0, 0.01, 5.0, lean * sd_deg, A)
            shown, held, m_held = 0, np.zeros(2), np.zeros(3)
            for _ in range(calibrations):
                fit = fit_columns(h, h @ c + rng.normal(0.0, sigma_V, len(h)))
                p = attitude_parameters(0, fit.coefficients, fit.covariance)
                m_held += np.abs(p.m_V - sensitive_axis(c)) <= t_limit(0.95, fit.df) * np.sqrt(np.diag(p.m_covariance))
                _, _, Omega, azimuths = p.intervals(fit.df)
                if Omega is None or azimuths is None:
                    continue
                shown += 1
                middle, half = np.mean(azimuths), np.ptp(azimuths) / 2.0
                held += Omega[0] <= lean * sd_deg <= Omega[1], abs((A - middle + 180.0) % 360.0 - 180.0) <= half
            both = "".join(f"{100 * h / shown:7.1f}" for h in held) if shown > 0.01 * calibrations else "      -      -"
            axis = "".join(f"{100 * h / calibrations:7.1f}" for h in m_held)
            print(f"  {lean:10.0f} {A:5.0f} {100 * shown / calibrations:6.1f}%{both}{axis}")


def drift(calibrations=10_000):
    """Six replications of 5 x 8 points; offsets differ by so many sd of a reading, sensitivities by as much at 1 g.

    A reading in use is of one more such draw.
    """
    plan = Plan(np.linspace(-90, 90, 5), np.arange(8) * 45.0, 6)
    bench = replace(BENCH, sensors=tuple(Sensor(axis) for axis in "xyz"))
    sigma, rng = np.radians(BENCH.sigma_deg) * 5.0, np.random.default_rng(40_000)
    data, exact = _truth(bench, plan)
    pitch, roll = np.array([(0, 0), (30, 20), (60, -100), (-45, 170), (120, 45)], float).T
    told = volts(bench, pitch, roll)
    print(f"{calibrations:,} calibrations a cell; held by the 95 % interval, %, and calibrations seen to drift")
    for share in (0.0, 0.1, 0.3, 1.0, 4.0):
        held, seen = np.zeros((2, len(pitch))), 0
        for _ in range(calibrations):
            offsets, gains = (
                sigma * share * rng.normal(size=(2, 7, 3))
            )  # the first is of the use, replications count from 1
            drawn = offsets[data.replicate] + exact / 5.0 * gains[data.replicate]
            noisy = exact + drawn + rng.normal(0, sigma, exact.shape)
            run = replace(data, outputs=dict(zip(NAMES, noisy.T, strict=True)))
            calibration = calibrate_package(run, NAMES)
            seen += calibration.drift is not None
            v = told + offsets[0] + told / 5.0 * gains[0] + rng.normal(0, sigma, told.shape)
            found = infer_attitude(calibration, v, near_deg=(pitch, roll))
            held[0] += (found.pitch_lo95_deg <= pitch) & (pitch <= found.pitch_hi95_deg)
            half = found.roll_hi95_deg - found.roll_deg
            held[1] += np.abs((found.roll_deg - roll + 180) % 360 - 180) <= half
        pitches, rolls = (" ".join(f"{100 * h / calibrations:.1f}" for h in row) for row in held)
        print(f"  drift {share:3.1f} sd: pitch {pitches}; roll {rolls}; seen in {100 * seen / calibrations:.1f} %")


def _truth(bench, plan):
    pitch, roll, _, _, replicate = rows_of(plan, np.random.default_rng(0))
    exact = volts(bench, pitch, roll)
    n = len(pitch)
    outputs = dict(zip(NAMES, exact.T, strict=True))
    return AttitudeData(replicate, np.arange(n), np.arange(float(n)), pitch, roll, None, outputs), exact


if __name__ == "__main__":
    what = sys.argv[1] if len(sys.argv) > 1 else "speed"
    {"speed": speed, "coverage": coverage, "azimuth": azimuth, "drift": drift}[what](*(int(a) for a in sys.argv[2:]))
