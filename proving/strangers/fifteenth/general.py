"""Any electrical transducer: a stimulus, its supply, people, ranges, a room and a clock."""

import numpy as np

from . import common
from .common import Table, assemble, relax, rng, row_noise

NUMBER = 3
NOISES = dict(common.NOISES)

# stimulus, its range, supply, its levels, response, sensitivity, is the supply in the formula
DEVICES = [
    ("angle_deg", 0, 300, "excitation_V", (2, 3, 5, 8), "pot_mV", 8.0, False),
    ("displacement_mm", 0, 25, "excitation_V", (2, 4, 6, 10), "gauge_mV", 40.0, True),
    ("load_kg", 1, 60, "excitation_V", (5, 8, 10, 12), "scale_mV", 0.33, False),
    ("flow_kg_h", 5, 400, "supply_V", (12, 18, 24, 30), "meter_mA", 0.04, False),
    ("field_mT", 2, 80, "drive_mA", (1, 2, 4, 5), "hall_mV", 2.4, True),
    ("bath_degC", -20, 120, "current_mA", (0.5, 1, 1.4, 2), "element_ohm", 0.385, False),
    ("strain_ppm", 50, 2500, "bridge_V", (1, 2.5, 5, 10), "strain_uV", 0.5, True),
    ("torque_Nm", 0, 80, "bridge_V", (2.5, 5, 7.5, 10), "shaft_mV", 0.2, False),
]
PEOPLE = ["Anouk", "Ben", "Carla", "Deniz", "Emil", "Fanny", "Gor", "Hedda"]


def stimulus(g, n, a, b):
    """Settings, and how many different ones there are."""
    kind = str(g.choice(["random", "levels", "staircase"]))
    if kind == "random":
        return g.uniform(a, b, n), 40
    count = int(g.integers(13, 21))
    lv = np.linspace(a, b, count)
    if kind == "levels":
        x = np.concatenate([g.permutation(lv) for _ in range(n // count + 1)])[:n]
    else:
        x = np.concatenate([lv if k % 2 == 0 else lv[::-1] for k in range(n // count + 1)])[:n]
    return np.clip(x + g.normal(0, 0.004, n) * (b - a), a, b), count


def laboratory(seed):
    g = rng(NUMBER, seed, 1)
    x_name, a, b, w_name, w_levels, y_name, sens, both = DEVICES[int(g.integers(len(DEVICES)))]
    runs = int(g.integers(1, 6))
    per = int(g.integers(48, 110)) if runs < 3 else int(g.integers(24, 80))
    n = runs * per
    run = np.repeat(np.arange(runs), per)
    first = np.arange(n) % per == 0
    x, count = stimulus(g, n, a, b)
    digits = 4 if b <= 60 else 3
    x = np.round(x, digits)
    hold = int(g.integers(1, 4))
    w = np.repeat(g.choice(w_levels, n), hold)[:n].astype(float)
    wait = g.integers(8, 150, n)
    dt = g.uniform(100, 300) * g.uniform(0.7, 1.5, n) + wait
    dt[first] += g.uniform(1, 8, runs) * 3600
    t = np.round(np.cumsum(dt))
    unit, per_second, form = [("t_s", 1.0, "%d"), ("elapsed_min", 60.0, "%.2f"), ("clock_h", 3600.0, "%.4f")][
        int(g.integers(3))
    ]
    air = g.uniform(19, 25) + g.uniform(0.5, 1.2) * np.sin(2 * np.pi * t / 86400 + g.uniform(0, 6.28))
    walk, keep = np.zeros(n), g.uniform(0.85, 0.95)
    for i in range(1, n):
        walk[i] = keep * walk[i - 1] + g.normal(0, 0.8 * np.sqrt(1 - keep**2))
    room = np.round(air + walk, 2)
    people = list(g.permutation(PEOPLE)[: int(g.integers(2, 5))])
    who = np.repeat(np.arange(n), g.integers(6, 15, n))[:n] % len(people)
    changed = g.random(n) < g.uniform(0.15, 0.35)
    span_no = (np.cumsum(np.where(changed, g.integers(1, 3, n), 0)) + int(g.integers(3))) % 3
    batch = np.cumsum(first | (np.arange(n) % int(g.integers(6, 12)) == 0)) - 1
    mode = str(g.choice(["plain", "replicate", "batch"])) if runs > 1 else str(g.choice(["plain", "batch"]))
    span = sens * (b - a)
    sd = span * float(g.choice([2e-4, 6e-4, 2e-3]))
    gain = sens * g.uniform(0.9, 1.1) * g.choice([-1, 1])
    declared = g.normal(0, 0.05) * span + gain * x
    if both:
        declared = declared + w * g.uniform(-0.1, 0.1) * span / max(w_levels)
    person = str(g.choice(["operator", "observer", "who"]))
    ranges = [["low", "mid", "high"], ["1", "2", "3"], ["R1", "R2", "R3"]][int(g.integers(3))]
    others = [
        (str(g.choice(["room_degC", "air_degC", "lab_degC"])), ["%.2f" % v for v in room]),
        (person, [str(people[v]) for v in who]),
        ("range", [ranges[v] for v in span_no]),
        ("wait_s", ["%d" % v for v in wait]),
    ]
    if g.random() < 0.5:
        damp = 45 + 5 * np.sin(t / 25000 + g.uniform(0, 6.28)) + g.normal(0, 0.6, n)
        others.append(("humidity_pct", ["%.1f" % v for v in damp]))
    if g.random() < 0.4:
        others.append(("mains_V", ["%.1f" % v for v in 231 + g.normal(0, 1.6, n)]))
    others = [others[i] for i in g.permutation(len(others))]
    columns = [(unit, [form % (v / per_second) for v in t]), (x_name, ["%.*f" % (digits, v) for v in x])]
    columns += [(w_name, ["%g" % v for v in w]), *others]
    options = ["--response", y_name, "--formula", "1 + " + x_name + (" + " + w_name if both else ""), "--time", unit]
    shift = np.zeros(n)
    if mode == "replicate":
        name = str(g.choice(["run", "day", "series"]))
        columns.insert(0, (name, ["%d" % (v + 1) for v in run]))
        options += ["--replicate", name]
        if g.random() < 0.5:
            shift = g.normal(0, 0.5 * sd, runs)[run]
    if mode == "batch":
        name = str(g.choice(["setup", "batch", "mounting"]))
        columns.insert(0, (name, ["%d" % (v + 1) for v in batch]))
        options += ["--whole-plot", name]
    model = [np.ones(n), x] + ([w] if both else [])
    return Table(
        n=n, run=run, runs=runs, first=first, x=x, z=(x - a) / (b - a), sense=np.sign(gain), count=count,
        w=w / max(w_levels), wait=wait.astype(float), t=t, room=room, who=who, range_no=span_no, batch=batch, mode=mode,
        share=float(g.uniform(0.2, 0.35)) if mode == "batch" else 0.0, responses=[(y_name, declared, sd)],
        shifts=[shift], columns=columns, options=options, model=np.column_stack(model), groups=np.ones(n),
    )  # fmt: skip


def stuck_start(lab, g, j):
    """At the low end the mechanism sticks: a first part of the stimulus moves nothing, then it comes free."""
    free, soft = g.uniform(0.12, 0.28), g.uniform(0.008, 0.025)
    return lab.sense * (soft * np.logaddexp(0, (lab.z - free) / soft) - lab.z)


def own_heat(lab, g, j):
    """The supply heats the element with its square; the heat changes the element's sensitivity, and needs some time of
    the wait to come."""
    come = 1 - np.exp(-(lab.wait + 10) / g.uniform(15, 40))
    return lab.w**2 * (g.uniform(0.3, 0.8) + lab.z) * come


def plug_moved(lab, g, j):
    """Somebody pulled the plug and put it back: another contact resistance from then on, a little more at first."""
    k = int(g.integers(lab.runs))
    at = np.flatnonzero(lab.run == k)
    i0 = at[int(len(at) * g.uniform(0.35, 0.65))]
    since = lab.t - lab.t[i0]
    tau = g.uniform(3, 6) * float(np.median(np.diff(lab.t)))
    return np.where(since >= 0, 1 + g.uniform(0.2, 0.5) * np.exp(-np.clip(since, 0, None) / tau), 0.0)


def screw_turn(lab, g, j):
    """The screw that makes the stimulus wobbles: an error with its turns, and some with half turns."""
    turns = g.uniform(2.6, min(9.0, (lab.count - 1) / 2.4))
    phase = 2 * np.pi * turns * lab.z
    return np.sin(phase + g.uniform(0, 6.28)) + g.uniform(0.1, 0.35) * np.sin(2 * phase + g.uniform(0, 6.28))


def slow_glue(lab, g, j):
    """The glue under the gauge creeps with two times. The stimulus is set at the start of the wait, and taken off
    between runs."""
    out = np.zeros(lab.n)
    step = float(np.median(np.diff(lab.t)))
    for weight, tau in ((1.0, step * g.uniform(0.6, 1.4)), (g.uniform(0.4, 0.9), step * g.uniform(5, 10))):
        state = 0.0
        for i in range(lab.n):
            if i:
                held = 0.0 if lab.first[i] else lab.z[i - 1]
                gap = lab.t[i] - lab.t[i - 1] - lab.wait[i]
                state = held + (state - held) * np.exp(-gap / tau)
            state = lab.z[i] + (state - lab.z[i]) * np.exp(-lab.wait[i] / tau)
            out[i] += weight * (state - lab.z[i])
    return lab.sense * out


def warm_relay(lab, g, j):
    """A relay clicks when the range is changed. Its coil warms one contact; the thermal voltage dies away."""
    tau = g.uniform(1.5, 3.5) * float(np.median(np.diff(lab.t)))
    heat, out = 0.0, np.empty(lab.n)
    for i in range(lab.n):
        if i:
            heat *= np.exp(-(lab.t[i] - lab.t[i - 1]) / tau)
            heat += (1 - 0.4 * heat) * (lab.range_no[i] != lab.range_no[i - 1])
        out[i] = heat
    return out


def warm_hand(lab, g, j):
    """The piece is put in by hand and warm from it; it cools in the wait. Some people have cold hands."""
    hands = g.permutation(np.linspace(0.3, 1.7, 4))
    return hands[lab.who] * np.exp(-lab.wait / g.uniform(20, 50))


def whole_degrees(lab, g, j):
    """The firmware corrects for the air's temperature, but cuts it to whole steps. What is cut off is not corrected."""
    inside = relax(lab.room, lab.t, 15.0)
    steps = np.array([0.25, 0.5, 1.0, 2.0])
    step = steps[int(np.argmin(np.abs(np.log(steps * g.uniform(3, 6) / np.ptp(inside)))))]
    return inside - step * np.floor(inside / step)


EFFECTS = {
    f.__name__: f
    for f in (stuck_start, own_heat, plug_moved, screw_turn, slow_glue, warm_relay, warm_hand, whole_degrees)
}
COMMON = ()
SIGNED = ("own_heat", "plug_moved", "warm_relay", "warm_hand", "whole_degrees")
PAIRS = [("own_heat", "warm_relay"), ("slow_glue", "whole_degrees"), ("screw_turn", "plug_moved")]
ABOUT = {
    "stuck_start": "Everyday. A dead zone at the low end. Depends on the stimulus (first term of the formula): a kink"
    " at 12 to 28 % of its range.",
    "own_heat": "Everyday. Self-heating: square of the supply (excitation, current), times the stimulus and an offset;"
    " a little less after a short wait. Depends on the supply, the stimulus, and wait_s.",
    "plug_moved": "Everyday. A step in time, inside a run, with a small transient after it. Depends on time.",
    "screw_turn": "Everyday. A periodic error of the stimulus, 2.6 to 9 periods over its range, and its half.",
    "slow_glue": "Everyday. Creep: a lag of the stimulus with a short and a long time. Depends on the stimulus, those"
    " before, time, and wait_s.",
    "warm_relay": "Unlisted. After a change of range a thermal voltage, which dies away. Depends on the range column"
    " (if it changed, how many rows ago) and time.",
    "warm_hand": "Unlisted. The piece cools from the hand. Depends on wait_s (exponential, 20 to 50 s), times an amount"
    " for each person.",
    "whole_degrees": "Unlisted. The firmware cuts the air's temperature to steps. Depends on the air's temperature: a"
    " sawtooth with a step of 0.25 to 2 degC.",
}


def table(effects, seed, size, noise="white"):
    lab = laboratory(seed)

    def error(name, g, j):
        rows = row_noise(name, g, lab.t, lab.responses[j][1])
        shared = g.standard_normal(lab.n)[lab.batch]
        return np.sqrt(1 - lab.share**2) * rows + lab.share * shared

    return assemble(NUMBER, seed, lab, effects, size, noise, globals(), error)
