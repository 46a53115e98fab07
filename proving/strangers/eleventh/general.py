"""Any transducer: a straight line (and a setting) is declared, and much more is written down."""
import math
import numpy as np
from . import common

NOISES = dict(common.NOISES)

#        main column, its range, decimals | setting, its levels | response, output at full scale
THINGS = [
    ("travel_mm", (5, 180), 3, "drive_V", (2, 3, 4, 5), "out_mV", 900.0),
    ("load_kN", (2, 50), 3, "excitation_V", (5, 7.5, 10), "bridge_mV", 20.0),
    ("flow_L_min", (4, 120), 2, "line_kPa", (150, 250, 350, 450), "pickup_Hz", 1500.0),
    ("torque_Nm", (1, 60), 3, "speed_rpm", (100, 400, 700, 1000), "signal_mV", 350.0),
    ("chamber_rh_pct", (8, 92), 2, "chamber_degC", (15, 20, 25, 30), "film_pF", 220.0),
    ("source_V", (5, 300), 3, "line_Hz", (40, 50, 60, 80), "divider_mV", 3000.0),
    ("bath_degC", (2, 95), 3, "immersion_mm", (100, 150, 200), "emf_uV", 3900.0),
    ("field_mT", (3, 80), 3, "bias_mA", (2, 4, 6), "hall_mV", 120.0),
    ("angle_deg", (3, 85), 3, "supply_V", (9, 12, 15), "sine_mV", 2500.0),
    ("level_mm", (20, 1500), 1, "density_kg_m3", (790, 900, 1000), "float_mA", 16.0),
]
PEOPLE = ["Anna", "Bela", "Carl", "Dina", "Esko", "Fred", "Gita", "Hugo", "Ines", "Jan"]


def laboratory(seed):
    g = common.rng("general", "lab", seed)
    lab = common.Lab()
    main, (lo, hi), decimals, setting, set_levels, response, full = THINGS[int(g.integers(len(THINGS)))]
    runs, per = int(g.integers(3, 7)), int(g.integers(18, 43))
    n = runs * per
    span = hi - lo
    if g.random() < 0.5:
        x = g.uniform(lo, hi, n)
    else:
        levels = np.linspace(lo, hi, int(g.integers(7, 13)))
        x = []
        while len(x) < n:
            x += list(g.permutation(levels))
        x = np.array(x[:n]) + g.normal(0, 0.004 * span, n)
    s = g.choice(np.array(set_levels, float), n)
    run = np.repeat(np.arange(runs) + 1, per)
    gap = g.uniform(150, 420)
    t, now = [], 0.0
    start = g.uniform(6.5, 10.5)
    for k in range(runs):
        now = now if not k else (now + g.uniform(1800, 7200) if g.random() < 0.4 else 86400 * (1 + now // 86400) + g.uniform(0, 5000))
        for _ in range(per):
            now += gap * g.uniform(0.7, 1.5)
            t.append(now)
    t = np.array(t)
    lab.x, lab.s, lab.t, lab.run = common.shown(x, decimals), s, common.shown(t, 0), run
    lab.n, lab.gap, lab.span, lab.lo, lab.hi = n, gap, span, lo, hi
    lab.clock = start + lab.t / 3600
    # shifts: who works, and when somebody new sits down
    team = list(g.choice(PEOPLE, int(g.integers(3, 5)), replace=False))
    who, shift, place, k, last = [], [], [], 0, None
    length, here = int(g.integers(5, 11)), 0
    for i in range(n):
        if i and here >= length:
            k, here, length = k + 1, 0, int(g.integers(5, 11))
        if here == 0:
            last = str(g.choice([m for m in team if m != last]))
        who.append(last)
        shift.append(k)
        place.append(here / length)
        here += 1
    lab.who, lab.team, lab.shift, lab.place = np.array(who), team, np.array(shift), np.array(place)
    move = np.sign(np.diff(lab.x, prepend=lo))
    lab.move = np.where(move == 0, 1, move).astype(int)
    turn = [int(g.integers(1, 4))]
    for i in range(1, n):
        turn.append(int(g.integers(1, 4)) if g.random() < 0.5 else turn[-1])
    lab.range = np.array(turn)
    lab.wait = np.round(np.exp(g.uniform(math.log(10), math.log(110), n)))
    day = g.uniform(0.4, 1.2) * np.sin(2 * np.pi * (lab.clock - g.uniform(8, 10)) / 24)
    walk = np.cumsum(g.normal(0, 0.06, n))
    lab.room = g.uniform(20, 24) + day + walk - walk.mean()
    wet = np.cumsum(g.normal(0, 0.7, n))
    lab.wet = np.clip(g.uniform(38, 55) + wet - wet.mean() - 2 * day, 15, 85)
    mains = 230 + g.normal(0, 1.5, n) + np.sin(2 * np.pi * lab.clock / 24)
    words = g.random() < 0.4
    letters = g.random() < 0.4
    cols = [(str(g.choice(["room_degC", "air_degC", "lab_degC"])), common.text(lab.room + g.normal(0, 0.05, n), 2)),
            (str(g.choice(["humidity_pct", "air_rh_pct"])), common.text(lab.wet + g.normal(0, 0.5, n), 1)),
            ("operator", who),
            ("range", ["ABC"[r - 1] for r in turn] if letters else [str(r) for r in turn]),
            ("direction", [("up" if m > 0 else "down") if words else str(m) for m in lab.move]),
            ("wait_s", common.text(lab.wait, 0))]
    if g.random() < 0.7:
        cols.append(("mains_V", common.text(mains, 1)))
    if g.random() < 0.5:
        baro = 1005 + g.normal(0, 6) + np.cumsum(g.normal(0, 0.15, n))
        cols.append(("barometer_hPa", common.text(baro, 1)))
    cols = [cols[i] for i in g.permutation(len(cols))]
    time = str(g.choice(["t_s", "time_s", "elapsed_s"]))
    two = g.random() < 0.5
    lab.replicates = bool(g.random() < 0.6)
    s_text = ["%g" % v for v in s]
    lab.columns = [("run", [str(k) for k in run]), (time, common.text(t, 0)), (main, common.text(x, decimals)), (setting, s_text)] + cols
    lab.options = ["--response", response, "--formula", "1 + " + main + (" + " + setting if two else ""), "--time", time]
    if lab.replicates:
        lab.options += ["--replicate", "run"]
    lab.responses = [response]
    lab.slope = full / hi * g.uniform(0.9, 1.1) * (g.choice([-1, 1]) if g.random() < 0.3 else 1)
    sn = (s - s.mean()) / s.std()
    base = g.normal(0, 0.03) * full + lab.slope * lab.x + (g.normal(0, 0.01) * full * sn if two else 0)
    lab.sd = np.array([abs(lab.slope) * span * 10 ** g.uniform(-4.0, -2.8)])
    if lab.replicates and g.random() < 0.5:
        base = base + (g.normal(0, 0.5, runs) * lab.sd[0])[run - 1]
    lab.base = base[:, None]
    lab.model = np.column_stack([np.ones(n), lab.x] + ([s] if two else []))
    lab.groups = np.ones(n)
    lab.errors = lambda h, noise, j: common.unit_errors(h, noise, n, (lab.x - lo) / span)
    return lab


def wear(lab, g):
    # a track or a bearing wears with the way that it has gone since the start, fast while it runs in; it then says a little more (or less)
    way = np.cumsum(np.abs(np.diff(lab.x, prepend=lab.lo))) / lab.span
    worn = way / way[-1] + g.uniform(0.2, 0.8) * (1 - np.exp(-way / (0.2 * way[-1])))
    part = (lab.x - lab.lo) / lab.span + g.uniform(0.0, 0.15)
    return (1e-3 * lab.slope * lab.span * part * worn * g.choice([-1, 1]))[:, None]


def odd_bend(lab, g):
    # a spring that stiffens both ways from its middle: x = y + k y^3
    u = 2 * (lab.x - lab.lo) / lab.span - 1 + g.uniform(-0.15, 0.15)
    y = u.copy()
    for _ in range(30):
        y = u - 0.03 * y ** 3
    return (0.5 * lab.span * lab.slope * (y - u))[:, None]


def setting_span(lab, g):
    # a second quantity that is set has a hand in the sensitivity: it stiffens or loads the sensor, less and less the higher it is
    inner = g.uniform(0.3, 1.0) * lab.s.mean()
    share = lab.s / (lab.s + inner)
    return (1e-2 * lab.slope * lab.x * (share - share.mean()) * g.choice([-1, 1]))[:, None]


def operator_habit(lab, g):
    # each sets the cursor on the trace in his own way, always the same
    habit = dict(zip(lab.team, g.permutation(np.linspace(-1, 1, len(lab.team))) + g.uniform(-0.2, 0.2, len(lab.team))))
    return (1e-3 * lab.slope * lab.span * np.array([habit[w] for w in lab.who]))[:, None]


def tram(lab, g):
    # a tram starts at the stop in front of the house: its return current in the ground makes a field or a voltage; braking reverses it
    period = float(g.choice([480, 600, 720, 900]))
    out = np.zeros(lab.n)
    for way, strength in ((0.0, 1.0), (g.uniform(0.3, 0.7), g.uniform(0.4, 0.8))):      # two directions of the line
        late = g.uniform(0, 1)
        for i in range(lab.n):
            u = ((lab.t[i] / period + way + late) % 1.0) * period
            if u < 110:
                out[i] += strength * min(1.0, u / 8) * math.exp(-u / 90)
            elif u > period - 60:
                out[i] -= 0.5 * strength * (u - period + 60) / 60
    hour = np.mod(lab.clock, 24)
    out *= np.where((hour > 5) & (hour < 24), 1.0, 0.0)
    return (1e-3 * lab.slope * lab.span * out)[:, None]


def switch_emf(lab, g):
    # turning the range switch rubs its contacts warm; unlike metals give a voltage until they have cooled
    tau = g.uniform(150, 400)
    heat, out = 0.0, np.zeros(lab.n)
    for i in range(1, lab.n):
        turned = lab.t[i] - lab.wait[i]
        heat *= math.exp(-max(0.0, turned - lab.t[i - 1]) / tau)
        heat += abs(lab.range[i] - lab.range[i - 1])
        heat *= math.exp(-lab.wait[i] / tau)
        out[i] = heat
    return (1e-3 * lab.slope * lab.span * out * g.choice([-1, 1]))[:, None]


def stops_short(lab, g):
    # the setting is turned by hand, the wanted value is written down; after a long turn the hand stops early, more so when one wants to go home
    long = np.abs(np.diff(lab.x, prepend=lab.lo)) / lab.span
    short = lab.move * long ** g.uniform(0.5, 0.8) * (0.7 + 0.6 * lab.place)
    return (-1e-3 * lab.slope * lab.span * short)[:, None]


def dirty_tare(lab, g):
    # whoever sits down presses the zero key, while a part of the last value has not died away yet; it is then taken off all that follows
    dies = g.uniform(0.8, 1.5) * lab.gap
    key, out = 0.0, np.zeros(lab.n)
    for i in range(lab.n):
        if i and lab.shift[i] != lab.shift[i - 1]:
            rest = lab.t[i] - lab.wait[i] - lab.t[i - 1]
            key = (lab.x[i - 1] - lab.lo) * math.exp(-min(0.5 * rest, lab.gap) / dies)
        out[i] = -key
    return (1e-3 * lab.slope * out)[:, None]


EFFECTS = {f.__name__: f for f in (wear, odd_bend, setting_span, operator_habit,
                                   tram, switch_emf, stops_short, dirty_tare)}
PAIRS = [("wear", "switch_emf"), ("odd_bend", "dirty_tare"), ("operator_habit", "tram")]
ABOUT = {
    "wear": "Everyday. A track or a bearing wears with the way gone since the start, fastest at first, and the sensitivity goes with it; "
            "depends on the main quantity times the sum of its moves, nearly time or order.",
    "odd_bend": "Everyday. A spring stiffens both ways from its middle; depends on the main quantity (a cube).",
    "setting_span": "Everyday. The second setting (supply, line pressure, speed ...) has a hand in the sensitivity, less the higher it is; "
                    "depends on the main quantity times the setting.",
    "operator_habit": "Everyday. Each operator sets the cursor in his own way; depends on the operator.",
    "tram": "Unlisted. Trams start and brake in front of the house, their return current disturbs the reading; "
            "depends on time, with the period of the timetable (8 to 15 minutes), in short pulses of both signs.",
    "switch_emf": "Unlisted. Turning the range switch warms its contacts by rubbing, a thermal voltage fades in minutes; "
                  "depends on the change of range since the row before, on the wait and the time since.",
    "stops_short": "Unlisted. The hand stops early after a long turn of the setting, and the wanted value is written down; "
                   "depends on the move of the main quantity since the row before (direction and, less than in proportion, length), more at the end of a shift.",
    "dirty_tare": "Unlisted. A new operator presses the zero key while the last value has not died away, and this is taken off until the next zero; "
                  "depends on the main quantity of the last row before the operator changed, held over the shift.",
}
