"""Any transducer with a declared formula, with time, text columns and further settings."""
import numpy as np
from .common import ROW_NOISES, Table, assemble, rng, row_noise

NUMBER = 3
NOISES = dict(ROW_NOISES)

# stimulus, its range, second setting, its levels, response, sensitivity, is the setting in the formula
DEVICES = [
    ("gap_mm", 0, 40, "supply_V", (8, 10, 12, 14), "lvdt_mV", 25.0, False),
    ("flow_l_min", 2, 120, "line_bar", (1, 2, 3, 4, 5), "turbine_Hz", 6.5, False),
    ("force_N", 5, 900, "excitation_V", (4, 5, 8, 10), "cell_mV", 0.021, True),
    ("torque_Nm", 1, 250, "speed_rpm", (50, 100, 200, 400), "torque_mV", 0.11, False),
    ("rh_pct", 8, 92, "airflow_m_s", (0.5, 1, 2, 3), "capacitance_pF", 0.35, True),
    ("input_V", 0.2, 10, "load_kohm", (10, 20, 50, 100), "output_V", 0.97, False),
    ("bath_degC", 5, 95, "current_mA", (0.5, 1, 1.5, 2), "resistance_ohm", 0.39, True),
    ("level_cm", 3, 180, "cable_m", (5, 10, 20, 40), "loop_mA", 0.085, False),
]
PEOPLE = ["Ada", "Bruno", "Chloe", "Dilan", "Edda", "Farid", "Greta", "Hugo"]


def laboratory(seed):
    g = rng(NUMBER, seed, 1)
    x_name, a, b, w_name, w_levels, y_name, sens, both = DEVICES[int(g.integers(len(DEVICES)))]
    runs = int(g.integers(3, 7))
    per = int(g.integers(26, 50))
    n = runs * per
    run = np.repeat(np.arange(runs), per)
    first = np.arange(n) % per == 0
    if g.random() < 0.5:
        x = g.uniform(a, b, n)
    else:
        lv = np.linspace(a, b, int(g.integers(11, 17)))
        x = np.concatenate([np.concatenate([g.permutation(lv) for _ in range(6)])[:per] for _ in range(runs)])
        x = x + g.normal(0, 0.003, n) * (b - a)
        x = np.clip(x, a, None)
    digits = 4 if b < 50 else 3
    x = np.round(x, digits)
    w = g.choice(w_levels, n).astype(float)
    if g.random() < 0.5:
        sign = np.where(np.diff(x, prepend=a) >= 0, 1, -1)
    else:
        sign = g.choice([-1, 1], n)
    wait = g.integers(10, 120, n)
    pace = g.uniform(180, 420)
    dt = pace * g.uniform(0.7, 1.4, n) + wait
    dt[first] += g.uniform(2, 9) * 3600
    t = np.cumsum(dt)
    unit = str(g.choice(["time_s", "clock_min", "elapsed_h"]))
    t = np.round(t)
    if unit == "time_s":
        shown = ["%d" % v for v in t]
    elif unit == "clock_min":
        shown = ["%.2f" % (v / 60) for v in t]
    else:
        shown = ["%.4f" % (v / 3600) for v in t]
    room = g.uniform(20, 24) + g.uniform(0.3, 0.8) * np.sin(2 * np.pi * t / 86400 + g.uniform(0, 6))
    walk = np.zeros(n)
    for i in range(1, n):
        walk[i] = 0.88 * walk[i - 1] + g.normal(0, 0.3)
    room = np.round(room + walk, 2)
    hum = np.round(g.uniform(35, 55) + g.normal(0, 0.7, n) + 3 * np.sin(t / 30000 + g.uniform(0, 6)), 1)
    mains = np.round(230 + g.normal(0, 1.8, n), 1)
    baro = np.round(g.uniform(985, 1020) + 4 * np.sin(t / 90000 + g.uniform(0, 6)) + g.normal(0, 0.1, n), 1)
    people = list(g.permutation(PEOPLE)[:int(g.integers(2, 5))])
    who, k = [], int(g.integers(len(people)))
    until = 0
    for i in range(n):
        if i >= until:
            k = (k + 1 + (int(g.integers(len(people) - 1)) if len(people) > 2 else 0)) % len(people)
            until = i + int(g.integers(7, 15))
        who.append(k)
    who = np.array(who)
    rng_col = g.integers(1, 4, n)
    replicates = bool(g.random() < 0.6)
    moving = replicates and g.random() < 0.5
    span = sens * (b - a)
    sd = span * g.choice([3e-4, 1e-3, 2e-3])
    model = [np.ones(n), x] + ([w] if both else [])
    gain = sens * g.uniform(0.9, 1.1) * g.choice([-1, 1])
    declared = g.normal(0, 0.05) * span + gain * x
    if both:
        declared = declared + w * g.uniform(-0.1, 0.1) * span / max(w_levels)
    person = str(g.choice(["operator", "person", "observer"]))
    text = g.random() < 0.5
    letters = g.random() < 0.5
    pool = [(x_name, ["%.*f" % (digits, v) for v in x]), (w_name, ["%g" % v for v in w]),
            ("direction", [("up" if v > 0 else "down") if text else "%d" % v for v in sign])]
    rest = [(str(g.choice(["room_degC", "air_degC", "bench_degC"])), ["%.2f" % v for v in room]),
            (person, [str(people[v]) for v in who]),
            ("range", ["ABC"[v - 1] if letters else "%d" % v for v in rng_col]),
            ("wait_s", ["%d" % v for v in wait]), ("mains_V", ["%.1f" % v for v in mains])]
    if g.random() < 0.6:
        rest.append(("humidity_pct", ["%.1f" % v for v in hum]))
    if g.random() < 0.5:
        rest.append(("barometer_hPa", ["%.1f" % v for v in baro]))
    rest = [rest[i] for i in g.permutation(len(rest))]
    run_name = str(g.choice(["run", "series", "session"]))
    cols = ([(run_name, ["%d" % (v + 1) for v in run])] if replicates else []) + [(unit, shown)] + pool + rest
    options = ["--response", y_name, "--formula", "1 + " + x_name + (" + " + w_name if both else ""), "--time", unit]
    if replicates:
        options += ["--replicate", run_name]
    shift = g.normal(0, 0.5 * sd, runs)[run] if moving else np.zeros(n)
    z = (x - a) / (b - a)
    forms = [0.4 + 1.6 * z, 0.4 + 2.2 * np.abs(z - g.uniform(0.3, 0.7)), np.where(who == who[n // 2], 2.0, 0.7),
             np.where(rng_col == 3, 2.0, 0.8), 0.5 + 1.6 * t / t[-1], np.where(wait < 40, 1.9, 0.8)]
    return Table(n=n, run=run, first=first, x=x, z=z, w=w, sign=sign, wait=wait.astype(float), t=t, room=room, who=who,
                 replicates=replicates, responses=[(y_name, declared, sd)], shifts=[shift], columns=cols,
                 options=options, model=np.column_stack(model), groups=np.ones(n), forms=forms)


def room_zero(lab, g, j):
    """The offset of the input stage goes with the air around it, a minute or two late."""
    inside = lab.room.copy()
    for i in range(1, lab.n):
        inside[i] = lab.room[i] + (inside[i - 1] - lab.room[i]) * np.exp(-(lab.t[i] - lab.t[i - 1]) / 100.0)
    return inside - lab.room.mean()


def bridge_bow(lab, g, j):
    """One active arm in a bridge of four: the output is u / (1 + u), not u."""
    u = g.uniform(0.02, 0.08) * lab.z
    return u / (1 + u) - u


def drift_since_zero(lab, g, j):
    """The zero is set at the start of each run and creeps away from there, always the same way, slower with the hours."""
    start = lab.t[lab.first][lab.run]
    hours = (lab.t - start) / 3600
    tau = g.uniform(1.0, 3.0)
    return 1 - np.exp(-hours / tau)


def guide_friction(lab, g, j):
    """Friction of the guide grows with the load on it and works against the way of approach."""
    return -lab.sign * (0.1 + lab.z)


def handover(lab, g, j):
    """Who takes over moves the chair, the cable and the trim until it suits; in some readings the bench comes back to rest."""
    tau = g.uniform(2.0, 3.5) * float(np.median(np.diff(lab.t)))
    state, out = 0.0, np.empty(lab.n)
    for i in range(lab.n):
        if i:
            state *= np.exp(-min(lab.t[i] - lab.t[i - 1], 3 * tau) / tau)
        if i == 0 or lab.who[i] != lab.who[i - 1]:
            state = 1.0
        out[i] = state
    return out


def squeal(lab, g, j):
    """At one stretch of the range a part of the frame sings; pull of the resonance turns its sign as one passes through."""
    at, half = g.uniform(0.3, 0.7), g.uniform(0.05, 0.09)
    d = (lab.z - at) / half
    return (g.uniform(0.7, 1.3) + g.uniform(-0.5, 0.5) * d) / (1 + d * d)


def hourly_backup(lab, g, j):
    """At each full hour the logger's computer saves its files. It loads the common supply, less and less, for some minutes."""
    phase = np.mod(lab.t - g.uniform(0, 3600), 3600)
    length = g.uniform(600, 1100)
    return np.where(phase < length, 1 - 0.5 * phase / length, 0.0)


def tired_arm(lab, g, j):
    """Each setting is cranked by hand. The arm tires with the way and rests with the time; a tired arm leans on the crank."""
    tired, out = 0.0, np.empty(lab.n)
    rest = g.uniform(900, 2000)
    for i in range(lab.n):
        if i:
            tired *= np.exp(-(lab.t[i] - lab.t[i - 1]) / rest)
            tired += abs(lab.z[i] - lab.z[i - 1])
        out[i] = tired * lab.sign[i]
    return out


EFFECTS = {f.__name__: f for f in (room_zero, bridge_bow, drift_since_zero, guide_friction,
                                   handover, squeal, hourly_backup, tired_arm)}
PAIRS = [("room_zero", "squeal"), ("bridge_bow", "handover"), ("guide_friction", "hourly_backup")]
ABOUT = {
    "room_zero": "Everyday. Offset goes with room temperature, a little late. Depends on the air temperature. Matters over the day.",
    "bridge_bow": "Everyday. Bridge with one active arm is bowed: a square term. Depends on the stimulus (first term of the formula).",
    "drift_since_zero": "Everyday. Zero is set at the start of a run and drifts from there. Depends on time in the run. Matters in the first "
                        "hours of each run.",
    "guide_friction": "Everyday. Friction goes with the load and against the approach. Depends on direction times the stimulus.",
    "handover": "Unlisted. After each change of person the bench is disturbed, it decays in some readings. Depends on the person column (rows "
                "since it changed) and time.",
    "squeal": "Unlisted. A resonance of the frame at one place of the range. Depends on the stimulus (a narrow bump).",
    "hourly_backup": "Unlisted. A computer loads the supply for minutes after each full hour. Depends on time (pulses with a period of 3600 s).",
    "tired_arm": "Unlisted. The arm that cranks tires with the way and rests with time, and leans in the direction of approach. Depends on "
                 "direction, times a memory of the moves of the stimulus.",
}


def table(effects, seed, size, noise="white"):
    lab = laboratory(seed)
    form = lab.forms[int(rng(NUMBER, seed, 9).integers(len(lab.forms)))]

    def error(name, g, j):
        return row_noise(name, g, lab.n, form)

    return assemble(lab, effects, size, noise, NUMBER, seed, EFFECTS, list(EFFECTS), NOISES, error)
