"""Benches of many kinds: one response, one or two declared settings, and what the laboratory wrote down beside."""
import numpy as np
from ._core import stream

KIND = "general"
# setting, its tops, decimals; second setting, low, high, decimals; response, full scale
BENCHES = [
    ("force_N", (50.0, 200.0, 1000.0), 3, "excitation_V", 5.0, 10.0, 3, "bridge_mV", 20.0),
    ("x_mm", (5.0, 25.0, 100.0), 4, "drive_V", 1.0, 5.0, 3, "y_mV", 900.0),
    ("flow_L_per_min", (10.0, 60.0, 300.0), 3, "line_bar", 1.0, 6.0, 3, "frequency_Hz", 1500.0),
    ("bath_degC", (80.0, 150.0, 400.0), 3, "immersion_mm", 60.0, 200.0, 0, "emf_uV", 6000.0),
    ("torque_N_m", (2.0, 20.0, 500.0), 4, "arm_mm", 100.0, 500.0, 1, "signal_mV", 15.0),
    ("concentration_mg_L", (5.0, 50.0, 1000.0), 3, "path_mm", 5.0, 50.0, 1, "absorbed_mA", 4.0),
]
PEOPLE = ["Ada", "Bruno", "Chen", "Dora", "Emil", "Fatima", "Goran", "Hanne"]


def design(seed):
    rng = stream(KIND, seed, "design")
    xn, tops, xd, wn, wlo, whi, wd, yn, fs = BENCHES[int(rng.integers(len(BENCHES)))]
    top = float(tops[int(rng.integers(3))])
    fs = fs * rng.uniform(0.5, 1.5)
    style = rng.choice(["up and down", "random grid", "random"])
    reps = int(rng.integers(2, 6))
    x, rep = [], []
    if style == "up and down":
        levels = int(rng.integers(6, 14))
        sweeps = int(rng.integers(1, 4))
        one = np.concatenate([np.linspace(0, 1, levels), np.linspace(1, 0, levels)])
        one = np.tile(one, sweeps)
        while len(one) * reps < 44:
            one = np.tile(one, 2)
        for k in range(reps):
            x.append(one)
            rep.append(np.full(len(one), k + 1))
    else:
        m = int(rng.integers(max(12, 44 // reps + 1), 75))
        for k in range(reps):
            if style == "random":
                v = rng.random(m)
            else:
                levels = int(rng.integers(6, 12))
                v = rng.permutation(np.resize(np.linspace(0, 1, levels), m))
            x.append(v)
            rep.append(np.full(m, k + 1))
    x, rep = np.concatenate(x), np.concatenate(rep)
    n = len(x)
    x = np.round(top * np.clip(0.03 + 0.94 * x + 0.008 * rng.standard_normal(n), 0.0, 1.0), xd)
    direction = np.where(np.diff(x, prepend=-1.0) >= 0, 1, -1)
    # time: 7 to 30 hours of work in all, breaks between replicates
    wait = np.round(np.exp(rng.normal(np.log(rng.uniform(15, 40)), 0.6, n)), 0) + 3
    pace = rng.uniform(7, 30) * 3600 / n
    gap = pace * rng.uniform(0.6, 1.4, n) + wait
    starts = np.flatnonzero(np.diff(rep, prepend=0))
    for s in starts[1:]:
        gap[s] += rng.choice([600.0, 3600.0, 12 * 3600.0])
    gap[0] = 60.0
    t = np.round(np.cumsum(gap), 0)
    # second setting: by blocks, or row by row
    states = np.linspace(wlo, whi, int(rng.integers(3, 6)))
    block = int(rng.choice([1, 1, 5, 9]))
    w = states[rng.integers(0, len(states), n // block + 1)][np.arange(n) // block]
    if rng.random() < 0.4:
        w = np.clip(w + 0.05 * (whi - wlo) * rng.standard_normal(n), wlo, whi)
    w = np.round(w, wd)
    # the room
    walk = np.cumsum(rng.standard_normal(n)) / np.sqrt(n)
    room = rng.uniform(19.5, 23) + rng.uniform(0.6, 2) * np.sin(2 * np.pi * (t / 86400 + rng.random())) + 0.7 * walk
    room = np.round(room + 0.1 * rng.standard_normal(n), 2)
    damp = np.cumsum(rng.standard_normal(n)) / np.sqrt(n)
    humidity = 46 - 2.5 * (room - room.mean()) + 7 * damp + 5 * np.sin(2 * np.pi * (t / 50000 + rng.random()))
    humidity = np.round(np.clip(humidity + 0.5 * rng.standard_normal(n), 15, 90), 1)
    # people: by shifts of some rows, or by turns
    crew = list(rng.permutation(PEOPLE)[: int(rng.integers(2, 5))])
    span = int(rng.choice([1, 4, 10]))
    blocks = n // span + 1
    turns = np.resize(np.arange(len(crew)), blocks)
    turns = rng.permutation(turns)
    who = turns[np.arange(n) // span]
    operator = [str(crew[i]) for i in who]
    span = int(rng.choice([1, 3, 8]))
    scale = rng.permutation(np.resize([1, 2, 3], n // span + 1))[np.arange(n) // span]
    second = rng.random() < 0.7
    clean = fs * (rng.normal(0, 0.05) + rng.choice([-1.0, 1.0], p=[0.2, 0.8]) * x / top)
    if second:
        clean = clean + fs * rng.normal(0, 0.15) * (w - wlo) / (whi - wlo)
    sd = fs * 10 ** rng.uniform(-4, -2.7)
    tn = str(rng.choice(["t_s", "elapsed_s", "time_s"]))
    rn = str(rng.choice(["replicate", "run", "series"]))
    columns = [(rn, rep, None), (tn, t, 0), (xn, x, xd), (wn, w, wd)]
    columns.append(("direction", direction, None))
    columns += [("room_degC", room, 2), ("humidity_pct", humidity, 1), ("operator", operator, None),
                ("range", scale, None), ("wait_s", wait, 0)]
    if rng.random() < 0.4:
        baro = np.round(1008 + 6 * np.sin(t / 60000 + 6 * rng.random()) + 0.2 * rng.standard_normal(n), 1)
        columns.append(("barometer_hPa", baro, 1))
    if rng.random() < 0.3:
        columns.append(("mains_V", np.round(230 + 1.5 * rng.standard_normal(n), 1), 1))
    formula = "1 + %s" % xn + (" + %s" % wn if second else "")
    options = ["--response", yn, "--formula", formula]
    if rng.random() < 0.85:
        options += ["--time", tn]
    if rng.random() < 0.5:
        options += ["--replicate", rn]
    if rng.random() < 0.5:
        options += ["--direction", "direction"]
    model = [np.ones(n), x] + ([w] if second else [])
    return dict(x=x, w=w, top=top, rep=rep, starts=starts, t=t, direction=direction, room=room, humidity=humidity,
                who=who, scale=scale, wait=wait, clean=clean[:, None], sd=np.array([sd]), columns=columns,
                responses=[yn], options=options, grow=x, noise_groups=rep, groups=None, model=np.column_stack(model))


def room_sensitivity(d, rng):
    return (d["room"] - 20.0) * d["x"] / d["top"]


def drift(d, rng):
    u = d["t"] / d["t"][-1]
    bend = rng.uniform(0.0, 3.0)
    return u if bend < 0.5 else (1 - np.exp(-bend * u))


def hysteresis(d, rng):
    u = d["x"] / d["top"]
    return d["direction"] * 4 * u * (1 - u)


def damp_leak_on_top_range(d, rng):
    at = d["scale"] == 3
    limit = np.quantile(d["humidity"][at], rng.uniform(0.3, 0.55))
    return np.where(at, np.maximum(d["humidity"] - limit, 0.0), 0.0) / 10


def habit_of_one_reader(d, rng):
    ids, counts = np.unique(d["who"], return_counts=True)
    ids = ids[counts >= 0.15 * len(d["who"])]
    one = ids[int(rng.integers(len(ids)))]
    mark = d["top"] / rng.uniform(5.3, 12.7)
    return np.where(d["who"] == one, np.round(d["x"] / mark) * mark - d["x"], 0.0) / d["top"]


def compressor_on_the_hour(d, rng):
    long = rng.uniform(600, 1100)
    phase = d["t"][int(rng.integers(len(d["t"])))] - rng.uniform(0.1, 0.9) * long
    return np.where(np.mod(d["t"] - phase, 3600.0) < long, 0.25 + d["x"] / d["top"], 0.0)


def bruises_of_the_pad(d, rng):
    limit = rng.uniform(0.6, 0.8) * d["top"]
    power = rng.choice([0.5, 1.0])
    out = np.zeros(len(d["x"]))
    for k in np.unique(d["rep"]):
        at = np.flatnonzero(d["rep"] == k)
        heavy = (d["x"][at] > limit).astype(float)
        out[at] = (np.cumsum(heavy) - heavy) ** power
    return out


def short_wait(d, rng):
    tau = np.median(d["wait"]) * rng.uniform(0.25, 0.6)
    last = np.concatenate([d["x"][:1], d["x"][:-1]])
    last[d["starts"]] = d["x"][d["starts"]]
    return (last - d["x"]) / d["top"] * np.exp(-d["wait"] / tau)


EFFECTS = {f.__name__: f for f in (room_sensitivity, drift, hysteresis, damp_leak_on_top_range, habit_of_one_reader,
                                   compressor_on_the_hour, bruises_of_the_pad, short_wait)}
PAIRS = [("room_sensitivity", "bruises_of_the_pad"), ("drift", "habit_of_one_reader"),
         ("damp_leak_on_top_range", "short_wait")]
ABOUT = {
    "room_sensitivity": "Everyday: sensitivity changes with the room: (room_degC - 20) times the setting. Depends on room_degC"
    " and the first setting. Matters at high settings away from 20 degC.",
    "drift": "Everyday: the zero drifts with time, straight or levelling off. Depends on the time column. Matters over the"
    " whole table.",
    "hysteresis": "Everyday: readings differ going up and down, most in mid range. Depends on direction and the first setting.",
    "damp_leak_on_top_range": "Unlisted: on range 3 (high impedance) damp insulation leaks once the humidity passes a limit"
    " (30 to 55 % quantile of that range's rows): range == 3 times max(0, humidity - limit). Depends on range and humidity_pct"
    " together, with a threshold. Matters on damp days on range 3.",
    "habit_of_one_reader": "Unlisted: one operator sets and reads the dial at its nearest long mark (marks 1/5.3 to 1/12.7 of the"
    " top apart): (nearest mark - setting), for that person only. Depends on operator and the first setting (a saw-tooth)."
    " Matters between marks.",
    "compressor_on_the_hour": "Unlisted: a neighbour's compressor runs 10 to 18 min in every hour and the supply sags: a window in"
    " time modulo 3600 s, times (0.25 + setting / top). Depends on the time column and the first setting. Matters in that part"
    " of each hour.",
    "bruises_of_the_pad": "Unlisted: each loading past 60 to 80 % of top bruises a pad which is changed before each replicate:"
    " count of earlier such rows in the replicate, or its root. Depends on the history of the first setting, and the replicate."
    " Matters late in a replicate.",
    "short_wait": "Unlisted: the reading remembers the setting before by exp(-wait / tau), tau 0.25 to 0.6 of the median wait:"
    " (last - this) times that; none in a replicate's first row. Depends on wait_s, the first setting of this and the row"
    " before. Matters after a short wait and a large step.",
}
NOISES = {
    "white": "normal, independent", "heavy_tails": "Student's t, 3 degrees of freedom",
    "ar1": "AR(1) in executed order, coefficient 0.55 to 0.92", "flicker": "1/f in executed order, some white with it",
    "growing": "sd grows with the first setting", "bursts": "2 to 5 short stretches of 4 to 8 times the sd",
    "skew": "gamma, shape 1.3, centred", "rounded": "display's step of about 1.8 sd",
    "by_replicate": "sd differs by replicate",
}
