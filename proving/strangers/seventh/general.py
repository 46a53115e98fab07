"""Four kinds of bench with a stimulus, a supply and a bridge, coil or counter that is read."""
import math

import numpy as np

from ._core import NOISES, Lab, record, stream

__all__ = ["NOISES", "EFFECTS", "PAIRS", "ABOUT", "laboratory"]

BENCHES = (
    dict(x="travel_mm", d="drive_V", y="y_mV", span=(10, 200), supply=(1, 5), slope=(2, 12), both=False),
    dict(x="load_N", d="excitation_V", y="bridge_mV", span=(20, 500), supply=(5, 10), slope=(0.04, 0.4), both=True),
    dict(x="flow_L_per_min", d="line_bar", y="frequency_Hz", span=(5, 60), supply=(1, 6), slope=(20, 180), both=False),
    dict(x="torque_Nm", d="bridge_V", y="y_mV", span=(2, 100), supply=(2, 10), slope=(0.3, 3), both=True),
)
PEOPLE = ("Imre", "Sofia", "Tomas", "Ulla", "Wanda", "Yusuf")


def laboratory(seed):
    rng = stream("general", seed, "laboratory")
    bench = BENCHES[int(rng.integers(4))]
    run_name, t_name = str(rng.choice(["run", "replicate"])), str(rng.choice(["t_s", "time_s", "elapsed_s"]))
    runs = int(rng.integers(3, 6))
    per = int(rng.integers(16, 60))
    span = rng.uniform(*bench["span"])
    updown = rng.random() < 0.4
    steps = int(rng.integers(4, 8))
    pace = rng.uniform(150, 500)
    people = list(rng.permutation(PEOPLE)[:int(rng.integers(2, 5))])
    run, t, x, way, who, shift = [], [], [], [], [], []
    clock, person, began, length = 0.0, 0, 0.0, int(rng.integers(8, 15))
    count = 0
    for k in range(runs):
        if updown:
            up = np.linspace(0.02, 1, per - per // 2)
            path = np.concatenate([up, up[::-1][:per // 2] - 0.5 / per]) * span + rng.normal(0, 0.003 * span, per)
            path = np.abs(path)
        else:
            path = (rng.permutation(per) + rng.random(per)) / per * span
        for i, v in enumerate(path):
            clock += pace * rng.uniform(0.6, 1.5) + (40 * pace * rng.uniform(0.5, 1.5) if i == 0 and k else 0)
            if not x or count == length or i == 0:
                person = (person + 1) % len(people) if x else 0
                began, count, length = clock - 0.5 * pace, 0, int(rng.integers(8, 15))
            count += 1
            way.append(1 if (not x or v >= x[-1]) else -1)
            run.append(k + 1), t.append(clock), x.append(v), who.append(people[person]), shift.append(clock - began)
    n = len(x)
    run, t, x, way = np.array(run), record(t, 0), record(x, 4), np.array(way)
    supply = np.linspace(*bench["supply"], steps)[rng.integers(0, steps, n)]
    d = record(supply, 3)
    day = 2 * math.pi * t / 86400 + rng.uniform(0, 6.28)
    room = record(rng.uniform(20, 23) + rng.uniform(0.3, 1.2) * np.sin(day) + rng.normal(0, 0.1, n), 2)
    damp = rng.uniform(42, 60) - rng.uniform(3, 7) * np.sin(day + 0.5) + _walk(rng, n, 0.93) * 2.5 + rng.normal(0, 0.5, n)
    damp = record(np.clip(damp, 20, 80), 1)
    span_no = rng.integers(1, 4, n)
    wait = record(np.clip(rng.lognormal(math.log(rng.uniform(25, 45)), 0.6, n), 5, 240), 0)
    mains = record(230 + _walk(rng, n, 0.6) * 2.2, 1)
    columns = {run_name: (run, 0), t_name: (t, 0), bench["x"]: (x, 4), bench["d"]: (d, 3), "direction": (way, 0), "room_degC": (room, 2),
               "humidity_pct": (damp, 1), "operator": [str(p) for p in who], "range": (span_no, 0), "wait_s": (wait, 0), "mains_V": (mains, 1)}
    if rng.random() < 0.4:
        columns["barometer_hPa"] = (record(rng.uniform(995, 1020) + 3 * np.sin(day / 2.3), 1), 1)
    slope = rng.uniform(*bench["slope"]) * rng.choice([-1, 1], p=[0.2, 0.8])
    y = slope * x + 0.02 * slope * span * rng.uniform(-1, 1)
    formula, model = "1 + %s" % bench["x"], [np.ones(n), x]
    if bench["both"]:
        y = y + slope * span * rng.uniform(0.01, 0.05) * d
        formula, model = formula + " + %s" % bench["d"], model + [d]
    options = ["--response", bench["y"], "--formula", formula, "--time", t_name]
    shared = 0.0
    if rng.random() < 0.6:
        options += ["--replicate", run_name]
        shared = float(rng.choice([0.0, rng.uniform(0.05, 0.25)]))
    if updown or rng.random() < 0.3:
        options += ["--direction", "direction"]
    return Lab("general", columns, {bench["y"]: y}, {bench["y"]: abs(slope) * span * 10 ** rng.uniform(-4.2, -3.2)},
               np.column_stack(model), np.ones(n), run, shared, options,
               {"run": run, "t": t, "x": x, "u": x / span, "d": d, "damp": damp, "who": who, "shift": np.array(shift), "range": span_no,
                "wait": wait, "mains": mains, "pace": pace, "slope": math.copysign(1, slope)})


def _walk(rng, n, rho):
    e = rng.standard_normal(n)
    for i in range(1, n):
        e[i] = rho * e[i - 1] + math.sqrt(1 - rho * rho) * e[i]
    return e


def _one(lab, h):
    return {next(iter(lab.clean)): np.asarray(h, float)}


# ---- everyday

def parallax(lab, rng):
    names = sorted(set(lab.more["who"]))
    eye = dict(zip(names, rng.permutation(np.linspace(-1, 1, len(names)) + rng.normal(0, 0.15, len(names)))))
    return _one(lab, [eye[p] for p in lab.more["who"]])


def damp_leak(lab, rng):
    """Water film on the insulation: its conductance grows exponentially with the humidity and shunts the signal."""
    m = lab.more
    return _one(lab, -m["slope"] * (m["u"] + 0.1) * np.exp((m["damp"] - m["damp"].max()) / rng.uniform(3.5, 7)))


def short_wait(lab, rng):
    m = lab.more
    before = np.concatenate([[0.0], m["u"][:-1]])
    before[np.concatenate([[True], np.diff(m["run"]) != 0])] = 0.0
    tau = float(np.median(m["wait"])) * rng.uniform(0.4, 0.9)
    return _one(lab, m["slope"] * (before - m["u"]) * np.exp(-m["wait"] / tau))


# ---- unlisted

def shift_warmth(lab, rng):
    """The person at the bench warms its frame; everybody begins anew, and some are warmer than others."""
    m = lab.more
    names = sorted(set(m["who"]))
    warm = dict(zip(names, rng.uniform(0.6, 1.4, len(names))))
    tau = m["pace"] * rng.uniform(3, 7)
    return _one(lab, np.array([warm[p] for p in m["who"]]) * (1 - np.exp(-m["shift"] / tau)))


def relay_emf(lab, rng):
    """A range relay's coil has warmed its contacts on one side just after it was thrown; the thermal voltage dies away while one waits."""
    m = lab.more
    thrown = np.concatenate([[True], np.diff(m["range"]) != 0])
    side = {1: rng.uniform(0.5, 1.2), 2: rng.uniform(0.5, 1.2), 3: rng.uniform(-0.4, 0.4)}
    tau = float(np.median(m["wait"])) * rng.uniform(0.7, 1.6)
    return _one(lab, thrown * np.array([side[int(k)] for k in m["range"]]) * np.exp(-m["wait"] / tau))


def brown_out(lab, rng):
    """Below some mains voltage the regulator falls out, the sooner the more the supply must give."""
    m = lab.more
    knee = np.quantile(m["mains"], rng.uniform(0.35, 0.6))
    short = np.maximum(0.0, knee - m["mains"] + 1.2 * (m["d"] - m["d"].mean()) / (m["d"].max() - m["d"].min()))
    return _one(lab, -short * m["d"] / m["d"].max())


def dented_rail(lab, rng):
    """After a knock a dent in the guide lets first one, then the other shoe of the carriage down."""
    m = lab.more
    for _ in range(200):
        since = np.quantile(m["t"], rng.uniform(0.25, 0.5))
        place, apart, width = rng.uniform(0.15, 0.55), rng.uniform(0.18, 0.3), rng.uniform(0.03, 0.055)
        dip = np.exp(-0.5 * ((m["u"] - place) / width) ** 2) - rng.uniform(0.5, 1) * np.exp(-0.5 * ((m["u"] - place - apart) / width) ** 2)
        dip = dip * (m["t"] > since)
        if np.sum(np.abs(dip) > 0.4) >= 6:
            break
    return _one(lab, dip)


def straight_table(lab, rng):
    """The software linearises a curved sensor by straight lines between the rows of a table; what is left hangs in scallops."""
    u = lab.more["u"]
    cells = int(rng.integers(4, 8))
    edge = np.linspace(0, 1.02, cells + 1)
    cubic = rng.uniform(0.2, 1.5)
    return _one(lab, np.interp(u, edge, edge ** 2 + cubic * edge ** 3) - (u ** 2 + cubic * u ** 3))


EFFECTS = {"parallax": parallax, "damp_leak": damp_leak, "short_wait": short_wait, "shift_warmth": shift_warmth, "relay_emf": relay_emf,
           "brown_out": brown_out, "dented_rail": dented_rail, "straight_table": straight_table}
PAIRS = [("parallax", "straight_table"), ("short_wait", "brown_out"), ("damp_leak", "dented_rail")]
ABOUT = {
    "parallax": "Everyday: every person reads with an offset of their own. Depends on operator. Always.",
    "damp_leak": "Everyday: a film of water on the insulation shunts the signal; conductance grows exponentially with humidity. "
                 "Depends on humidity_pct (exponential), times the stimulus. In damp hours.",
    "short_wait": "Everyday: the sensor has not settled when it is read; part of the step from the value before is still there. "
                  "Depends on the move of the stimulus from the row before, times exp(-wait_s/tau). Short waits.",
    "shift_warmth": "Unlisted: the person at the bench warms its frame; the warmth saturates and begins anew with every change of operator. "
                    "Depends on the time since the operator changed (or the run began), with a height by operator. Always.",
    "relay_emf": "Unlisted: a range relay that has just been thrown has a thermal voltage that dies away. "
                 "Depends on whether range differs from the row before, on range (three heights) and on exp(-wait_s/tau). After changes of range.",
    "brown_out": "Unlisted: the regulator falls out when the mains is low, sooner at a high supply. "
                 "Depends on mains_V (a knee; nought above it), moved and multiplied by the supply (drive). Low mains only.",
    "dented_rail": "Unlisted: a knock dents the guide at some moment; from then on two places of the travel, one shoe's distance apart, read low and high. "
                   "Depends on the stimulus (two narrow bumps of opposite sign) and on time (a step). Sudden.",
    "straight_table": "Unlisted: the software linearises a curved sensor by straight lines between the rows of a table; scallops with cusps are left, deeper at high values. "
                      "Depends on the stimulus (periodic in its value). Always.",
}
