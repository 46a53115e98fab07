"""Instruments far from what anybody declares, in plain numpy: saturated, clipped, exponential, stuck, overflowing.

Nothing here knows the catalogue. A bend is a formula of the output; a table is what a stranger would send.
"""

import numpy as np

from rig.procedures.attitude.data import AttitudeData
from rig.procedures.pressure.data import WholePlotData

SIDE = {"x": 0, "y": 1, "z": 2}


def bend(rng, full):
    """A random strong nonlinearity of an output whose full scale is `full`, by name and function of (v, direction)."""
    a, b = rng.uniform(0.2, 3.0), rng.uniform(-0.5, 0.5) * full
    edge = rng.uniform(0.15, 0.9) * full
    step = full * 10.0 ** rng.uniform(-2.0, -0.3)
    every = {
        "saturates": lambda v, side: full * np.tanh(a * (v - b) / full),
        "clips": lambda v, side: np.clip(v, -edge, edge),
        "clips on one side": lambda v, side: np.minimum(v, edge),
        "grows exponentially": lambda v, side: full * np.expm1(a * v / full),
        "explodes": lambda v, side: full * np.exp(8.0 * a * v / full),
        "cubic": lambda v, side: v + 3.0 * a * full * (v / full) ** 3,
        "fifth": lambda v, side: 10.0 * a * full * (v / full) ** 5,
        "backlash": lambda v, side: v + 0.5 * a * full * side,
        "dead band": lambda v, side: np.sign(v) * np.maximum(np.abs(v) - edge, 0.0),
        "rectifies": lambda v, side: np.abs(v - b),
        "quantised": lambda v, side: step * np.round(v / step),
        "folds": lambda v, side: full * np.sin(4.0 * a * v / full),
        "jumps": lambda v, side: v + full * a * (v > b),
        "switches range": lambda v, side: np.where(np.abs(v) > edge, 1.5 * v, v),
        "logarithm": lambda v, side: full * np.sign(v) * np.log1p(50.0 * a * np.abs(v) / full),
        "stuck": lambda v, side: np.where(v > b, edge, v),
    }
    name = str(rng.choice(list(every)))
    return name, every[name]


def _side(angle):
    """Direction of arrival, +1 or -1, 0 at the first reading; as it was where the setting stayed."""
    moved, side = np.sign(np.diff(angle, prepend=angle[:1])), np.zeros(len(angle))
    for t in range(1, len(angle)):
        side[t] = moved[t] or side[t - 1]
    return side


def attitude(seed):
    """Three sensors on a head, each bent in a way of its own (or all in one); names of the bends and the data."""
    rng = np.random.default_rng(seed)
    step = float(rng.choice([30.0, 45.0]))
    pitch, roll = (g.ravel() for g in np.meshgrid(np.arange(-180, 181, step), np.arange(-90, 91, 30.0), indexing="ij"))
    if rng.random() < 0.25:
        roll = np.zeros_like(pitch)
    replications = int(rng.integers(1, 5))
    shuffled, every = rng.random() < 0.5, np.arange(pitch.size)
    rows = [rng.permutation(every) if shuffled else every[:: (-1) ** r] for r in range(replications)]
    p, r = (np.concatenate([angle[one] for one in rows]) for angle in (pitch, roll))
    n = p.size
    a, b = np.radians(p), np.radians(r)
    gravity = np.stack([-np.sin(a), np.cos(a) * np.sin(b), np.cos(a) * np.cos(b)])
    full = 10.0 ** rng.uniform(-2.0, 1.0)
    noise = full * 10.0 ** rng.uniform(-6.0, -2.0)
    hours = np.arange(n) / 60.0
    warm = 25.0 + rng.uniform(0.0, 5.0) * np.sin(2 * np.pi * hours / 24.0) + 0.01 * rng.standard_normal(n)
    bends, outputs, same = [], {}, rng.random() < 0.3
    for axis, i in SIDE.items():
        if not same or not bends:
            name, how = bend(rng, full)
        bends.append(name)
        v = rng.uniform(-0.1, 0.1) * full + full * gravity[i]
        outputs[f"{axis}_V"] = np.asarray(how(v, _side(p)) + noise * rng.standard_normal(n), np.float64)
    data = AttitudeData(
        replicate=np.repeat(np.arange(replications), pitch.size) + 1,
        order=np.arange(n) + 1,
        elapsed_s=60.0 * np.arange(n),
        pitch_deg=p,
        roll_deg=r,
        sensor_temperature_degC=warm if rng.random() < 0.7 else None,
        outputs=outputs,
    )
    return bends, data


def whole_plots(seed):
    """Pressure transducers over temperature, bent; names of the bends and the data."""
    rng = np.random.default_rng(seed)
    plots, readings = int(rng.integers(12, 21)), int(rng.integers(6, 12))
    grid = np.array([(a, b) for a in (-10.0, 25.0, 60.0) for b in (5.0, 25.0, 45.0)])
    temperature = grid[rng.permutation(np.arange(plots) % 9)]
    top = 10.0 ** rng.uniform(0.0, 3.0)
    levels = np.linspace(0.02, 1.0, readings) * top
    pressure = np.concatenate([rng.permutation(levels) if rng.random() < 0.7 else levels for _ in range(plots)])
    index = np.repeat(np.arange(plots), readings)
    n = index.size
    sensor, sse = temperature[index, 0], temperature[index, 1]
    full = 10.0 ** rng.uniform(-1.0, 2.0)
    bends, outputs = [], {}
    for k in range(int(rng.integers(1, 4))):
        name, how = bend(rng, full)
        bends.append(name)
        v = full * (pressure / top) * (1 + 1e-4 * (sensor - 25)) + 1e-3 * full * (sse - 25) / 20
        noise = full * 10.0 ** rng.uniform(-5.0, -2.0)
        own = 3 * noise * rng.standard_normal(plots)[index]
        outputs[f"t{k}_mV"] = np.asarray(how(v, _side(pressure)) + own + noise * rng.standard_normal(n), np.float64)
    data = WholePlotData(
        whole_plot=index + 1,
        order=np.arange(n) + 1,
        elapsed_s=300.0 * np.arange(n) + 7200.0 * index,
        pressure_psia=pressure,
        sensor_temperature_degC=sensor + 0.02 * rng.standard_normal(n),
        sse_temperature_degC=sse + 0.02 * rng.standard_normal(n),
        outputs=outputs,
    )
    return bends, data


def table(seed):
    """Columns of a table of any kind with one bent response, as text would be read; name of the bend and columns."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(8, 120))
    top = 10.0 ** rng.uniform(-3.0, 6.0)
    x = rng.uniform(-1.0, 1.0, n) if rng.random() < 0.5 else np.linspace(0.0, 1.0, n)
    x = x * top
    name, how = bend(rng, top)
    noise = top * 10.0 ** rng.uniform(-8.0, -2.0)
    columns = {
        "load": x,
        "oven_degC": 25.0 + 3.0 * rng.standard_normal(n),
        "time_s": 60.0 * np.arange(n),
        "humidity": np.full(n, 40.0) if rng.random() < 0.5 else np.round(rng.uniform(30, 50, n)),
        "y": np.asarray(how(x, _side(x)) + noise * rng.standard_normal(n), np.float64),
    }
    return name, columns
