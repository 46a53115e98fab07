"""Pressure transducers in a cold chamber, their electronics in another: whole plots of two temperatures."""
import math

import numpy as np

from ._core import NOISES, Lab, record, stream

__all__ = ["NOISES", "EFFECTS", "PAIRS", "ABOUT", "laboratory"]


def laboratory(seed):
    rng = stream("whole_plots", seed, "laboratory")
    while True:
        plots, levels = int(rng.integers(14, 23)), int(rng.integers(7, 14))
        if 100 <= plots * levels <= 260:
            break
    full = float(rng.choice([15, 30, 50, 100]))
    nominal = full * np.linspace(rng.uniform(0.03, 0.07), 1.0, levels)
    cold = rng.permutation(np.linspace(-129, -52, plots) + rng.uniform(-1.5, 1.5, plots))
    box = rng.permutation(np.linspace(-39, 39, plots) + rng.uniform(-1.5, 1.5, plots))
    pace, gap = rng.uniform(110, 320), rng.uniform(3500, 7000)
    w, t, p, ts, te, l = [], [], [], [], [], []
    clock = 0.0
    for k in range(plots):
        clock += gap * rng.uniform(0.8, 1.2) if k else rng.uniform(400, 900)
        walk_s = np.cumsum(rng.normal(0, 0.07, levels))
        walk_e = np.cumsum(rng.normal(0, 0.09, levels))
        for i, j in enumerate(rng.permutation(levels)):
            clock += pace * rng.uniform(0.8, 1.25)
            w.append(k + 1), t.append(clock), l.append(j)
            p.append(nominal[j] + rng.normal(0, 0.0015 * full))
            ts.append(cold[k] + walk_s[i]), te.append(box[k] + walk_e[i])
    n = len(t)
    w, t, p, ts, te, l = np.array(w), record(t, 0), record(p, 3), record(ts, 2), record(te, 2), np.array(l)
    q, u, v = p / full, (ts + 90) / 40, te / 40
    clean, sd, scale = {}, {}, {}
    names = ("bridge_mV",) if rng.random() < 0.6 else ("bridge_1_mV", "bridge_2_mV")
    span = rng.choice([25.0, 50.0, 100.0])
    for name in names:
        s = span * rng.uniform(0.8, 1.2)
        scale[name] = s
        sd[name] = s * 10 ** rng.uniform(-3.8, -2.9)
        c = rng.normal(0, 1, 9) * np.array([0.02, 0.03, 0.01, 0.01, 0.04, 0.015, 0.008, 0.006, 0.004])
        clean[name] = s * (0.01 + q + c[0] + c[1] * u + c[2] * v + c[3] * q * q + c[4] * q * u + c[5] * q * v
                           + c[6] * u * u + c[7] * v * v + c[8] * u * v)
    z = [(x - x.mean()) / x.std() for x in (p, ts, te)]
    model = np.column_stack([np.ones(n)] + z + [z[i] * z[j] for i in range(3) for j in range(i, 3)])
    began = np.array([t[w == k].min() - pace for k in w])
    return Lab("whole_plots",
               {"whole_plot": (w, 0), "order": (np.arange(1, n + 1), 0), "elapsed_s": (t, 0), "pressure_psia": (p, 3),
                "sensor_temperature_degC": (ts, 2), "sse_temperature_degC": (te, 2)},
               clean, sd, model, np.ones(n), w, float(rng.uniform(0.25, 0.7)), [],
               {"w": w, "t": t, "p": p, "q": q, "ts": ts, "te": te, "level": l, "nominal": nominal, "full": full, "in_plot": t - began,
                "scale": scale, "plots": plots, "levels": levels, "pace": pace})


def _all(lab, h, rng, spread=0.3):
    """The same in every bridge, by its sensitivity and a factor of its own; the first has one."""
    return {n: lab.more["scale"][n] * h * (1.0 if i == 0 else rng.uniform(1 - spread, 1 + spread)) for i, n in enumerate(lab.clean)}


# ---- everyday

def elastic_memory(lab, rng):
    """Three play elements in parallel (Prandtl and Ishlinskii), vented before each plot."""
    q, w = lab.more["q"], lab.more["w"]
    h = np.zeros(lab.n)
    for radius, weight in ((0.04, 1.0), (0.12, 0.7), (0.3, 0.5)):
        for i in range(lab.n):
            if i == 0 or w[i] != w[i - 1]:
                at = 0.0
            at = min(max(at, q[i] - radius), q[i] + radius)
            h[i] += weight * (at - q[i])
    return _all(lab, h, rng)


def short_soak(lab, rng):
    m = lab.more
    tau = rng.uniform(0.25, 0.6) * m["levels"] * m["pace"]
    mean = np.array([m["ts"][m["w"] == k].mean() for k in range(1, m["plots"] + 1)])
    jump = np.diff(np.concatenate([[20.0], mean]))[m["w"] - 1]
    jump[m["w"] == 1] = jump[m["w"] == 1] * 0.5          # the first plot begins after a longer soak
    return _all(lab, jump / 40 * np.exp(-m["in_plot"] / tau) * (1 + 0.3 * m["q"]), rng)


def stretched_diaphragm(lab, rng):
    """Deflection d of a diaphragm that bends and stretches: d + k d^3 = load."""
    k = rng.uniform(0.1, 0.4)
    d = lab.more["q"].copy()
    for _ in range(60):
        d = d - (d + k * d ** 3 - lab.more["q"]) / (1 + 3 * k * d * d)
    return _all(lab, d - lab.more["q"], rng)


def room_day(lab, rng):
    m = lab.more
    return _all(lab, m["q"] * np.sin(2 * math.pi * m["t"] / 86400 + rng.uniform(0, 2 * math.pi)), rng, 0.0)


# ---- unlisted

def snubber_effusion(lab, rng):
    """Thermal transpiration in a sintered snubber (Takaishi and Sensui, nitrogen): pressure at the cold end is below that at the gauge."""
    m = lab.more
    cold, warm = m["ts"] + 273.15, 295.0
    torr = m["p"] * 51.715
    pore = rng.uniform(0.8, 2.5) * 0.015 / m["full"]      # mm; makers choose finer pores for higher ranges
    x = 2 * torr * pore / (cold + warm)
    fraction = 1 / (12e5 * x * x + 1e3 * x + 14 * np.sqrt(x) + 1)
    return _all(lab, -m["q"] * (1 - np.sqrt(cold / warm)) * fraction, rng, 0.0)


def frost_plug(lab, rng):
    """Carbon dioxide in the test gas freezes in the line when its share of the pressure is above the sublimation pressure."""
    m = lab.more
    kelvin = m["ts"] + 273.15
    sublime = 10 ** (6.81228 - 1301.679 / (kelvin - 3.494)) * 14.504      # psi
    edge = np.quantile(kelvin, rng.uniform(0.4, 0.6))
    share = 10 ** (6.81228 - 1301.679 / (edge - 3.494)) * 14.504 / (0.5 * m["full"])
    above = np.log(share * m["p"] / sublime)
    plug = np.where(above > 0, 1 - np.exp(-above / rng.uniform(0.5, 1.5)), 0.0)
    h, before = np.zeros(lab.n), 0.0
    for i in range(lab.n):
        if i == 0 or m["w"][i] != m["w"][i - 1]:
            before = 0.0
        h[i] = 0.3 * plug[i] * (before - m["q"][i])
        before = m["q"][i] + h[i]
    return _all(lab, h, rng, 0.0)


def gel_freeze(lab, rng):
    """Silicone gel over the diaphragm crystallises when it is cooled far enough and melts much warmer."""
    m = lab.more
    low, high = rng.uniform(-100, -90), rng.uniform(-82, -70)
    frozen, h = False, np.zeros(lab.n)
    zero = rng.uniform(-0.4, 0.4)
    for i in range(lab.n):
        frozen = m["ts"][i] < (high if frozen else low)
        h[i] = (zero - m["q"][i]) if frozen else 0.0
    return _all(lab, h, rng)


def wrong_plate(lab, rng):
    """Masses of a dead-weight tester in binary steps; one plate is not what it is marked."""
    m = lab.more
    step = m["full"] / 16
    units = np.floor(m["nominal"] / step + 1e-9).astype(int)
    fit = []
    for plate in (1, 2, 4):
        on = (units // plate) % 2
        z = np.vander(m["nominal"], 3)
        rest = on - z @ np.linalg.lstsq(z, on, rcond=None)[0]
        if np.std(rest) > 0.25:
            fit.append(on)
    on = fit[int(rng.integers(len(fit)))]
    return _all(lab, rng.choice([-1, 1]) * on[m["level"]].astype(float), rng, 0.0)


EFFECTS = {"elastic_memory": elastic_memory, "short_soak": short_soak, "stretched_diaphragm": stretched_diaphragm, "room_day": room_day,
           "snubber_effusion": snubber_effusion, "frost_plug": frost_plug, "gel_freeze": gel_freeze, "wrong_plate": wrong_plate}
PAIRS = [("elastic_memory", "wrong_plate"), ("short_soak", "frost_plug"), ("room_day", "gel_freeze")]
ABOUT = {
    "elastic_memory": "Everyday: elastic hysteresis of the diaphragm, three play elements from a vented start in each plot. "
                      "Depends on the pressure and on the pressures before it in the plot. Always; all bridges.",
    "short_soak": "Everyday: the plot begins before the sensor has reached the chamber's temperature; the zero (and a little of the span) decays. "
                  "Depends on the time in the plot (exponential), times the step of sensor temperature from the plot before. First rows of plots after great steps.",
    "stretched_diaphragm": "Everyday: the diaphragm stiffens at large deflection (d + k d^3 = p), an odd curve beyond the quadratic. Depends on pressure. Always.",
    "room_day": "Everyday: the room's daily temperature expands the piston of the pressure standard. "
                "Depends on time (sine of 24 h), times pressure. Always; the same in all bridges.",
    "snubber_effusion": "Unlisted: thermal transpiration in the micrometre pores of a sintered snubber between the warm gauge and the cold sensor (Takaishi and Sensui). "
                        "Depends on pressure and sensor temperature: largest at low pressure in cold plots, with a maximum and then like 1/p.",
    "frost_plug": "Unlisted: carbon dioxide in the test gas freezes in the line when its share of the pressure passes the sublimation pressure; the plug holds back part of the "
                  "pressure change. Depends on the move of pressure from the row before, times a function of pressure and sensor temperature that is nought above a frost point. Cold plots.",
    "gel_freeze": "Unlisted: the gel on the diaphragm crystallises below some -95 degC and melts only above some -76 degC; frozen it lowers the span and shifts the zero. "
                  "Depends on sensor temperature and on the plot before it (between the two temperatures), times a line in pressure. Sudden.",
    "wrong_plate": "Unlisted: one mass of the dead-weight tester's binary stack is wrong, so that the error is there only at pressures whose stack has that plate. "
                   "Depends on pressure (square wave). Always; the same in all bridges.",
}
