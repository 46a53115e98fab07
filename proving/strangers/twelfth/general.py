"""Any transducer with a declared formula."""
from types import SimpleNamespace
import numpy as np
from .common import NOISES, walk  # noqa: F401

#        first variable, least and greatest, second variable, its levels, response, its range
MAKES = [("gap_mm", 0, 25, "supply_V", (4, 5, 6, 8), "y_V", 9),
         ("flow_L_min", 2, 80, "line_bar", (1.5, 2, 3, 4), "out_mA", 16),
         ("force_kN", 0, 50, "excitation_V", (2.5, 5, 10), "cell_mV", 20),
         ("torque_Nm", 0, 400, "speed_rpm", (10, 50, 100, 200), "disc_mV", 15),
         ("rh_pct", 10, 92, "chamber_degC", (15, 20, 25, 30), "probe_V", 5),
         ("source_V", 0.1, 10, "load_kohm", (1, 2, 5, 10), "meter_V", 10),
         ("bath_degC", -20, 120, "current_mA", (0.2, 0.5, 1), "bridge_mV", 120),
         ("level_mm", 20, 900, "tilt_mrad", (-4, -2, 0, 2, 4), "loop_mA", 16),
         ("field_mT", 5, 300, "bias_mA", (1, 2, 3, 5), "hall_mV", 150)]
CREWS = [("Ada", "Bo"), ("KL", "MN", "OP"), ("Ines", "Jon", "Kaj"), ("first", "second"), ("Vera", "Willi", "Xu", "Yael")]


def laboratory(r):
    name, low, high, second, seconds, response, span = MAKES[int(r.integers(len(MAKES)))]
    runs = int(r.integers(2, 6))
    m = int(r.integers(26, 70))
    n = runs * m
    declared = r.random() < 0.55
    two = r.random() < 0.45
    run = np.repeat(np.arange(1, runs + 1), m)
    gap = max(r.uniform(120, 420), 13000.0 / m)
    night = r.uniform(10000, 60000)
    levels = np.linspace(low, high, int(r.integers(6, 13)))
    how = str(r.choice(["drawn", "levels", "up and down"]))
    x = []
    for k in range(runs):
        if how == "drawn":
            x.append(r.uniform(low, high, m))
        elif how == "levels":
            x.append(np.concatenate([r.permutation(levels) for _ in range(-(-m // len(levels)))])[:m])
        else:
            round_trip = np.concatenate([levels, levels[-2:0:-1]])
            x.append(np.resize(round_trip, m))
    x = np.concatenate(x)
    if how != "drawn":
        x = x + r.normal(0, 0.002 * (high - low), n)
    x = np.round(x, 4)
    new = np.r_[True, np.diff(run) > 0]
    step = gap * r.uniform(0.7, 1.3, n)
    step[new] = night
    step[0] = gap
    t = np.round(np.cumsum(step))
    sec = r.choice(np.array(seconds, float), n)
    wait = np.round(np.minimum(np.exp(r.uniform(np.log(9), np.log(150), n)), 0.6 * gap))
    room = np.round(r.uniform(19, 25) + walk(r, t, 9000, r.uniform(0.4, 1.2)), 2)
    damp = np.round(np.clip(r.uniform(35, 58) + walk(r, t, 3000, r.uniform(3, 7)), 5, 95), 1)
    baro = np.round(r.uniform(975, 1020) + walk(r, t, 60000, r.uniform(4, 9)), 1)
    crew = CREWS[int(r.integers(len(CREWS)))]
    who = np.empty(n, dtype=object)
    at = 0
    while at < n:
        k = int(r.integers(6, 22))
        who[at:at + k] = crew[int(r.integers(len(crew)))]
        at += k
    who[0], who[n // 2] = crew[0], crew[1]
    up = np.where(np.diff(x, prepend=x[0] - 1) >= 0, 1, -1)
    words = (("up", "down"), ("in", "out"), ("1", "-1"))[int(r.integers(3))]
    direction = np.where(up > 0, words[0], words[1])
    rng = np.array((("1", "2"), ("low", "high"), ("1", "2", "3"))[int(r.integers(3))])
    which = rng[r.integers(0, len(rng), n)]
    time = str(r.choice(["t_s", "time_s"]))
    columns = {}
    if declared or r.random() < 0.3:
        columns["run"] = (run, None)
    if r.random() < 0.4:
        columns["order"] = (np.arange(1, n + 1), None)
    columns[time] = (t, 0)
    columns[name] = (x, 4)
    columns[second] = (sec, 2)
    rest = {"direction": (direction, None), str(r.choice(["room_degC", "air_degC", "lab_degC"])): (room, 2),
            str(r.choice(["humidity_pct", "moisture_pct"])): (damp, 1), str(r.choice(["barometer_hPa", "baro_hPa"])): (baro, 1),
            "operator": (who, None), "range": (which, None), str(r.choice(["wait_s", "dwell_s"])): (wait, 0)}
    if r.random() < 0.5:
        rest["mains_V"] = (np.round(230 + walk(r, t, 4000, 2.0), 1), 1)
    if r.random() < 0.4:
        rest["hose_m"] = (r.choice([1.0, 2.0, 5.0], n), 1)
    keys = list(rest)
    for i in r.permutation(len(keys)):
        columns[keys[i]] = rest[keys[i]]
    sd = span * 10 ** r.uniform(-3.6, -2.4)
    sign = r.choice([-1, 1])
    clean = span * (r.normal(0, 0.05) + sign * (x - low) / (high - low))
    model = [np.ones(n), x]
    if two:
        clean = clean + span * r.uniform(0.02, 0.08) * (sec - np.mean(seconds)) / np.std(seconds)
        model.append(sec)
    differ = declared and r.random() < 0.5
    if differ:
        clean = clean + 0.5 * sd * r.standard_normal(runs)[run - 1]

    def error(r, draw, noise, level):
        return draw(r, n, level) * (np.sqrt(1 - 1 / 12) if noise == "rounded" else 1.0)

    options = ["--response", response, "--formula", "1 + " + name + (" + " + second if two else ""), "--time", time]
    if declared:
        options += ["--replicate", "run"]
    return SimpleNamespace(columns=columns, responses={response: clean}, error_sds=[sd], options=options, groups=np.ones(n),
                           error=error, model=np.column_stack(model), replicates=declared, run=run, new=new, t=t, u=(x - low) / (high - low),
                           wait=wait, room=room, damp=damp, baro=baro, who=who, crew=crew, gap=gap)


def air_density(lab, r):
    vapour = lab.damp / 100 * 6.112 * np.exp(17.62 * lab.room / (243.12 + lab.room))
    dense = (lab.baro - 0.378 * vapour) / (2.8705 * (lab.room + 273.15))
    return lab.u * (dense / np.mean(dense) - 1)


def loaded_divider(lab, r):
    k = r.uniform(0.03, 0.15)
    return lab.u / (1 + k * lab.u * (1 - lab.u)) - lab.u


def plastic_swells(lab, r):
    tau = r.uniform(2000, 4500)
    out = np.empty(len(lab.t))
    state = lab.damp[0] + r.normal(0, 3.0)
    for i in range(len(out)):
        if i:
            f = np.exp(-(lab.t[i] - lab.t[i - 1]) / tau)
            state = lab.damp[i - 1] + f * (state - lab.damp[i - 1])
        out[i] = state
    return out * r.choice([-1, 1])


def filter_not_settled(lab, r):
    tau = r.uniform(7, 14)
    out = np.empty(len(lab.u))
    state = lab.u[0]
    for i in range(len(out)):
        if lab.new[i]:
            state = 0.0
        w = lab.wait[i] / tau
        state = lab.u[i] + (state - lab.u[i]) * (1 + w) * np.exp(-w)
        out[i] = state - lab.u[i]
        state = lab.u[i]                     # it settles while the numbers are written down
    return out


def pulled_to_the_last_number(lab, r):
    strength = dict(zip(lab.crew, r.permutation(np.linspace(0.3, 1.0, len(lab.crew)))))
    near = r.uniform(0.15, 0.35)
    d = np.diff(lab.u, prepend=lab.u[0])
    d[lab.new] = 0.0
    k = np.array([strength[w] for w in lab.who])
    return -k * d * np.exp(-np.abs(d) / near)


def laptop_charger(lab, r):
    run_down, fill = r.uniform(4000, 7000), r.uniform(2200, 3600)
    out = np.empty(len(lab.t))
    full, plugged = 0.5, False
    for i in range(len(out)):
        if lab.new[i]:
            full, plugged = r.uniform(0.22, 0.5), False
        else:
            dt = (lab.t[i] - lab.t[i - 1]) / 20
            for _ in range(20):
                if plugged:
                    full += dt / fill * min(1.0, (1.03 - full) / 0.25)
                    plugged = full < 0.99
                else:
                    full -= dt / run_down
                    plugged = full < 0.2
        out[i] = (0.4 + 0.6 * min(1.0, (1.03 - full) / 0.25)) if plugged else 0.0
    return out * r.choice([-1, 1])


def lamp_goes_out(lab, r):
    limit, warm = r.uniform(25, 55), r.uniform(8, 20)
    out = np.empty(len(lab.t))
    lit = 0.0                                # for how long the lamp has burned when the wait begins
    for i in range(len(out)):
        lit += 15.0                          # the person sets up the point, and the lamp burns
        if lab.wait[i] > limit:
            out[i] = 0.0
            lit = 0.0
        else:
            lit += lab.wait[i]
            out[i] = 1 - 0.4 * np.exp(-lit / warm)
    return out * r.choice([-1, 1])


def two_leads_in_turn(lab, r):
    lead = np.empty(len(lab.t))
    now = 1.0
    for i in range(len(lead)):
        now = 1.0 if lab.new[i] else now if r.random() < 0.04 else -now
        lead[i] = now
    return lead * (lab.u + r.uniform(0.1, 0.4)) * r.choice([-1, 1])


EFFECTS = {f.__name__: f for f in (air_density, loaded_divider, plastic_swells, filter_not_settled, pulled_to_the_last_number,
                                   laptop_charger, lamp_goes_out, two_leads_in_turn)}
PAIRS = [("air_density", "two_leads_in_turn"), ("loaded_divider", "lamp_goes_out"), ("plastic_swells", "laptop_charger")]
ABOUT = {
    "air_density": "Everyday. What is measured goes with the density of the air (buoyancy, refraction, lift): gain with barometer, room "
                   "temperature, and a little humidity. Depends on: first variable times barometer and room temperature.",
    "loaded_divider": "Everyday. The divider is loaded by what follows it; its source resistance is greatest in the middle: a skew bow. "
                      "Depends on: first variable.",
    "plastic_swells": "Everyday. A plastic part takes up moisture and swells, about an hour behind the air: zero. Depends on: humidity, late; time.",
    "filter_not_settled": "Everyday. Two-pole filter of the amplifier; the reading comes after the recorded wait, a part of the step is still "
                          "missing. Depends on: wait and move of the first variable since the row before.",
    "pulled_to_the_last_number": "Unlisted. Who writes down a reading is pulled to the number just written, if it is near; people differ. "
                                 "Depends on: move of the first variable since the row before, operator.",
    "laptop_charger": "Unlisted. The laptop's charger makes a ground loop while it is plugged in; it is plugged in when the battery is low and "
                      "out when full, and its current falls near the end. Depends on: time (blocks).",
    "lamp_goes_out": "Unlisted. The lamp of the room goes out when nobody moves for long; while it burns, light falls on a glass diode of the "
                     "amplifier. It comes on dim. Depends on: wait (a step), a little on the waits before.",
    "two_leads_in_turn": "Unlisted. Two sets of leads are used in turn, one is cleaned meanwhile; they differ in resistance. Sometimes the turn "
                         "is forgotten. Depends on: odd and even order in a run, times the first variable.",
}
