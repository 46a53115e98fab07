"""Pressure transducers in a cold chamber, their electronics in another; a stay at a pair of temperatures is a whole plot."""
import numpy as np

from . import common as c

# readings, whole plots: each a noise of sd 1
NOISES = {
    "white": (c.white, c.white), "student": (c.student, c.white), "heavy_plots": (c.white, c.student),
    "skewed": (c.skewed, c.skewed), "contaminated": (c.contaminated, c.white), "ar1": (c.ar1, c.white),
    "quantized": (c.white, c.white), "by_pressure": (c.by_level, c.white), "by_plot": (c.by_block, c.uniform),
}


def design(seed):
    r = c.stream("whole_plots", "design", seed)
    while True:
        plots, per = int(r.integers(10, 23)), int(r.integers(7, 17))
        if 80 <= plots * per <= 300:
            break
    top = int(r.choice([12, 15]))
    Ts = r.uniform(-130, -50, plots) if r.random() < 0.4 else r.choice([-130, -110, -90, -70, -50], plots) + r.uniform(-3, 3, plots)
    Ts = np.clip(Ts, -130, -50)
    Te = r.uniform(-40, 40, plots) if r.random() < 0.5 else r.choice([-40, -20, 0, 20, 40], plots) + r.uniform(-3, 3, plots)
    rows = []
    now, unit = 0.0, r.choice([1.0, 0.5])
    for k in range(plots):
        n_levels = int(round(top / unit)) + 1
        lev = r.permutation(n_levels)
        while len(lev) < per:
            lev = np.r_[lev, r.permutation(n_levels)]
        for j in lev[:per]:
            rows.append((k + 1, now, j * unit, Ts[k], Te[k]))
            now += r.uniform(120, 300) * r.choice([1, 1, 1, 2.5])
        now += r.uniform(3600, 3 * 3600)
    w, t, p, s, e = map(np.array, zip(*rows))
    n = len(t)
    p = p * (1 + r.uniform(-1, 1) * 3e-4) + r.uniform(0.0, 0.02) + 0.003 * r.standard_normal(n)
    s = s + 0.15 * r.standard_normal(n)
    e = e + 0.15 * r.standard_normal(n)
    cols = {"whole_plot": c.text(w, 0), "order": c.text(np.arange(1, n + 1), 0), "elapsed_s": c.text(t, 0),
            "pressure_psia": c.text(p, 4), "sensor_temperature_degC": c.text(s, 2), "sse_temperature_degC": c.text(e, 2)}
    d = {k: np.asarray(v[0], float) for k, v in cols.items()}
    d["cols"], d["unit"], d["top"] = cols, unit, float(top)
    d["p"], d["Ts"], d["Te"] = d["pressure_psia"], d["sensor_temperature_degC"], d["sse_temperature_degC"]
    d["t"], d["w"] = d["elapsed_s"], w.astype(int)
    d["first"] = np.r_[True, d["w"][1:] != d["w"][:-1]]
    bridges = 1 if r.random() < 0.6 else 2
    d["S"] = r.uniform(1.6, 2.4, bridges)
    d["c"] = [(r.uniform(-1, 1), r.uniform(-4e-4, 4e-4), r.uniform(-3e-4, 3e-4), r.uniform(-8e-3, 8e-3), r.uniform(-5e-3, 5e-3))
              for _ in range(bridges)]
    d["reading"] = 10 ** r.uniform(-2.7, -2.1)
    x, y, z = (d["p"] - top / 2) / (top / 2), (d["Ts"] + 90) / 40, d["Te"] / 40
    d["model"] = np.column_stack([np.ones(n), x, y, z, x * x, y * y, z * z, x * y, x * z, y * z])
    return d


def start_of_plot(d):
    return np.array([d["t"][d["w"] == k].min() for k in d["w"]])


def loop_hysteresis(d, r):
    u = np.clip(d["p"] / d["top"], 0, 1)
    up = np.sign(np.diff(d["p"], prepend=-1.0))
    up[d["first"]] = 1
    return up * (u * (1 - u) + 0.04)


def thermal_lag(d, r):
    T = np.array([d["Ts"][d["w"] == k].mean() for k in range(1, d["w"].max() + 1)])
    jump = np.r_[0.0, np.diff(T)][d["w"] - 1]
    return -jump * np.exp(-(d["t"] - start_of_plot(d)) / r.uniform(400, 1200)) * (1 + r.uniform(-0.5, 1.5) * d["p"] / d["top"])


def amplifier_ceiling(d, r):
    # the ceiling falls as the electronics warm: a soft knee in pressure
    knee = d["top"] * r.uniform(0.55, 0.75) - r.uniform(0.02, 0.05) * d["Te"]
    w = 0.3
    return -w * np.logaddexp(0, (d["p"] - knee) / w)


def supply_drift(d, r):
    x = d["t"] / d["t"].max()
    D = r.uniform(0.5, 1) * (1 - np.exp(-x / r.uniform(0.1, 0.4))) + r.uniform(0.1, 0.5) * np.sin(2 * np.pi * (x * r.uniform(0.7, 2) + r.uniform()))
    return D * d["p"] / d["top"]


def stiff_o_ring(d, r):
    edge = r.uniform(-112, -85)
    return np.maximum(edge - d["Ts"], 0) * (14.7 - d["p"]) / 14.7


def frost_relay(d, r):
    low, high = np.quantile(d["Ts"], r.uniform(0.15, 0.35)), np.quantile(d["Ts"], r.uniform(0.65, 0.85))
    on, s = 0.0, np.zeros(len(d["t"]))
    for i in range(len(s)):
        if d["Ts"][i] < low:
            on = 1.0
        elif d["Ts"][i] > high:
            on = 0.0
        s[i] = on
    return s * (1 + r.uniform(0, 1) * d["p"] / d["top"])


def cold_outgassing(d, r):
    fall = np.maximum(-np.diff(d["p"], prepend=d["p"][0]), 0)
    fall[d["first"]] = 0
    dt = np.diff(d["t"], prepend=0.0)
    tau = r.uniform(90, 250) * np.exp((-90 - d["Ts"]) / r.uniform(20, 40))
    return fall * np.exp(-dt / tau)


def chopper_beat(d, r):
    return np.sin(2 * np.pi * d["Te"] / r.uniform(8, 22) + r.uniform(0, 6.28)) * (r.uniform(0.2, 0.6) + d["p"] / d["top"])


def stale_barometer(d, r):
    every, at = r.choice([6, 8, 12, 24]) * 3600.0, r.uniform(0, 1)
    entry = (np.floor(d["t"] / every + at) - at) * every
    P, ph = r.uniform(1.5, 4) * 86400, r.uniform(0, 6.28, 2)

    def weather(t):
        return np.sin(2 * np.pi * t / P + ph[0]) + 0.4 * np.sin(2 * np.pi * t / (0.37 * P) + ph[1])
    return weather(d["t"]) - weather(np.maximum(entry, 0))


def stack_disc(d, r):
    disc = r.choice([1, 2, 4]) if d["unit"] == 1.0 else r.choice([0.5, 1, 2, 4])
    stack = np.round(d["p"] / d["unit"]) * d["unit"]
    return (np.floor(stack / disc) % 2 == 1).astype(float)


EFFECTS = {f.__name__: f for f in (
    loop_hysteresis, thermal_lag, amplifier_ceiling, supply_drift, stiff_o_ring, frost_relay, cold_outgassing, chopper_beat,
    stale_barometer, stack_disc)}

PAIRS = [("loop_hysteresis", "amplifier_ceiling"), ("thermal_lag", "supply_drift"), ("stiff_o_ring", "cold_outgassing"),
         ("frost_relay", "stack_disc"), ("chopper_beat", "stale_barometer"), ("stack_disc", "loop_hysteresis"),
         ("thermal_lag", "stiff_o_ring")]

ABOUT = {
    "loop_hysteresis": "Everyday. The diaphragm's elastic hysteresis: up minus down, by the sign of the last change of pressure_psia "
        "(order), widest in mid-range; the first reading of a whole plot counts as up.",
    "thermal_lag": "Everyday. Readings begin before the sensor has soaked: proportional to the change of sensor_temperature_degC from "
        "the stay before, dying in 7 to 20 minutes of elapsed_s from the first reading of the plot; zero and span. The first "
        "stay has been soaked overnight.",
    "amplifier_ceiling": "Everyday. The amplifier runs out of headroom: a soft knee at high pressure_psia, lower when sse_temperature_degC "
        "is higher. Nothing below about half range.",
    "supply_drift": "Everyday. The bridge's supply ages and wanders over the days: elapsed_s times pressure_psia, slow and curved; "
        "crosses whole plots.",
    "stiff_o_ring": "Unlisted. Below its glass transition (an edge of sensor_temperature_degC between -112 and -85) the O-ring stiffens and "
        "lets room air leak in: degrees below the edge times (14.7 - pressure_psia). Nothing above.",
    "frost_relay": "Unlisted. Moisture in the reference tube freezes to a plug when sensor_temperature_degC goes below one edge and thaws "
        "only above another, much higher: between the edges it depends on where the chamber has been in the stays before. An "
        "offset and a little span while plugged.",
    "cold_outgassing": "Unlisted. After a fall of pressure gas comes off the cold walls: (pressure before - pressure now), falls only, times "
        "exp(-time since the reading before / tau), tau e-folding every 20 to 40 degC as sensor_temperature_degC goes down. "
        "Matters at cold and quick steps down; nothing on steps up.",
    "chopper_beat": "Unlisted. The electronics' two oscillators beat, and their difference walks with temperature: periodic in "
        "sse_temperature_degC (8 to 22 degC), offset and span. Almost wholly a matter between whole plots.",
    "stale_barometer": "Unlisted, human. The gauge pressure is made absolute with a barometer that the operator types in only every 6, 8, "
        "12 or 24 hours of elapsed_s: the error is the weather since the last entry, a slow swing cut to zero at each entry; "
        "the same at all pressures.",
    "stack_disc": "Unlisted. Pressures are stacks of discs of a piston gauge in doubling steps (0.5 or 1, 2, 4, 8 psi); the mass of one disc "
        "is wrong in the book: a constant error whenever that disc is in the stack, a square wave in pressure_psia.",
}


def table(effects, seed, size, noise):
    d = design(seed)
    n, w, sr = len(d["t"]), d["w"], d["reading"]
    sigma = sr * np.sqrt(10.0)                              # a whole plot's 3 and a reading's 1
    model = d["model"]
    hidden, sizes, shares = np.zeros(n), {}, {}
    for e in effects:
        share, (shape,) = c.draw(lambda r: [EFFECTS[e](d, r)], ("whole_plots", e, seed), model)
        k = size * sigma / c.rms(c.residual(shape, model)) * c.stream("whole_plots", "sign", e, seed).choice([-1, 1])
        hidden = hidden + k * shape
        sizes[e], shares[e] = c.rms(c.residual(k * shape, model)) / sigma, share
    cols = dict(d["cols"])
    names = ["bridge_mV"] if len(d["S"]) == 1 else [f"bridge_{i + 1}_mV" for i in range(len(d["S"]))]
    for i, name in enumerate(names):
        within, between = NOISES[noise]
        r = c.stream("whole_plots", "noise", noise, seed, name)
        z = within(r, n, level=np.clip(d["p"] / d["top"], 0, 1), block=w)
        big = 3 * between(r, w.max(), level=None, block=None)[w - 1]
        q = 1.0 if noise == "quantized" else 0.0
        b0, aS, aE, kS, kE = d["c"][i]
        y = (b0 + d["S"][i] * d["p"] * (1 + aS * d["Ts"] + aE * d["Te"]) + kS * d["Ts"] + kE * d["Te"]
             + hidden * d["S"][i] / d["S"][0] + sr * (big + z * np.sqrt(1 - q * q / 12)))
        if q:
            y = np.round(y / (q * sr)) * (q * sr)
        cols[name] = c.text(y, c.decimals(sr))
    return c.Table("whole_plots", effects, seed, noise, cols, [], names, hidden, sizes, sigma, None, model, shares)
