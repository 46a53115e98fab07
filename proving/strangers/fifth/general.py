"""Other tables of a laboratory: load cell, bath thermometer, turbine flow meter, voltmeter."""
import numpy as np

from . import common as c

NOISES = {
    "white": c.white, "student": c.student, "skewed": c.skewed, "contaminated": c.contaminated, "uniform": c.uniform,
    "ar1": c.ar1, "bursts": c.bursts, "quantized": c.white, "by_level": c.by_level,
}


def wander(r, t, scale):
    """Something in the room that goes its own slow way."""
    return scale * (np.sin(2 * np.pi * t / r.uniform(0.3, 1.2) / t.max() + r.uniform(0, 6.28))
                    + 0.5 * np.sin(2 * np.pi * t / r.uniform(0.1, 0.25) / t.max() + r.uniform(0, 6.28))) + 0.05 * scale * r.standard_normal(len(t))


# ---- the four tables: columns, options, setting, straight line, sigma -------------------------------------

def load_cell(r):
    top = float(r.choice([5, 20, 50, 100]))
    series, levels = int(r.integers(4, 8)), int(r.integers(8, 13))
    grid = np.linspace(0, top, levels)
    F, dire, ser, op = [], [], [], []
    who = list(r.choice(["Anne", "Bruno", "Chen", "Dora", "Emil"], 2, replace=False))
    for k in range(series):
        peak = top if r.random() < 0.6 else grid[int(r.integers(levels // 2, levels))]
        up = [f for f in grid if f <= peak + 1e-9]
        down = up[-2::-1]
        cut, me = int(r.integers(3, len(up) + len(down) - 3)), int(r.integers(0, 2))
        for i, f in enumerate(up + down):
            F.append(f), dire.append(1 if i < len(up) else -1), ser.append(k + 1), op.append(who[me if i < cut else 1 - me])
    n = len(F)
    t = np.cumsum(r.uniform(25, 110, n) + 600.0 * np.r_[0, np.diff(ser)])
    t -= t[0]
    cols = {"order": c.text(np.arange(1, n + 1), 0), "elapsed_s": c.text(t, 0), "series": c.text(ser, 0), "direction": c.text(dire, 0),
            "force_kN": c.text(F, 3), "operator": c.text(op), "room_degC": c.text(22 + wander(r, t, 0.5), 2),
            "humidity_pct": c.text(45 + wander(r, t, 5), 1)}
    return cols, "force_kN", "signal_mV_per_V", (r.uniform(-0.02, 0.02), 2.0 / top), 10 ** r.uniform(-4.6, -3.8), \
        ["--time", "elapsed_s", "--replicate", "series", "--direction", "direction"]


def thermometer(r):
    stays, per = int(r.integers(14, 28)), int(r.integers(4, 8))
    lo, hi = r.uniform(-45, -25), r.uniform(60, 95)
    b = r.uniform(lo, hi, stays)
    b[r.permutation(stays)[:stays // 3]] = r.uniform(lo, 0, stays // 3)      # more work in the cold
    if r.random() < 0.4:
        b = np.r_[np.sort(b[:stays // 2]), np.sort(b[stays // 2:])[::-1]]
    n = stays * per
    t = np.cumsum(r.uniform(60, 240, n) + np.where(np.arange(n) % per == 0, 1500, 0))
    t -= t[0]
    bath = np.repeat(b, per) + 0.02 * r.standard_normal(n)
    imm = r.choice([80, 110, 140, 180, 220, 260], n) + r.integers(-4, 5, n)
    cols = {"elapsed_s": c.text(t, 0), "bath_degC": c.text(bath, 3), "immersion_mm": c.text(imm, 0),
            "room_degC": c.text(21.5 + wander(r, t, 1.0), 2), "humidity_pct": c.text(48 + wander(r, t, 9), 1),
            "stirrer_rpm": c.text(r.choice([300, 600, 900]) + 10 * r.standard_normal(n), 0)}
    return cols, "bath_degC", "output_mV", (r.uniform(50, 150), r.uniform(0.8, 1.2)), 10 ** r.uniform(-2.4, -1.7), ["--time", "elapsed_s"]


def flow_meter(r):
    n = int(r.integers(90, 260))
    top = float(r.choice([40, 100, 250]))
    q = top * np.exp(r.uniform(np.log(0.06), 0, n)) if r.random() < 0.5 else top * r.uniform(0.05, 1, n)
    run = r.choice([30, 60, 120], n)
    t = np.cumsum(run + r.uniform(40, 120, n))
    t -= t[0]
    rpm = np.clip(900 + 1900 * q / top * r.uniform(0.75, 1.25, n) + 150 * r.standard_normal(n), 600, 3400)
    cols = {"run": c.text(np.arange(1, n + 1), 0), "elapsed_s": c.text(t, 0), "flow_L_per_min": c.text(q, 3),
            "water_degC": c.text(24 + wander(r, t, 5), 2), "line_kPa": c.text(180 + 60 * r.random(n) + 0.03 * rpm, 1),
            "pump_rpm": c.text(rpm, 0), "collection_s": c.text(run, 0)}
    return cols, "flow_L_per_min", "meter_Hz", (r.uniform(-1, 0), r.uniform(700, 900) / top), 10 ** r.uniform(-1.2, -0.6), ["--time", "elapsed_s"]


def voltmeter(r):
    n = int(r.integers(100, 300))
    v = r.uniform(-10, 10, n) if r.random() < 0.5 else np.round(r.uniform(-10, 10, n) * 4) / 4 + r.choice([0, 0.013], n)
    t = np.cumsum(r.uniform(4, 30, n) * r.choice([1, 1, 1, 3], n))
    re = (r.random(n) < r.uniform(0.07, 0.15)).astype(int)
    re[0] = 1
    t = t + np.cumsum(re * r.uniform(20, 60, n))
    t -= t[0]
    cols = {"elapsed_s": c.text(t, 1), "applied_V": c.text(v, 3), "reconnected": c.text(re, 0),
            "room_degC": c.text(23 + wander(r, t, 0.6), 2), "humidity_pct": c.text(50 + wander(r, t, 8), 1),
            "mains_V": c.text(231 + 1.5 * r.standard_normal(n), 1)}
    return cols, "applied_V", "deviation_uV", (r.uniform(-20, 20), r.uniform(-8, 8)), 10 ** r.uniform(0, 0.8), ["--time", "elapsed_s"]


# ---- effects ------------------------------------------------------------------------------------------------

def anelastic_creep(d, r):
    return c.low_pass(d["force_kN"], d["elapsed_s"], r.uniform(200, 900))


def sweep_hysteresis(d, r):
    u = d["force_kN"] / d["force_kN"].max()
    return d["direction"] * u * (1 - u) ** r.uniform(0.6, 1.2)


def hasty_operator(d, r):
    who = sorted(set(d["operator"]))
    name = who[int(r.integers(0, len(who)))]
    hasty = np.array([float(o == name) for o in d["operator"]])
    step = np.diff(d["force_kN"], prepend=0.0)
    return -hasty * step * np.exp(-np.diff(d["elapsed_s"], prepend=-60.0) / r.uniform(12, 50))


def stem_conduction(d, r):
    return np.exp(-d["immersion_mm"] / r.uniform(35, 80)) * (d["room_degC"] - d["bath_degC"])


def frost_on_stem(d, r):
    dry = np.quantile(d["humidity_pct"], r.uniform(0.1, 0.5))
    thaw, full = r.uniform(3, 10), r.uniform(2e4, 8e4)
    m, ice = 0.0, np.zeros(len(d["elapsed_s"]))
    dt = np.diff(d["elapsed_s"], prepend=0.0)
    for i in range(len(ice)):
        if d["bath_degC"][i] > thaw:
            m = 0.0
        elif d["bath_degC"][i] < 0:
            m += max(d["humidity_pct"][i] - dry, 0) * dt[i]
        ice[i] = 1 - np.exp(-m / full)
    return ice * (d["room_degC"] - d["bath_degC"])


def viscous_threshold(d, r):
    nu = np.exp(-0.0235 * (d["water_degC"] - 20))
    re = d["flow_L_per_min"] / nu
    edge = np.quantile(re, r.uniform(0.25, 0.5))
    return -np.maximum(1 - re / edge, 0) ** r.uniform(1, 1.6)


def pump_lock(d, r):
    turn = d["flow_L_per_min"] / d["flow_L_per_min"].max() * r.uniform(38, 52)       # revolutions per second of the rotor
    u = (turn - d["pump_rpm"] / 60 * r.choice([0.5, 1.0])) / r.uniform(1.5, 4.0)
    return -u / (1 + u ** 4)


def adc_ripple(d, r):
    return np.sin(2 * np.pi * d["applied_V"] / r.choice([0.625, 1.25, 2.5]) * r.uniform(0.97, 1.03) + r.uniform(0, 6.28))


def humid_absorption(d, r):
    edge = np.quantile(d["humidity_pct"], r.uniform(0.4, 0.65))
    wet = np.maximum(d["humidity_pct"] - edge, 0)
    v = d["applied_V"]
    return wet * (c.low_pass(v, d["elapsed_s"], r.uniform(20, 90)) - v)


def lead_touch(d, r):
    last, since = 0.0, np.zeros(len(d["elapsed_s"]))
    for i, t in enumerate(d["elapsed_s"]):
        if d["reconnected"][i] > 0:
            last = t
        since[i] = t - last
    return np.exp(-since / r.uniform(30, 150))


TABLES = {"load_cell": load_cell, "thermometer": thermometer, "flow_meter": flow_meter, "voltmeter": voltmeter}
OF = {"anelastic_creep": "load_cell", "sweep_hysteresis": "load_cell", "hasty_operator": "load_cell", "stem_conduction": "thermometer",
      "frost_on_stem": "thermometer", "viscous_threshold": "flow_meter", "pump_lock": "flow_meter", "adc_ripple": "voltmeter",
      "humid_absorption": "voltmeter", "lead_touch": "voltmeter"}
EFFECTS = {name: globals()[name] for name in OF}
PAIRS = [("anelastic_creep", "hasty_operator"), ("sweep_hysteresis", "hasty_operator"), ("stem_conduction", "frost_on_stem"),
         ("viscous_threshold", "pump_lock"), ("adc_ripple", "humid_absorption"), ("humid_absorption", "lead_touch")]

ABOUT = {
    "anelastic_creep": "Everyday; load cell. The spring element creeps: part of the signal is a memory (200 to 900 s of elapsed_s) of earlier "
        "force_kN. Seen as loops and as zeros that come back late, also from one series to the next.",
    "sweep_hysteresis": "Everyday; load cell. Up and down runs differ: direction times a hump in force_kN, skew.",
    "hasty_operator": "Unlisted, human; load cell. One of the two operators (operator) does not wait: the reading lags by the change of "
        "force_kN from the row before, dying with the elapsed_s between the two rows. Nothing for the other operator.",
    "stem_conduction": "Everyday; thermometer. Heat along the stem: exp(-immersion_mm / length) times (room_degC - bath_degC). Matters at "
        "shallow immersion, far from room temperature.",
    "frost_on_stem": "Unlisted; thermometer. Below 0 in the bath, frost grows on the stem with time and with humidity_pct above a dry limit; it "
        "stays until the bath has been above some degrees. Ice short-circuits the stem: saturating frost times (room_degC - "
        "bath_degC). Depends on the history of bath_degC, humidity_pct and elapsed_s.",
    "viscous_threshold": "Everyday; flow meter. Below a Reynolds number the turbine lags: flow_L_per_min over the viscosity at water_degC, a hinge. "
        "Nothing above.",
    "pump_lock": "Unlisted; flow meter. The pump's pulsation pulls the rotor towards its own rate when the two nearly agree: antisymmetric "
        "in the difference of flow_L_per_min (as rotor speed) and pump_rpm (or half of it), nothing far away. Neither column "
        "alone shows it.",
    "adc_ripple": "Everyday; voltmeter. The converter's integral nonlinearity repeats in applied_V (about 0.6, 1.25 or 2.5 V).",
    "humid_absorption": "Unlisted; voltmeter. Above a humidity_pct the input card's dielectric takes up water and remembers: (memory, 20 to 90 s, of "
        "earlier applied_V minus the present) times the excess of humidity. Nothing when dry.",
    "lead_touch": "Unlisted, human; voltmeter. The operator warms the terminals with his fingers when he re-plugs the leads (reconnected = 1): a "
        "thermal voltage of one sign that dies in 30 to 150 s of elapsed_s since the last re-plugging.",
}


def table(effects, seed, size, noise):
    kinds = {OF[e] for e in effects}
    if len(kinds) > 1:
        raise ValueError("these effects do not meet in one table: " + ", ".join(effects))
    which = kinds.pop() if kinds else list(TABLES)[int(c.stream("general", "which", seed).integers(0, 4))]
    return _table(which, effects, seed, size, noise)


def _table(which, effects, seed, size, noise):
    cols, setting, response, (b, m), sigma, options = TABLES[which](c.stream("general", "design", which, seed))
    d = {k: v[0] for k, v in cols.items()}
    x = np.asarray(d[setting], float)
    n = len(x)
    model = np.column_stack([np.ones(n), x])
    hidden, sizes, shares = np.zeros(n), {}, {}
    for e in effects:
        share, (shape,) = c.draw(lambda r: [EFFECTS[e](d, r)], ("general", e, seed), model)
        k = size * sigma / c.rms(c.residual(shape, model))
        k *= 1 if e in ("anelastic_creep", "hasty_operator", "viscous_threshold", "pump_lock", "stem_conduction") else \
            c.stream("general", "sign", e, seed).choice([-1, 1])
        hidden = hidden + k * shape
        sizes[e], shares[e] = c.rms(c.residual(k * shape, model)) / sigma, share
    z = NOISES[noise](c.stream("general", "noise", noise, which, seed), n, level=np.abs(x) / np.abs(x).max(), block=None)
    q = 1.0 if noise == "quantized" else 0.0
    y = b + m * x + hidden + sigma * z * np.sqrt(1 - q * q / 12)
    if q:
        y = np.round(y / (q * sigma)) * (q * sigma)
    cols[response] = c.text(y, c.decimals(sigma))
    words = ["--response", response, "--formula", f"1 + {setting}"] + options
    return c.Table("general", effects, seed, noise, cols, words, [response], hidden, sizes, sigma, None, model, shares)
