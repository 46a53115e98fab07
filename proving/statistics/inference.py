"""How often 95 % intervals of inferred pitch and roll hold, and those of what a calibration says of its sensors.

The bench is proving/truth/attitude.py, written from rotations. A seed is a stream of calibrations.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from proving.frame import Figures, Part, Results, Study
from proving.ledger import Result
from proving.truth.attitude import Bench, Plan, Sensor, volts, without_noise
from rig.fitter.arrays import FloatArray
from rig.fitter.quantiles import t_limit
from rig.procedures.attitude.infer import InferredAttitude, calibrate_package, infer_attitude
from rig.procedures.attitude.model import (
    attitude_columns,
    attitude_parameters,
    fit_columns,
    linear_coefficients,
    sensitive_axis,
)

BENCH = Bench()
UNEQUAL = replace(
    BENCH, sensors=(Sensor("x"), Sensor("y", b=-0.003, S=5.1, Omega_deg=1.0), Sensor("z", b=0.001, S=4.9, A_deg=200.0))
)
ALIKE = replace(BENCH, sensors=tuple(Sensor(axis) for axis in "xyz"))
NAMES = ("x_V", "y_V", "z_V")
GRID = Plan(np.linspace(-90, 90, 5), np.linspace(0.0, 315.0, 8), 2)
LINE = Plan(np.linspace(-90, 90, 13), np.zeros(1), 2)
CELLS = {  # package, (pitch, roll): outside every singular zone of the package
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
LEANS = (0.0, 2.0, 4.0, 5.0, 6.0, 8.0, 12.0, 50.0)
AZIMUTHS_DEG = (20.0, 135.0, 180.0)
SHARES = (0.0, 0.1, 0.3, 1.0, 4.0)
USED_AT = [(0, 0), (30, 20), (60, -100), (-45, 170), (120, 45)]


def _inside(found: InferredAttitude, pitch: FloatArray, roll: FloatArray) -> FloatArray:
    """(2, n) whether the intervals of pitch and of roll hold."""
    half = found.roll_hi95_deg - found.roll_deg
    pitches = (found.pitch_lo95_deg <= pitch) & (pitch <= found.pitch_hi95_deg)
    return np.stack([pitches, np.abs((found.roll_deg - roll + 180) % 360 - 180) <= half]).astype(float)


def coverage(calibrations: int = 1000) -> Study:
    """Every calibration is simulated afresh: 5 x 8 points, twice; 13 points, twice, without roll; unequal sensors."""
    return Study({"packages": partial(_packages, calibrations=calibrations)}, _shares)


def _packages(seed: int, calibrations: int) -> Result:
    sigma = np.radians(BENCH.sigma_deg) * np.array([5.0, 5 * 5.1, 5 * 4.9])  # y and z five times worse
    designs = {roll: without_noise(UNEQUAL, plan) for roll, plan in ((True, GRID), (False, LINE))}
    rng = np.random.default_rng(20_000 + seed)
    held = {name: np.zeros((2, len(at))) for name, at in CELLS.items()}
    for _ in range(calibrations):
        calibrated = {}
        for rolled, (data, exact) in designs.items():
            noisy = exact + rng.normal(size=exact.shape) * sigma
            run = replace(data, outputs=dict(zip(NAMES, noisy.T, strict=True)))
            calibrated[rolled] = calibrate_package(run, NAMES if rolled else NAMES[:1])
        for name, at in CELLS.items():
            pitch, roll = np.array(at, float).T
            axes = [f"{a}_V" for a in name.split(",")[0].split("-")]
            package = calibrated["no roll" not in name].only(axes)
            noise = rng.normal(size=(len(at), len(axes))) * sigma[[NAMES.index(a) for a in axes]]
            given = {}
            if "measured" in name:
                given = {"roll_deg": roll + rng.normal(0, ROLL_SD_DEG, len(at)), "roll_sd_deg": ROLL_SD_DEG}
            found = infer_attitude(package, volts(UNEQUAL, pitch, roll, axes) + noise, near_deg=(pitch, roll), **given)
            held[name] += _inside(found, pitch, roll)
    return {"held": {name: inside.tolist() for name, inside in held.items()}, "of": calibrations}


def _shares(results: Results) -> Figures:
    of = sum(one["of"] for one in results)
    every: list[float] = []
    out: Figures = {}
    for name, at in CELLS.items():
        share = 100.0 * np.sum([one["held"][name] for one in results], axis=0) / of
        which = {"pitch": share[0], "roll": share[1]} if name in ("x-y", "x-z", "x-y-z") else {"pitch": share[0]}
        every += [one for shares in which.values() for one in shares.tolist()]
        for i, (pitch, roll) in enumerate(at):
            out[f"{name} at {pitch}, {roll} deg"] = {angle: float(shares[i]) for angle, shares in which.items()}
    return {**out, "least": min(every), "greatest": max(every), "mean": float(np.mean(every)), "of": of}


def azimuth(calibrations: int = 1000) -> Study:
    """An x sensor that leans by so many standard deviations of Omega, calibrated at 5 x 8 points, twice."""
    return Study({"Omega, A and the sensitive axis": partial(_leaning, calibrations=calibrations)}, _leans)


def _leaning(seed: int, calibrations: int) -> Result:
    sigma_V, rng = 2.5e-5, np.random.default_rng(30_000 + seed)
    data, _ = without_noise(BENCH, GRID)
    h = attitude_columns(data.pitch_deg, data.roll_deg)
    variance = np.linalg.inv(h.T @ h)[2, 2]  # across m; both ways alike here
    sd_deg = np.degrees(sigma_V / 5.0 * np.sqrt(variance))
    cells: Result = {}
    for lean in LEANS:
        for A in AZIMUTHS_DEG:
            c = linear_coefficients(0, 0.01, 5.0, lean * sd_deg, A)
            shown, held, axis = 0, np.zeros(2), np.zeros(3)
            for _ in range(calibrations):
                fit = fit_columns(h, h @ c + rng.normal(0.0, sigma_V, len(h)))
                p = attitude_parameters(0, fit.coefficients, fit.covariance)
                axis += np.abs(p.m_V - sensitive_axis(c)) <= t_limit(0.95, fit.df) * np.sqrt(np.diag(p.m_covariance))
                _, _, Omega, azimuths = p.intervals(fit.df)
                if Omega is None or azimuths is None:
                    continue
                shown += 1
                middle, half = np.mean(azimuths), np.ptp(azimuths) / 2.0
                held += Omega[0] <= lean * sd_deg <= Omega[1], abs((A - middle + 180.0) % 360.0 - 180.0) <= half
            cells[f"{lean:g} sd, A {A:g} deg"] = {"shown": shown, "held": held.tolist(), "axis": axis.tolist()}
    return {"cells": cells, "of": calibrations}


def _leans(results: Results) -> Figures:
    """In percent: intervals of Omega and A that are shown, and that hold; those of the sensitive axis."""
    of = sum(one["of"] for one in results)
    out: Figures = {}
    for cell in results[0]["cells"]:
        every = [one["cells"][cell] for one in results]
        shown = sum(one["shown"] for one in every)
        held, axis = (np.sum([one[name] for one in every], axis=0) for name in ("held", "axis"))
        both = dict(zip(("Omega", "A"), (100.0 * held / shown).tolist(), strict=True)) if shown > 0.01 * of else {}
        out[cell] = {"shown": 100.0 * shown / of, **both, "axis": (100.0 * axis / of).tolist()}
    return {**out, "of": of}


def drift(calibrations: int = 1000, replications: int = 6) -> Study:
    """Replications of 5 x 8 points; offsets differ by so many sd of a reading, sensitivities by as much at 1 g.

    A reading in use is of one more such draw.
    """
    return Study({"drift": partial(_drifting, calibrations=calibrations, replications=replications)}, _drifts)


def _drifting(seed: int, calibrations: int, replications: int) -> Result:
    sigma, rng = np.radians(BENCH.sigma_deg) * 5.0, np.random.default_rng(40_000 + seed)
    data, exact = without_noise(ALIKE, replace(GRID, replications=replications))
    pitch, roll = np.array(USED_AT, float).T
    told = volts(ALIKE, pitch, roll)
    cells: Result = {}
    for share in SHARES:
        held, seen = np.zeros((2, len(pitch))), 0
        for _ in range(calibrations):
            # The first is of the use, replications count from 1.
            offsets, gains = sigma * share * rng.normal(size=(2, replications + 1, 3))
            drawn = offsets[data.replicate] + exact / 5.0 * gains[data.replicate]
            noisy = exact + drawn + rng.normal(0, sigma, exact.shape)
            run = replace(data, outputs=dict(zip(NAMES, noisy.T, strict=True)))
            calibration = calibrate_package(run, NAMES)
            seen += calibration.drift is not None
            v = told + offsets[0] + told / 5.0 * gains[0] + rng.normal(0, sigma, told.shape)
            held += _inside(infer_attitude(calibration, v, near_deg=(pitch, roll)), pitch, roll)
        cells[f"drift {share:g} sd"] = {"held": held.tolist(), "seen": seen}
    return {"cells": cells, "of": calibrations}


def _drifts(results: Results) -> Figures:
    """In percent: intervals that hold, and calibrations seen to drift."""
    of = sum(one["of"] for one in results)
    out: Figures = {}
    for cell in results[0]["cells"]:
        every = [one["cells"][cell] for one in results]
        pitch, roll = (100.0 * np.sum([one["held"] for one in every], axis=0) / of).tolist()
        out[cell] = {"pitch": pitch, "roll": roll, "seen": 100.0 * sum(one["seen"] for one in every) / of}
    return {**out, "of": of}


PARTS = {"coverage": Part(coverage, 10), "azimuth": Part(azimuth, 10), "drift": Part(drift, 10)}
