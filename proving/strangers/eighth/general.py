"""Small tables with declared columns: a displacement, a flow, a load or a torque transducer."""
import numpy as np
from .common import NOISES, Table, finish, generator, lag, texts  # noqa: F401

BENCHES = [("travel_mm", 200.0, 4, "drive_V", 1.0, 5.0, "y_mV", 5.0, False),
           ("flow_L_per_min", 25.0, 4, "line_bar", 1.0, 6.0, "frequency_Hz", 150.0, False),
           ("load_N", 500.0, 3, "excitation_V", 4.0, 10.0, "bridge_mV", 0.04, True),
           ("torque_Nm", 50.0, 4, "bridge_V", 2.0, 8.0, "y_mV", 0.4, True)]


def laboratory(seed):
    g = generator(seed, "general", "lab")
    lab = Table()
    name, full, dec, second, low, high, response, slope, declared2 = BENCHES[int(g.integers(len(BENCHES)))]
    runs, per = int(g.integers(3, 6)), int(g.integers(20, 46))
    n = lab.n = runs * per
    people = list(g.permutation(["Noor", "Emil", "Greta", "Pavel", "Ines"])[:int(g.integers(2, 5))])
    pace = g.uniform(240, 560)
    u, t, room, hum, who, run, tr, mains, wait, baro = [], [], [], [], [], [], [], [], [], []
    now, pressure = 0.0, g.uniform(985, 1025)
    for i in range(runs):
        u.append((g.permutation(per) + g.random(per)) / per)
        at = now + np.cumsum(pace * g.uniform(0.6, 1.4, per))
        t.append(at)
        tr.append(at - now)
        run.append(np.full(per, i + 1))
        room.append(g.uniform(20.5, 22.8) + np.cumsum(g.normal(0, 0.03, per)) + g.normal(0, 0.1, per))
        hum.append(g.uniform(40, 58) + np.cumsum(g.normal(0, 0.6, per)) + g.normal(0, 0.6, per))
        mains.append(g.uniform(228, 232) + lag(g.normal(0, 4, per), np.ones(per), 2.0, 0.0) * 1.2 + g.normal(0, 0.7, per))
        wait.append(np.clip(np.round(np.exp(g.normal(np.log(38), 0.75, per))), 5, 190))
        baro.append(pressure + np.cumsum(g.normal(0, 0.05, per)))
        pressure = baro[-1][-1] + g.normal(0, 2)
        w, k = [], int(g.integers(len(people)))
        while len(w) < per:
            w += [people[k % len(people)]] * int(g.integers(7, 14))
            k += 1
        who.append(np.array(w[:per]))
        now = at[-1] + g.choice([5000.0, 18000.0, 28000.0])
    tu, value = texts(full * np.concatenate(u), "%%.%df" % dec)
    lab.u = value / full
    tt, lab.t = texts(np.concatenate(t), "%.0f")
    tv, lab.v_raw = texts(g.choice(np.linspace(low, high, 7), n), "%.3f")
    lab.v = (lab.v_raw - low) / (high - low)
    ts, lab.room = texts(np.concatenate(room), "%.2f")
    th, lab.hum = texts(np.concatenate(hum), "%.1f")
    tm, lab.mains = texts(np.concatenate(mains), "%.1f")
    tw, lab.wait = texts(np.concatenate(wait), "%.0f")
    tb, lab.baro = texts(np.concatenate(baro), "%.1f")
    lab.who, lab.run, lab.tr, lab.people = np.concatenate(who), np.concatenate(run), np.concatenate(tr), people
    lab.before = np.concatenate([[0.0], lab.u[:-1]])
    lab.before[np.diff(np.concatenate([[0], lab.run])) > 0] = 0.0
    lab.direction = np.where(lab.u >= lab.before, 1, -1)
    if g.random() < 0.6:  # the approach is drawn, with an overshoot where the move goes the other way
        lab.direction = g.choice([-1, 1], n)
    lab.range = g.integers(1, 4, n)
    group = str(g.choice(["run", "replicate"]))
    clock = str(g.choice(["t_s", "time_s", "elapsed_s"]))
    lab.columns = {group: ["%d" % v for v in lab.run], clock: tt, name: tu, second: tv, "direction": ["%d" % v for v in lab.direction],
                   "room_degC": ts, "humidity_pct": th, "operator": [str(w) for w in lab.who], "range": ["%d" % v for v in lab.range],
                   "wait_s": tw, "mains_V": tm}
    if g.random() < 0.5:
        lab.columns["barometer_hPa"] = tb
    lab.options = ["--response", response, "--formula", "1 + " + name + (" + " + second if declared2 else ""), "--time", clock]
    lab.replicates = bool(g.random() < 0.6)
    if lab.replicates:
        lab.options += ["--replicate", group]
    if g.random() < 0.5:
        lab.options += ["--direction", "direction"]
    span = slope * full
    lab.error_sd = span * g.uniform(1.2e-4, 3e-4)
    lab.decimals = int(np.ceil(-np.log10(lab.error_sd * 1e-3)))
    lab.sensors, lab.ratio = [response], {response: 1.0}
    lab.model = np.column_stack([np.ones(n), value] + ([lab.v_raw] if declared2 else []))
    clean = g.normal(0, 0.01) * span + g.choice([-1, 1]) * slope * value * g.uniform(0.9, 1.1)
    if declared2:
        clean = clean + 0.01 * span * lab.v * g.uniform(0.5, 1.5)
    if lab.replicates:  # in half of these laboratories each run has an offset of its own
        clean = clean + g.choice([0.0, 0.5]) * lab.error_sd * g.standard_normal(runs)[lab.run - 1]
    lab.clean = {response: clean}
    lab.groups, lab.blocks, lab.plots = np.zeros(n), lab.run, None
    lab.strength = lab.u
    return lab


def table(effects, seed, size, noise):
    import sys
    return finish(sys.modules[__name__], "general", laboratory(seed), effects, seed, size, noise)


def only(lab, v):
    return {lab.sensors[0]: v}


def creep_after_step(lab, g):
    return only(lab, (lab.before - lab.u) * np.exp(-lab.wait / g.uniform(20, 45)))


def humid_leak(lab, g):
    return only(lab, -lab.u * np.maximum(0.0, lab.hum - np.quantile(lab.hum, g.uniform(0.45, 0.65))))


def reversal_loop(lab, g):
    return only(lab, -lab.direction * 4 * lab.u * (1 - lab.u))


def range_gain(lab, g):
    return only(lab, g.choice([-1, 1]) * lab.u * (lab.range == int(g.integers(1, 4))))


def drawn_to_lines(lab, g):
    counts = {w: int(np.sum(lab.who == w)) for w in lab.people}
    one = max(lab.people, key=lambda w: (counts[w], w))
    x = lab.u * int(g.integers(6, 12)) + g.random()
    return only(lab, (np.round(x) - x) * (lab.who == one))


def regulator_dropout(lab, g):
    return only(lab, -np.maximum(0.0, np.quantile(lab.mains, g.uniform(0.4, 0.55)) - lab.mains) * (0.15 + lab.v))


def typo_in_table(lab, g):
    nodes = int(g.integers(6, 10))
    at = int(g.integers(1, nodes))
    return only(lab, g.choice([-1, 1]) * np.maximum(0.0, 1 - np.abs(lab.u * nodes - at)))


def warmth_of_a_person(lab, g):
    tau, since, v = g.uniform(900, 2200), 0.0, np.empty(lab.n)
    for k in range(lab.n):
        if k == 0 or lab.run[k] != lab.run[k - 1]:
            since = lab.t[k] - lab.tr[k]
        elif lab.who[k] != lab.who[k - 1]:
            since = lab.t[k - 1]
        v[k] = 1 - np.exp(-(lab.t[k] - since) / tau)
    return only(lab, g.choice([-1, 1]) * v)


EFFECTS = {f.__name__: f for f in (creep_after_step, humid_leak, reversal_loop, range_gain, drawn_to_lines, regulator_dropout, typo_in_table,
                                   warmth_of_a_person)}
PAIRS = [("reversal_loop", "typo_in_table"), ("humid_leak", "warmth_of_a_person"), ("range_gain", "regulator_dropout")]
ABOUT = {
    "creep_after_step": "Everyday: the transducer creeps after each change of the input and is read after the recorded wait. Change of the first "
                        "declared column since the row before (from zero at the start of a run) and wait_s; short waits.",
    "humid_leak": "Everyday: above some humidity the insulation leaks and takes away a part of the signal. humidity_pct above a threshold, times "
                  "the first declared column.",
    "reversal_loop": "Everyday: hysteresis that closes at both ends: the branches of rising and falling approach are apart in the middle. direction "
                     "times u(1-u) of the first declared column.",
    "range_gain": "Everyday: one range of the instrument has a wrong gain. range (one of three) times the first declared column.",
    "drawn_to_lines": "Unlisted: one of the persons reads an analogue scale and is drawn to the nearest printed line: a sawtooth of the first "
                      "declared column, in rows of that operator only.",
    "regulator_dropout": "Unlisted: when the mains is low the supply's regulator drops out, the more the higher the second setting loads it. mains_V "
                         "below a threshold times the second column (drive, line, excitation, bridge).",
    "typo_in_table": "Unlisted: one node of the linearisation table was mistyped; between its neighbours the output has a triangular bump. First "
                     "declared column, in about a quarter of its range.",
    "warmth_of_a_person": "Unlisted: the person in front of the bench warms it; it starts anew when another one takes over and at the start of a "
                          "run. Time since the change of operator.",
}
