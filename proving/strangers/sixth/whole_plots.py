"""Pressure transducers: stays at pairs of temperatures, pressures in random order."""
import numpy as np
from ._core import stream

KIND = "whole_plots"


def design(seed):
    rng = stream(KIND, seed, "design")
    style = rng.choice(["grid", "random", "rings"])
    if style == "grid":
        a, b = [(4, 3), (3, 4), (4, 4), (5, 3), (6, 3), (5, 4)][int(rng.integers(6))]
        lo, hi = rng.uniform(-130, -118), rng.uniform(-62, -50)
        ts, te = np.meshgrid(np.linspace(lo, hi, a), np.linspace(rng.uniform(-40, -30), rng.uniform(30, 40), b))
        ts, te = ts.ravel(), te.ravel()
        extra = int(rng.integers(0, 4))
        again = rng.integers(0, len(ts), extra)
        ts, te = np.concatenate([ts, ts[again]]), np.concatenate([te, te[again]])
    elif style == "random":
        m = int(rng.integers(13, 23))
        ts = -130 + 80 * (rng.permutation(m) + rng.random(m)) / m
        te = -40 + 80 * (rng.permutation(m) + rng.random(m)) / m
    else:
        u = [0.0, 0.0, 0.0]
        v = [0.0, 0.0, 0.0]
        for radius, count in ((0.55, 5), (1.0, int(rng.integers(7, 11)))):
            ang = 2 * np.pi * (np.arange(count) + rng.random()) / count
            u.extend(radius * np.cos(ang))
            v.extend(radius * np.sin(ang))
        ts, te = -90 + 40 * np.array(u), 40 * np.array(v)
    ts, te = np.round(ts, 0), np.round(te, 0)
    at = rng.permutation(len(ts))
    if rng.random() < 0.25:
        at = np.argsort(ts + 16 * rng.standard_normal(len(ts)), kind="stable")   # cooling, by and large
        if rng.random() < 0.5:
            at = at[::-1]
    ts, te = ts[at], te[at]
    plots = len(ts)
    top = float(rng.choice([15.0, 30.0, 50.0, 100.0]))
    levels = int(rng.integers(6, 13))
    while levels * plots > 290:
        levels -= 1
    while levels * plots < 84:
        levels += 1
    centre = rng.random() < 0.4 and (levels + 1) * plots <= 300
    grid = np.linspace(rng.uniform(0.01, 0.08), 1.0, levels) * top
    space = rng.random() < 0.3
    plot, p, sensor, sse, t = [], [], [], [], []
    now = 0.0
    pause = rng.uniform(100, 360)
    for k in range(plots):
        q = rng.permutation(grid)
        if space:
            q = rng.uniform(0.02, 1.0, levels) * top
        if centre:
            q = np.insert(q, int(rng.integers(1, levels)), 0.5 * top)
        now += rng.uniform(0.7, 1.3) * 5400 if k else 600.0
        ramp = rng.uniform(-0.4, 0.4)
        ramp2 = rng.uniform(-0.6, 0.6)
        for j, x in enumerate(q):
            now += pause * rng.uniform(0.9, 1.4)
            plot.append(k + 1)
            t.append(now)
            p.append(x)
            sensor.append(ts[k] + ramp * j / len(q) + 0.05 * rng.standard_normal())
            sse.append(te[k] + ramp2 * j / len(q) + 0.08 * rng.standard_normal())
    plot = np.array(plot)
    n = len(plot)
    t = np.round(t, 0)
    p = np.round(np.maximum(np.array(p) + 0.002 * top * rng.standard_normal(n), 0.005 * top), 3)
    sensor, sse = np.round(sensor, 2), np.round(sse, 2)
    u, v, w = p / top, (sensor + 90) / 40, sse / 40
    full = np.column_stack([np.ones(n), u, v, w, u * u, v * v, w * w, u * v, u * w, v * w])
    k = int(rng.choice([1, 1, 1, 2, 3]))
    fs = rng.uniform(1.7, 2.3, k) * top
    size = np.array([0.04, 1.0, 0.03, 0.01, 0.01, 0.008, 0.003, 0.03, 0.01, 0.003])
    coefs = rng.standard_normal((k, 10)) * size
    coefs[:, 1] = 1.0
    clean = (full @ coefs.T) * fs
    reading = fs * 10 ** rng.uniform(-4.3, -3.4)
    names = ["bridge_mV"] if k == 1 else ["bridge_%d_mV" % (j + 1) for j in range(k)]
    order = np.arange(1, n + 1)
    columns = [("whole_plot", plot, None), ("order", order, None), ("elapsed_s", t, 0), ("pressure_psia", p, 3),
               ("sensor_temperature_degC", sensor, 2), ("sse_temperature_degC", sse, 2)]
    first = np.concatenate([[True], plot[1:] != plot[:-1]])
    before = np.concatenate([[0.0], p[:-1]])
    before[first] = 0.0                           # vented before every stay
    count = order - np.maximum.accumulate(np.where(first, order, 0))
    return dict(plot=plot, order=order, t=t, p=p, sensor=sensor, sse=sse, top=top, clean=clean, fs=fs, first=first,
                before=before, count=count, sd=reading * np.sqrt(10.0), columns=columns, responses=names, options=[],
                grow=p, noise_groups=plot, groups=None, model=full, plots=plot)


def many(d, rng, shape):
    """All bridges feel it, each after its own kind; the first is the measure."""
    k = d["clean"].shape[1]
    return shape[:, None] * np.concatenate([[1.0], rng.uniform(0.4, 1.2, 3)])[:k]


def pressure_cubic(d, rng):
    return many(d, rng, (2 * d["p"] / d["top"] - 1) ** 3)


def zero_drift(d, rng):
    return many(d, rng, d["t"] / d["t"][-1])


def pressure_hysteresis(d, rng):
    u = d["p"] / d["top"]
    return many(d, rng, np.sign(d["p"] - d["before"]) * (0.3 + 4 * u * (1 - u)))


def frost_in_the_line(d, rng):
    kelvin = d["sensor"] + 273.15
    logs = np.log(np.maximum(d["p"], 1e-3)) + 3030.0 * (1 / kelvin - 1 / 183.15)
    logs = logs - np.quantile(logs, rng.uniform(0.4, 0.6))
    return many(d, rng, np.clip(logs / rng.uniform(0.3, 1.2), 0.0, 1.0))


def scanner_contact_heat(d, rng):
    k = rng.uniform(1.5, 4.0)
    return many(d, rng, (1 - np.exp(-d["count"] / k)) * (d["sse"] - rng.uniform(18, 26)) / 40)


def converter_carry(d, rng):
    y = d["clean"][:, 0]
    lo, hi = y.min(), y.max()
    level = lo + rng.uniform(0.42, 0.68) * (hi - lo)
    walk = rng.choice([-1, 1]) * rng.uniform(0.06, 0.16) * (hi - lo)
    return many(d, rng, (y > level + walk * d["sse"] / 40).astype(float))


def soak_of_last_stay(d, rng):
    stays = np.unique(d["plot"])
    length = np.median([np.ptp(d["t"][d["plot"] == s]) for s in stays])
    tau = rng.uniform(0.35, 0.9) * length
    out = np.zeros(len(d["t"]))
    middle = d["p"].mean()
    for s in stays[1:]:
        at = d["plot"] == s
        dose = d["p"][d["plot"] == s - 1][-3:].mean() - middle
        out[at] = dose * np.exp(-(d["t"][at] - d["t"][at][0]) / tau)
    return many(d, rng, out / d["top"])


def end_of_shift_hurry(d, rng):
    shift = 8 * 3600.0
    late = rng.uniform(1.3, 2.4) * 3600
    for _ in range(60):                           # a campaign in which some stays meet the end of a shift
        start = rng.uniform(0, shift)
        hour = np.mod(d["t"] + start, shift)
        if np.mean(hour > shift - late) >= 0.18:
            break
    return many(d, rng, np.where(hour > shift - late, d["before"] - d["p"], 0.0) / d["top"])


EFFECTS = {f.__name__: f for f in (pressure_cubic, zero_drift, pressure_hysteresis, frost_in_the_line,
                                   scanner_contact_heat, converter_carry, soak_of_last_stay, end_of_shift_hurry)}
PAIRS = [("pressure_cubic", "scanner_contact_heat"), ("zero_drift", "converter_carry"),
         ("frost_in_the_line", "end_of_shift_hurry")]
ABOUT = {
    "pressure_cubic": "Everyday: a cubic term in pressure about mid range. Depends on pressure_psia. Matters at the ends of"
    " the range.",
    "zero_drift": "Everyday: the zero drifts linearly over the campaign. Depends on elapsed_s. Matters from stay to stay.",
    "pressure_hysteresis": "Everyday: the bridge differs with a rise or a fall from the pressure before (vented, zero, before"
    " each stay); sign of the change times a bow over the range. Depends on pressure_psia of this and the row before, and"
    " whole_plot. Matters in mid range.",
    "frost_in_the_line": "Unlisted: carbon dioxide left in the gas frosts in the cold line once its partial pressure passes the"
    " sublimation curve (exp(-3030 K / T)) at the sensor's temperature; 0 below the curve, a ramp of 0.3 to 1.2 in the"
    " logarithm, then constant. Depends on pressure_psia and sensor_temperature_degC together, by a threshold. Matters when"
    " cold and at pressure.",
    "scanner_contact_heat": "Unlisted: the scanner's contacts warm with the number of readings in the stay and saturate; their"
    " thermal emf is that count times (electronics' temperature less the room's 18 to 26). Depends on the count of rows since"
    " the whole plot began, and sse_temperature_degC. Matters in the first few readings, at cold electronics most.",
    "converter_carry": "Unlisted: a bad bit of the converter: a step where the first bridge's signal passes a code between 42"
    " and 68 % of its range; the code's place moves with the electronics' temperature by 6 to 16 % of range each 40 degrees."
    " Depends on pressure_psia (through the signal) and sse_temperature_degC. Matters near mid range.",
    "soak_of_last_stay": "Unlisted: the seal remembers the pressures with which the last stay ended (mean of its last three,"
    " less the mean of all) and recovers in the next stay, time constant 0.35 to 0.9 of its length. Depends on pressure_psia"
    " of the whole plot before, and elapsed_s within this one. Matters in each stay's first rows (not the first stay).",
    "end_of_shift_hurry": "Unlisted: in the last 1.3 to 2.4 h of every 8 h shift the operator reads before the pressure has"
    " settled: a share of (pressure before - pressure). Depends on elapsed_s modulo 8 h, pressure_psia of this row and the"
    " one before (zero before a stay). Matters in about a quarter of the rows, at large steps.",
}
NOISES = {
    "white": "both errors normal, independent", "heavy_tails": "Student's t: 3 degrees of freedom (reading), 4 (whole plot)",
    "ar1": "readings AR(1) in executed order, coefficient 0.55 to 0.92", "flicker": "readings 1/f in executed order",
    "growing": "reading's sd grows with pressure", "bursts": "2 to 5 short stretches of readings of 4 to 8 times the sd",
    "skew": "gamma, both errors", "rounded": "display's step of about 1.8 of the reading's sd",
    "by_whole_plot": "reading's sd differs by whole plot",
}
