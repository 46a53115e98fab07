"""Any transducer with a declared formula."""
import numpy as np
from . import common
from .common import stream

NOISES = dict(common.NOISES)
# setting, low, high, decimals, response, span of the response, further declared column (name, values, part of the span)
SORTS = [
    ("slide_mm", 0.0, 250.0, 3, "lvdt_mV", 1600.0, None),
    ("stroke_um", 5.0, 400.0, 2, "probe_V", 9.0, ("standoff_mm", (1.0, 1.5, 2.0), 0.04)),
    ("flow_L_min", 2.0, 60.0, 3, "meter_Hz", 820.0, ("water_degC", (15.0, 20.0, 30.0), 0.03)),
    ("force_kN", 1.0, 50.0, 4, "cell_mV", 19.0, None),
    ("thrust_N", 20.0, 800.0, 2, "cell_uV", 14000.0, ("excitation_V", (4.0, 5.0, 6.0), 0.05)),
    ("torque_Nm", -120.0, 120.0, 3, "shaft_mV", 24.0, ("speed_rpm", (0.0, 300.0, 900.0), 0.02)),
    ("chamber_pct", 8.0, 95.0, 2, "cap_pF", 62.0, ("chamber_degC", (10.0, 23.0, 40.0), 0.06)),
    ("source_V", -10.0, 10.0, 5, "meter_V", 20.0, None),
    ("bath_degC", -20.0, 120.0, 3, "couple_uV", 5700.0, ("depth_mm", (80.0, 120.0, 160.0), 0.01)),
    ("current_A", 0.0, 200.0, 3, "shunt_mV", 58.0, None),
    ("turn_deg", -170.0, 170.0, 3, "pot_V", 9.6, ("supply_V", (9.5, 10.0, 10.5), 0.05)),
    ("mass_g", 5.0, 2200.0, 2, "beam_count", 61000.0, None),
]
PEOPLE = ["Ada", "Bruno", "Carla", "Dmitri", "Elif", "Farid", "Greta", "Hugo", "Ines", "Jonas"]


def laboratory(seed):
    g = stream("general", seed, "laboratory")
    lab = common.Lab()
    x_name, low, high, digits, y_name, span, further = SORTS[int(g.integers(0, len(SORTS)))]
    cut = g.uniform(0.6, 1.0)
    high = low + cut * (high - low)
    span = span * cut
    runs = int(g.integers(2, 7))
    per = int(g.integers(max(14, int(np.ceil(60 / runs))), min(66, 390 // runs) + 1))
    n = runs * per
    lab.n, lab.runs, lab.run = n, runs, np.repeat(np.arange(runs), per)
    lab.replicates = bool(g.random() < 0.5)
    style = int(g.integers(0, 4))
    count = int(g.integers(7, 14))
    levels = low + (high - low) * np.linspace(0.0, 1.0, count)
    x = []
    for _ in range(runs):
        if style == 0:      # drawn
            v = g.uniform(low, high, per)
        elif style == 1:    # levels, shuffled
            v = np.concatenate([levels[g.permutation(count)] for _ in range(per // count + 1)])[:per]
        elif style == 2:    # up and down again
            sweep = np.r_[levels, levels[-2:0:-1]]
            v = np.concatenate([sweep] * (per // len(sweep) + 1))[:per]
        else:               # drawn, up and down in turn
            size = int(g.integers(5, 10))
            v = g.uniform(low, high, per)
            for b, a in enumerate(range(0, per, size)):
                v[a:a + size] = np.sort(v[a:a + size])[::1 if b % 2 == 0 else -1]
        x.append(v + g.normal(0, 0.002 * (high - low), per))
    lab.x = np.round(np.concatenate(x), digits)
    lab.low, lab.high = low, high
    lab.u = (lab.x - low) / (high - low)
    first = np.diff(lab.run, prepend=-1) > 0
    lab.first = first
    lab.move = np.where(first, lab.x - low, np.diff(lab.x, prepend=low)) / (high - low)
    if style >= 2 or g.random() < 0.4:
        lab.way = np.where(lab.move >= 0, 1, -1)
    else:
        lab.way = g.choice([-1, 1], n)    # the setting is passed, then approached from a chosen side
    z = None
    if further is not None and g.random() < 0.75:
        z = g.choice(further[1], n) if g.random() < 0.6 else np.repeat(g.choice(further[1], runs * (per // 5 + 1)), 5)[:n]
        z = z.astype(float)
    lab.wait = g.integers(5, 31, n) * (1 if g.random() < 0.5 else 5)
    pace = g.uniform(90, 300) + lab.wait
    dt = pace * g.uniform(0.8, 1.4, n) + np.where(first, g.uniform(3000, 60000, n), 0.0)
    dt[0] = g.uniform(100, 600)
    lab.dt = dt
    lab.time = np.round(np.cumsum(dt))
    who = [str(w) for w in g.permutation(PEOPLE)[:int(g.integers(2, 4))]]
    if g.random() < 0.4 and runs >= len(who):
        turn = np.arange(runs) % len(who)
        who_at = turn[lab.run]
    else:
        size = int(g.integers(6, 15))
        blocks = np.concatenate([g.permutation(len(who)) for _ in range(n // size + 2)])
        who_at = blocks[np.arange(n) // size]
    lab.who, lab.people = np.array(who)[who_at], sorted(set(np.array(who)[who_at]))
    lab.range = g.integers(1, int(g.integers(3, 5)), n)
    day = lab.time / 86400.0

    def slow(a, tau):
        e, v = g.standard_normal(n), np.empty(n)
        v[0] = e[0]
        for i in range(1, n):
            k = np.exp(-dt[i] / tau)
            v[i] = k * v[i - 1] + np.sqrt(1 - k * k) * e[i]
        return a * v
    lab.room = np.round(g.uniform(20.5, 24) + g.uniform(0.3, 1.2) * np.sin(2 * np.pi * (day + g.random())) + slow(0.4, 9000), 2)
    lab.humid = np.round(g.uniform(35, 55) + 4 * np.sin(2 * np.pi * (day + g.random())) + slow(2.0, 15000), 1)
    lab.mains = np.round(g.choice([230.0, 120.0]) * (1 + slow(0.008, 5000) + 0.004 * g.standard_normal(n)), 1)
    slope = span / (high - low) * g.choice([-1, 1])
    wanted = abs(span) * g.uniform(4e-4, 3e-3)
    common.resolution(lab, g, [wanted])
    truth = g.normal(0, 0.05) * span + slope * lab.x
    lab.slope = slope
    terms = ["1", x_name]
    model = [np.ones(n), lab.x]
    if z is not None:
        truth = truth + span * further[2] * (z - further[1][0]) / (further[1][-1] - further[1][0])
        terms.append(further[0])
        model.append(z)
    lab.model, lab.groups = np.column_stack(model), np.ones(n)
    lab.truth = {y_name: truth}
    lab.value = truth
    shift = g.random() < 0.5 and lab.replicates
    lab.drifts = [0.5 * g.standard_normal(runs)[lab.run] * shift]
    lab.share, lab.ar = 0.0, g.uniform(0.3, 0.7)
    lab.form, lab.shaky = int(g.integers(0, 6)), lab.people[int(g.integers(0, len(lab.people)))]
    t_name = str(g.choice(["t_s", "time_s", "clock_s", "elapsed_s"]))
    run_name = str(g.choice(["run", "series", "cycle", "session"]))
    c = {}
    if lab.replicates or g.random() < 0.5:
        c[run_name] = [str(k + 1) for k in lab.run]
    c[t_name] = common.fixed(lab.time, 0)
    c[x_name] = common.fixed(lab.x, digits)
    if z is not None:
        c[further[0]] = common.fixed(z, 1)
    words = g.choice(["1,-1", "up,down", "in,out"]).split(",")
    c["direction"] = [words[0] if w > 0 else words[1] for w in lab.way]
    c[str(g.choice(["room_degC", "air_degC", "hall_degC"]))] = common.fixed(lab.room, 2)
    c[str(g.choice(["humidity_pct", "rh_pct"]))] = common.fixed(lab.humid, 1)
    c[str(g.choice(["operator", "person", "observer"]))] = [str(w) for w in lab.who]
    words = g.choice(["1,2,3", "low,mid,high", "A,B,C"]).split(",")
    c["range"] = [words[k - 1] for k in lab.range]
    c[str(g.choice(["wait_s", "dwell_s", "hold_s"]))] = [str(int(w)) for w in lab.wait]
    c[str(g.choice(["mains_V", "line_V"]))] = common.fixed(lab.mains, 1)
    if g.random() < 0.5:
        c["barometer_hPa"] = common.fixed(g.uniform(985, 1020) + slow(4.0, 80000), 1)
    lab.columns = c
    lab.options = ["--response", y_name, "--formula", " + ".join(terms), "--time", t_name]
    if lab.replicates:
        lab.options += ["--replicate", run_name]

    def spread(j):
        if lab.form == 0:    # in proportion to the setting
            return 0.3 + 1.6 * lab.u
        if lab.form == 1:    # the guide is steady in the middle only
            return 0.4 + 3.0 * np.abs(lab.u - 0.5)
        if lab.form == 2:    # one of them has a shaky hand
            return np.where(lab.who == lab.shaky, 2.4, 0.8)
        if lab.form == 3:    # a connector loosens
            return 0.4 + 1.8 * lab.time / lab.time[-1]
        if lab.form == 4:    # dry air, sparks
            return np.exp(-(lab.humid - lab.humid.mean()) / 5.0)
        return 0.6 + 2.2 * np.exp(-lab.wait / (0.5 * np.mean(lab.wait)))    # read before it is calm
    lab.spread = spread
    return lab


def chords(lab, g):
    nodes = int(g.integers(5, 8))
    at = np.linspace(-0.02, 1.02, nodes)
    at[1:-1] += g.uniform(-0.3, 0.3, nodes - 2) * (at[1] - at[0])
    a, b, w = g.uniform(0, 2 * np.pi), g.uniform(0, 2 * np.pi), g.uniform(1.4, 2.2)

    def curve(u):
        return np.sin(np.pi * w * u + a) + 0.25 * np.sin(2 * np.pi * w * u + b)
    return [curve(lab.u) - np.interp(lab.u, at, curve(at))]


def unregulated(lab, g):
    return [(lab.mains / np.mean(lab.mains) - 1) * (lab.u + g.uniform(0.0, 0.2))]


def droop(lab, g):
    tau = g.uniform(4, 10) * np.max(lab.wait)
    size = lab.x / max(abs(lab.low), abs(lab.high))
    return [-size * (1 - np.exp(-lab.wait / tau))]


def bedding_in(lab, g):
    base, more = g.uniform(0.03, 0.08), g.uniform(0.15, 0.35)
    out = np.empty(lab.n)
    gap = 1.0
    for i in range(lab.n):
        if lab.first[i]:
            gap = g.uniform(0.7, 1.4)    # mounted afresh
        out[i] = gap
        gap *= np.exp(-base - more * max(0.0, lab.u[i]))
    return [out]


def tapper(lab, g):
    taps = lab.people[int(g.integers(0, len(lab.people)))]
    grip = g.uniform(0.4, 0.8)
    return [np.where(lab.who == taps, 0.0, -lab.way * (grip + (1 - grip) * lab.u))]


def corrected_twice(lab, g):
    counts = [np.sum(lab.who == w) for w in lab.people]
    good = [w for w, k in zip(lab.people, counts) if k >= 0.15 * lab.n]
    who = good[int(g.integers(0, len(good)))]
    return [np.where(lab.who == who, lab.x * (lab.room - 20.0), 0.0)]


def every_nth(lab, g):
    each = int(g.integers(5, 10))
    since = (np.arange(lab.n) + int(g.integers(0, each))) % each
    rest = g.uniform(0.2, 0.4)
    return [np.where(since == 0, 1.0, np.where(since == 1, rest, 0.0))]


def rubbed_cable(lab, g):
    tau = g.uniform(0.8, 2.5) * np.median(lab.dt)
    out = np.empty(lab.n)
    charge = 0.0
    for i in range(lab.n):
        charge *= np.exp(-lab.dt[i] / tau)
        charge += abs(lab.move[i]) * np.exp(-lab.wait[i] / tau)
        out[i] = charge
    return [out]


EFFECTS = {"chords": chords, "unregulated": unregulated, "droop": droop, "bedding_in": bedding_in, "tapper": tapper,
           "corrected_twice": corrected_twice, "every_nth": every_nth, "rubbed_cable": rubbed_cable}
PAIRS = [("chords", "rubbed_cable"), ("droop", "tapper"), ("unregulated", "every_nth")]
ABOUT = {
    "chords": "Everyday. The certificate of the reference has a few points with straight lines between: what is left are arches of the true "
              "curve over each chord, zero at the points. Depends on the setting (first column of the formula).",
    "unregulated": "Everyday. The supply of the bridge follows the mains: the span does. Depends on the column of the mains times the setting.",
    "droop": "Everyday. The hold stage loses its charge while one waits: the reading shrinks in proportion to the setting. Depends on the "
             "column of the wait times the setting.",
    "bedding_in": "Everyday. Mounted afresh for each run, the seat has a gap that every load closes further, a great one more. Depends on "
                  "the count of rows in the run and the settings before; only in the first rows of the runs.",
    "tapper": "Unlisted. Friction holds the reading back against the way it came; one of the people taps the case before reading and frees "
              "it, the others do not. Depends on direction for all operators but one, a little more at high settings.",
    "corrected_twice": "Unlisted. One of the people corrects by hand for the room's distance from 20 degC, which the program has done already. "
                       "Depends on operator times room temperature times setting.",
    "every_nth": "Unlisted. The voltmeter zeroes itself after every so many readings; its relay leaves a charge in the next reading and a "
                 "rest in the one after. Depends on the count of rows (order).",
    "rubbed_cable": "Unlisted. The cable is bent on the way to the next setting and charges itself by rubbing, whichever way it goes; the "
                    "charge runs off in minutes and adds up. Depends on the size of the move since the row before, wait and time.",
}
