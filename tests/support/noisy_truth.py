"""Runs of the three kinds in which nothing is missing; only the noise is not what a model assumes. Plain numpy."""

import numpy as np

from rig.procedures.attitude.data import AttitudeData
from rig.procedures.pressure.data import WholePlotData

KINDS = ("attitude", "whole plots", "table")


def errors(how, n, rng, along):
    """(n,) errors of unit scale: `how` they are, over a variable `along` in 0 to 1."""
    e = rng.standard_normal(n)
    if how == "growing":
        return e * (0.2 + 4.0 * along)
    if how == "outliers":
        e[n // 3] += 40.0
        return e
    slow = np.zeros(n)  # correlated: a walk with every reading's own error on it
    for t in range(1, n):
        slow[t] = 0.97 * slow[t - 1] + 0.6 * e[t]
    return slow + 0.3 * rng.standard_normal(n)


def attitude(how, rng):
    """Four replications of 13 x 7 points, the paths shuffled; three sensors with errors of their own."""
    pitch, roll = (g.ravel() for g in np.meshgrid(np.arange(-180, 181, 30.0), np.arange(-90, 91, 30.0)))
    path = np.concatenate([rng.permutation(pitch.size) for _ in range(4)])
    p, r, n = pitch[path], roll[path], path.size
    a, b = np.radians(p), np.radians(r)
    gravity = {"x_V": -np.sin(a), "y_V": np.cos(a) * np.sin(b), "z_V": np.cos(a) * np.cos(b)}
    along = np.abs(p) / 180.0
    return AttitudeData(
        replicate=np.repeat(np.arange(4), pitch.size) + 1,
        order=np.arange(n) + 1,
        elapsed_s=30.0 * np.arange(n),
        pitch_deg=p,
        roll_deg=r,
        sensor_temperature_degC=None,
        outputs={s: 0.01 + 5.0 * g + 1e-5 * errors(how, n, rng, along) for s, g in gravity.items()},
    )


def whole_plots(how, rng):
    """Eighteen whole plots of 11 pressures over nine pairs of temperatures."""
    plots, readings = 18, 11
    grid = np.array([(a, b) for a in (-10.0, 25.0, 60.0) for b in (5.0, 25.0, 45.0)])
    index = np.repeat(np.arange(plots), readings)
    sensor, sse = grid[rng.permutation(np.arange(plots) % 9)][index].T
    psia = np.concatenate([rng.permutation(np.linspace(0.1, 15.0, readings)) for _ in range(plots)])
    if how == "correlated":  # each whole plot begins again: what lasts longer is the whole plot's own error
        e = np.concatenate([errors(how, readings, rng, psia[:readings]) for _ in range(plots)])
    else:
        e = errors(how, index.size, rng, psia / 15.0)
    own = 0.03 * rng.standard_normal(plots)[index]
    y = 0.3 + 2.0 * psia + 1e-3 * (sensor - 25) + 2e-4 * psia * (sensor - 25) + own + 5e-3 * e
    return WholePlotData(
        whole_plot=index + 1,
        order=np.arange(index.size) + 1,
        elapsed_s=300.0 * np.arange(index.size) + 7200.0 * index,
        pressure_psia=psia,
        sensor_temperature_degC=sensor,
        sse_temperature_degC=sse,
        outputs={"bridge_mV": y},
    )


def table(how, rng):
    """70 rows of a line, taken in random order of the load, with a clock."""
    load = rng.uniform(0.0, 10.0, 70)
    y = 1.0 + 2.0 * load + 0.01 * errors(how, 70, rng, load / 10.0)
    return {"load": load, "time_s": 60.0 * np.arange(70), "y": y}
