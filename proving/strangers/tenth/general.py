"""Any transducer with a declared formula; other settings, people and surroundings are written down."""
import numpy as np
from .common import Lab, NOISES, rng, one_of, turn, text, unit  # noqa: F401

# main column, its greatest value, digits; second column, its levels; response, full scale
FAMILIES = (
    ("travel_mm", 200.0, 4, "drive_V", (1.5, 2.5, 3.5, 5.0), "y_mV", 900.0),
    ("load_N", 500.0, 3, "excitation_V", (4.0, 6.0, 8.0, 10.0), "bridge_mV", 20.0),
    ("torque_Nm", 60.0, 3, "excitation_V", (2.5, 5.0, 7.5), "out_mV", 12.0),
    ("flow_lpm", 80.0, 3, "coil_mA", (60.0, 90.0, 125.0, 150.0), "signal_uV", 4000.0),
    ("dew_gPm3", 25.0, 3, "supply_V", (9.0, 12.0, 15.0, 18.0), "cap_pF", 60.0),
    ("input_V", 10.0, 5, "bias_mA", (2.0, 4.0, 6.0), "reading_V", 5.0),
    ("bath_degC", 120.0, 3, "current_mA", (0.5, 1.0, 1.5, 2.0), "u_mV", 150.0),
    ("field_mT", 350.0, 3, "hall_mA", (20.0, 50.0, 80.0), "hall_mV", 70.0),
)
PEOPLE = ("Anna", "Bert", "Chiara", "Dirk", "Edith", "Farid", "Greta", "Hugo", "Ines", "Jan")


def lab(seed):
    g = rng("general", seed, "lab")
    main, top, digits, second, levels, response, scale = FAMILIES[turn(seed, len(FAMILIES), "family")]
    state = turn(seed, 3, "replicate")  # 0 not declared, 1 declared, 2 declared and each run has an offset
    while True:
        runs, per = int(g.integers(3, 7)), int(g.integers(18, 75))
        if 60 <= runs * per <= 380:
            break
    n = runs * per
    run = np.repeat(np.arange(runs), per)
    first = np.r_[True, run[1:] != run[:-1]]
    design = one_of(g, ["drawn", "levels", "sweeps"])
    low = g.uniform(0.02, 0.1)
    x, d = [], []
    for _ in range(runs):
        if design == "drawn":
            x.append(g.uniform(low, 1, per))
            d.append(g.choice([-1, 1], per))
        elif design == "levels":
            k = int(g.integers(6, 12))
            x.append(np.linspace(low, 1, k)[g.permutation(np.arange(per) % k)])
            d.append(g.choice([-1, 1], per))
        else:  # up and down, with gaps
            k = int(g.integers(5, 8))
            grid = np.linspace(low, 1, k)
            i = np.arange(per) % (2 * k)
            x.append(np.where(i < k, grid[i % k], grid[::-1][i % k]))
            d.append(np.where(i < k, 1, -1))
    x, d = np.concatenate(x), np.concatenate(d)
    x = np.round(top * np.clip(x + 0.003 * g.standard_normal(n), 0.01, None), digits)
    second_v = np.array(levels)[g.integers(0, len(levels), n)]
    wait = np.round(np.clip(np.exp(np.log(35) + 0.75 * g.standard_normal(n)), 6, 200))
    gap = wait + g.uniform(60, 320) * np.exp(0.3 * g.standard_normal(n))
    gap[first] += g.uniform(900, 9000, runs)
    t = np.round(np.cumsum(gap))
    drift = np.zeros((2, n))
    for i in range(1, n):
        keep = np.exp(-gap[i] / 5000.0)
        drift[:, i] = keep * drift[:, i - 1] + np.sqrt(1 - keep ** 2) * g.standard_normal(2)
    room = np.round(g.uniform(19, 24) + g.uniform(0.4, 1.2) * drift[0] + 0.05 * g.standard_normal(n), 2)
    humid = np.round(np.clip(g.uniform(34, 50) + g.uniform(3, 6) * drift[1] + 0.6 * g.standard_normal(n), 12, 85), 1)
    mains = np.round(230 + g.uniform(1, 2.5) * g.standard_normal(n), 1)
    crew = [PEOPLE[i] for i in g.permutation(len(PEOPLE))[:int(g.integers(2, 4))]]
    if g.random() < 0.5:
        who = g.permutation(np.arange(n) % len(crew))
    else:  # shifts of some rows
        long = int(g.integers(6, 13))
        who = ((np.arange(n) // long) + int(g.integers(3))) % len(crew)
    ranges = int(g.integers(2, 4))
    if g.random() < 0.5:
        ran = g.integers(0, ranges, n)
    else:  # stays for some rows
        ran = np.zeros(n, int)
        for i in range(n):
            ran[i] = ran[i - 1] if i and g.random() < 0.7 else int(g.integers(ranges))
    words = g.random() < 0.4
    time = one_of(g, ["time_s", "t_s", "elapsed_s"])
    waits = one_of(g, ["wait_s", "dwell_s", "hold_s"])
    columns = {}
    if state:
        columns["run"] = ["%d" % (k + 1) for k in run]
    if g.random() < 0.5:
        columns["point"] = ["%d" % (i + 1) for i in range(n)]
    columns[time] = text(t, 0)
    columns[main] = text(x, digits)
    columns[second] = text(second_v, 3)
    columns["direction"] = [("up" if k > 0 else "down") if words else "%d" % k for k in d]
    columns[one_of(g, ["room_degC", "air_degC"])] = text(room, 2)
    columns[one_of(g, ["humidity_pct", "rh_pct"])] = text(humid, 1)
    columns["operator"] = [crew[k] for k in who]
    columns["range"] = ["%d" % (k + 1) if not words else ("low", "mid", "high")[k] for k in ran]
    columns[waits] = text(wait, 0)
    if g.random() < 0.7:
        columns["mains_V"] = text(mains, 1)
    if g.random() < 0.5:
        columns["barometer_hPa"] = text(g.uniform(975, 1025) + np.cumsum(0.06 * g.standard_normal(n)), 1)
    terms = ["1", main] + ([second] if g.random() < 0.5 else [])
    model = [np.ones(n), x] + ([second_v] if len(terms) == 3 else [])
    slope = one_of(g, [-1, 1])
    clean = scale * slope * (g.uniform(0.9, 1.1) * x / top + 0.03 * g.standard_normal())
    if len(terms) == 3:
        clean = clean + scale * 0.01 * g.standard_normal() * second_v / levels[-1]
    error = scale * 10 ** g.uniform(-3.6, -2.7)
    if state == 2:
        clean = clean + 0.5 * error * g.standard_normal(runs)[run]
    options = ["--response", response, "--formula", " + ".join(terms), "--time", time] + (["--replicate", "run"] if state else [])
    return Lab(columns=columns, responses=[response], clean=clean[:, None], error=np.array([error]), groups=np.ones(n), runs=run,
               load=unit(x), model=np.column_stack(model), options=options, replicates=bool(state), run=run, x=x / top, d=d, t=t, gap=gap,
               second=second_v / levels[-1], wait=wait, room=room, humid=humid, who=who, crew=len(crew), range=ran, first=first, slope=slope)


def room_span(lab, g):
    """The sensitivity goes with the temperature of the room."""
    return (lab.x * (lab.room - lab.room.mean()) * one_of(g, [-1, 1]))[:, None]


def parallax(lab, g):
    """The setting is read on a long scale from a fixed chair. Each person's eye is at another height and sees the pointer shifted: up beyond
    the chair's middle, down before it. One is much taller."""
    eye = 0.15 * g.standard_normal(lab.crew)
    eye[int(g.integers(lab.crew))] += one_of(g, [-1, 1])
    return (eye[lab.who] * (lab.x - g.uniform(0.35, 0.65)))[:, None]


def end_of_travel(lab, g):
    """Near the end of the range the field, spring or membrane gives out and the response flattens."""
    return (-np.logaddexp(0, (lab.x - g.uniform(0.72, 0.84)) / g.uniform(0.03, 0.06)) * lab.slope)[:, None]


def self_heat(lab, g):
    """The supply is switched on for the point and heats the element: square of the supply, and more after a longer wait."""
    return (lab.second ** 2 * (1 - np.exp(-lab.wait / g.uniform(25, 60))) * one_of(g, [-1, 1]))[:, None]


def carpet_charge(lab, g):
    """For a change of direction the operator walks round the bench over a carpet. In dry air he comes back charged and the input sees it;
    the charge leaks off during the wait, faster in damp air."""
    walk = np.r_[False, lab.d[1:] != lab.d[:-1]]
    dry = np.maximum(0.0, 62 - lab.humid) / 20
    tau = g.uniform(25, 60) * np.exp((40 - lab.humid) / 25)
    return (walk * dry * np.exp(-lab.wait / tau) * one_of(g, [-1, 1]))[:, None]


def contact_film(lab, g):
    """The contact of the range switch is wiped clean each time the range is changed; then a film grows and takes part of the signal."""
    film = np.zeros(len(lab.t))
    tau = g.uniform(2, 5) * np.median(lab.gap)
    since = 0.0
    for i in range(len(film)):
        if i and lab.range[i] != lab.range[i - 1]:
            since = lab.wait[i]
        else:
            since += lab.gap[i]
        film[i] = 1 - np.exp(-since / tau)
    return (-film * lab.x * lab.slope)[:, None]


def aged_stiction(lab, g):
    """At rest the bearing's contacts grow stronger with the logarithm of time, so that what it holds back grows with the wait; its sign is that
    of the approach."""
    return (-lab.d * np.log1p(lab.wait / g.uniform(80, 200)) * one_of(g, [-1, 1]))[:, None]


def trainee_learns(lab, g):
    """One of the people is new and leans on the bench as he reads. With each point that he has done he leans less."""
    new = int(g.integers(lab.crew))
    done = np.cumsum(lab.who == new)
    return ((lab.who == new) * np.maximum(done, 1) ** -g.uniform(0.4, 0.7) * one_of(g, [-1, 1]))[:, None]


EFFECTS = {f.__name__: f for f in (room_span, parallax, end_of_travel, self_heat, carpet_charge, contact_film, aged_stiction, trainee_learns)}
PAIRS = [("room_span", "aged_stiction"), ("self_heat", "contact_film"), ("end_of_travel", "trainee_learns")]
ABOUT = {
    "room_span": "Everyday. Sensitivity follows the room's temperature. Depends on the main column times the room's temperature.",
    "parallax": "Everyday. Each person reads the scale from another height. Depends on operator times the main column, and so on operator.",
    "end_of_travel": "Everyday. The response flattens near the top of the range. Depends on the main column alone.",
    "self_heat": "Everyday. The supply heats the element during the wait. Depends on the square of the second column, and on the wait.",
    "carpet_charge": "Unlisted. A walk over the carpet at each change of direction charges the operator. Depends on direction against the row before, on"
                     " humidity and on the wait. Matters in dry air.",
    "contact_film": "Unlisted. A film grows on the switch's contact until the range is changed. Depends on the time since the range last changed,"
                    " times the main column.",
    "aged_stiction": "Unlisted. Friction grows with time at rest. Depends on direction times a growing function of the wait.",
    "trainee_learns": "Unlisted. A new operator spoils his readings, less with each point. Depends on operator and on how many points he has done.",
}
