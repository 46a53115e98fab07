"""Ten laboratories of other kinds, and ten causes: each cause in the laboratories where it can be."""
import numpy as np

from . import common as c
from .common import between, pick

PEOPLE = ("Aino", "Bram", "Chidi", "Dolores", "Emil", "Fumiko", "Goran", "Hana", "Ines", "Jorge", "Kofi", "Lotte")


class Lab:
    """Rows of a campaign: setting x, replicate, clock, direction; what else is recorded is added by the scenario."""

    def __init__(self, r, needs):
        self.r, self.needs = r, needs
        self.columns, self.roles, self.terms, self.options = [], {}, [], []

    def campaign(self, levels, orders=("random", "updown", "up"), rows=(40, 400), fixed_reps=None):
        r = self.r
        order = pick(r, *orders)
        L = len(levels)
        per = L if order != "updown" else 2 * L
        reps = int(np.clip(r.integers(2, 9), int(np.ceil(rows[0] / per)), max(2, rows[1] // per)))
        while per * reps > 400:
            reps -= 1
        if fixed_reps:
            reps = max(reps, min(fixed_reps, 400 // per))
        x, rep = [], []
        for k in range(reps):
            if order == "random":
                v = r.permutation(levels)
            elif order == "up":
                v = np.array(levels)
            else:
                v = np.r_[levels, levels[::-1]]
            x.append(v)
            rep.append(np.full(len(v), k + 1))
        self.x, self.rep = np.concatenate(x).astype(float), np.concatenate(rep)
        self.n, self.order = self.x.size, order
        d = np.sign(np.diff(self.x, prepend=self.x[0] - 1))
        for i in range(1, self.n):
            if d[i] == 0:
                d[i] = -d[i - 1] if order == "updown" else d[i - 1]
        self.direction = d.astype(int)

    def clock(self, low, high, pauses=None):
        r, n = self.r, self.n
        dt = between(r, low, high) * (1 + 0.3 * np.abs(r.standard_normal(n)))
        gap = np.zeros(n)
        if "pauses" in self.needs or r.random() < 0.5:
            k = int(r.integers(3, 9)) if "pauses" in self.needs or r.random() < 0.5 else int(r.integers(1, 3))
            gap[r.choice(np.arange(3, n), k, replace=False)] += r.uniform(1200, 7200, k)
        if r.random() < 0.5:
            gap[np.flatnonzero(np.diff(self.rep)) + 1] += between(r, 300, 3600)
        dt = dt + gap
        dt[0] = 0
        t = np.cumsum(dt)
        if "long" in self.needs and t[-1] < 8 * 3600:
            t *= between(r, 8, 40) * 3600 / t[-1]
        self.t = np.round(t, 1)
        self.dt = np.diff(self.t, prepend=self.t[0] - np.median(np.diff(self.t)))
        self.gap = gap

    def add(self, name, values, form, role=None):
        self.columns.append((name, values, form))
        if role:
            self.roles[role] = name

    def add_basic(self, xname, xform, direction=None):
        """order, replicate, time, setting, direction: some laboratories do not write all of them."""
        r = self.r
        if r.random() < 0.6:
            self.add(pick(r, "order", "run", "no"), np.arange(1, self.n + 1), "d")
        rep = pick(r, "replicate", "series", "cycle")
        self.add(rep, self.rep, "d")
        self.options += ["--replicate", rep]
        unit = pick(r, "s", "s", "min", "h")
        tname = {"s": pick(r, "t_s", "elapsed_s", "clock_s"), "min": "t_min", "h": "elapsed_h"}[unit]
        self.add(tname, self.t / {"s": 1, "min": 60, "h": 3600}[unit], {"s": ".1f", "min": ".3f", "h": ".5f"}[unit])
        self.options += ["--time", tname]
        self.add(xname, self.x, xform)
        self.terms.append((xname, self.x))
        if direction or (direction is None and self.order == "updown" and r.random() < 0.7):
            name = pick(r, "direction", "way", "sense")
            self.add(name, self.direction, "d")
            self.options += ["--direction", name]

    def room(self):
        r = self.r
        if r.random() < 0.7:
            v = between(r, 19, 24) + between(r, 0.1, 1.2) * c.wander(r, self.n, self.n / between(r, 3, 15))
            self.add(pick(r, "room_degC", "air_degC", "T_lab_degC"), v, ".2f")

    def humidity(self, must=False):
        r = self.r
        if must or r.random() < 0.4:
            v = between(r, 35, 55) + between(r, 3, 9) * c.wander(r, self.n, self.n / between(r, 4, 20))
            if r.random() < 0.4:
                v = v + between(r, 5, 12) * (self.t > between(r, 0.2, 0.7) * self.t[-1])     # the humidifier starts
            self.rh = np.round(np.clip(v, 10, 90), 1)
            self.add(pick(r, "RH_pct", "humidity_pct", "rh_room_pct"), self.rh, ".1f")

    def people(self, must=False):
        r = self.r
        if must or r.random() < 0.35:
            k = int(r.integers(2, 5))
            names = r.choice(PEOPLE, k, replace=False)
            style = pick(r, "block", "mixed", "series")
            if style == "mixed":
                who = r.integers(0, k, self.n)
            elif style == "series" and self.rep.max() >= k:
                who = (self.rep - 1) % k
            else:
                who = (np.arange(self.n) // int(r.integers(6, 20))) % k
            self.who = who
            self.add(pick(r, "operator", "observer", "who"), names[who], None)

    def neighbour(self, must=False):
        r = self.r
        if must or r.random() < 0.35:
            n = self.n
            kind = pick(r, "jumps", "wander", "staircase")
            if kind == "jumps":
                v = np.cumsum(r.random(n) < between(r, 0.1, 0.3)) % 2 * between(r, 3, 9) + 0.1 * r.standard_normal(n)
            elif kind == "wander":
                v = between(r, 1, 4) + between(r, 0.5, 2) * c.wander(r, n, between(r, 2, 6))
            else:
                v = (np.arange(n) // int(r.integers(2, 6))) % int(r.integers(3, 7)) * between(r, 0.5, 2) + 0.02 * r.standard_normal(n)
            self.next_slot = np.round(v, 3)
            self.add(pick(r, "ch07_V", "slot_4_mV", "heater_mon_V", "aux2_mV"), self.next_slot, ".3f")

    def respond(self, name, slope, offset, fine=(-4.5, -3.0)):
        r = self.r
        y = offset + sum(b * v for b, (_, v) in zip(slope, self.terms))
        span = abs(slope[0]) * np.ptp(self.terms[0][1])
        self.sigma = span * 10 ** between(r, *fine)
        self.clean, self.response = y, name
        self.model = np.column_stack([np.ones(self.n)] + [v for _, v in self.terms])
        self.level = (self.terms[0][1] - self.terms[0][1].min()) / np.ptp(self.terms[0][1])
        formula = "1 + " + " + ".join(n for n, _ in self.terms)
        self.options = ["--response", name, "--formula", formula] + self.options


def whole_numbers(r, top, many, zero=True):
    pool = np.arange(0 if zero else 1, top + 1)
    return np.sort(r.choice(pool, min(many, pool.size), replace=False))


# Scenarios
def screw(r, needs):
    """A carriage on a lead screw under a displacement probe."""
    lab = Lab(r, needs)
    top = pick(r, 10.0, 25.0, 50.0, 150.0, 300.0)
    m = int(r.integers(11, 41))
    levels = np.round(np.linspace(0, top, m), 3)
    if r.random() < 0.5:
        levels = np.round(np.sort(r.uniform(0, top, m)), 3)
    lab.campaign(levels, orders=("updown", "updown", "random") if "direction" in needs else ("updown", "random", "up"))
    lab.clock(20, 120)
    lab.add_basic(pick(r, "x_mm", "carriage_mm", "scale_mm"), ".3f")
    lab.room(), lab.humidity("humidity" in needs), lab.people()
    name, b = pick(r, ("lvdt_mV", 20.0), ("probe_V", 0.2), ("y_mm", 1.0), ("encoder_kct", 4.0))
    lab.respond(name, [b * between(r, 0.8, 1.2)], b * between(r, -2, 2))
    return lab


def deadweights(r, needs):
    """A force cell under a stack of weights, strain gauges on it."""
    lab = Lab(r, needs)
    top = int(pick(r, 50, 80, 100, 120))
    lab.units_of = whole_numbers(r, top, int(r.integers(10, 26)))
    unit, name, form = pick(r, (1.0, "load_N", ".0f"), (0.5, "load_kgf", ".1f"), (10.0, "force_N", ".0f"), (0.2, "load_kN", ".1f"))
    lab.campaign(lab.units_of * unit)
    lab.units = np.round(lab.x / unit).astype(int)
    lab.pieces = pick(r, (1, 2, 2, 5, 10, 20, 20, 50), (1, 1, 2, 5, 10, 10, 20, 50), (1, 2, 4, 8, 16, 32, 64))
    lab.clock(60, 300)
    lab.add_basic(name, form)
    lab.room(), lab.humidity("humidity" in needs), lab.people(), lab.neighbour("neighbour" in needs)
    name, b = pick(r, ("cell_mV_per_V", 2.0), ("bridge_mV", 20.0), ("indicator_kct", 200.0))
    lab.respond(name, [b / (top * unit)], b * between(r, -0.02, 0.02), (-4.8, -3.6))
    return lab


def dial(r, needs):
    """A dial pressure gauge on a dead-weight tester, read by eye."""
    lab = Lab(r, needs)
    top = int(pick(r, 40, 60, 100))
    lab.units_of = whole_numbers(r, top, int(r.integers(9, 21)), zero=False)
    unit, name, form = pick(r, (10.0, "p_kPa", ".0f"), (0.5, "set_bar", ".1f"), (1.0, "p_MPa", ".0f"))
    lab.campaign(lab.units_of * unit)
    lab.units = np.round(lab.x / unit).astype(int)
    lab.pieces = pick(r, (1, 2, 2, 5, 10, 20, 20, 50), (1, 2, 3, 5, 10, 20, 30, 50))
    lab.clock(40, 150)
    lab.add_basic(name, form)
    lab.room(), lab.people("people" in needs)
    lab.respond(pick(r, "pointer_deg", "reading_div"), [between(r, 250, 300) / (top * unit)], between(r, -3, 3), (-3.3, -2.6))
    return lab


def magnet(r, needs):
    """A Hall probe in an electromagnet, degaussed before each series."""
    lab = Lab(r, needs)
    top = pick(r, 5.0, 10.0, 40.0)
    if r.random() < 0.7:
        levels = np.round(np.linspace(-top, top, int(r.integers(9, 22))), 2)
    else:
        levels = np.round(np.linspace(-top, top, int(r.integers(7, 13)) * 2 - 1), 2)
    lab.campaign(levels, orders=("random", "random", "updown"), rows=(60, 400), fixed_reps=4)
    lab.top = top
    lab.clock(15, 90)
    lab.add_basic(pick(r, "coil_A", "I_A", "current_A"), ".2f")
    lab.room()
    v = 24 + 6 * (1 - np.exp(-lab.t / 3000)) + 0.3 * c.wander(r, lab.n, 20)
    if r.random() < 0.6:
        lab.add("coil_degC", v, ".1f")
    name, b = pick(r, ("hall_mV", 100.0), ("B_mT", 500.0), ("probe_V", 2.0))
    lab.respond(name, [b / top], b * between(r, -0.01, 0.01), (-4.3, -3.2))
    return lab


def flow(r, needs):
    """A water flow stand; its meter is read by eye or counted."""
    lab = Lab(r, needs)
    top = pick(r, 10.0, 60.0, 250.0)
    levels = np.round(top * np.geomspace(between(r, 0.08, 0.2), 1, int(r.integers(7, 16))), 2 if top < 100 else 1)
    lab.campaign(levels, orders=("random", "random", "updown"), rows=(60, 400))
    lab.clock(60, 200)
    lab.add_basic(pick(r, "flow_L_per_min", "q_L_per_min", "weighed_L_per_min"), ".2f")
    water = np.zeros(lab.n)
    cold, warm, tau = between(r, 9, 14), between(r, 22, 30), between(r, 0.2, 0.6) * lab.t[-1]
    water[0] = cold
    for i in range(1, lab.n):              # the pump warms it; in pauses the tank gets fresh water
        water[i] = warm + (water[i - 1] - warm) * np.exp(-(lab.dt[i] - lab.gap[i] * (lab.gap[i] > 0)) / tau)
        if lab.gap[i] > 900:
            water[i] = cold + 0.3 * (water[i - 1] - cold)
    lab.water = np.round(water + 0.05 * r.standard_normal(lab.n), 2)
    lab.add(pick(r, "water_degC", "tank_degC"), lab.water, ".2f")
    lab.room(), lab.people("people" in needs)
    name, b = pick(r, ("meter_Hz", 800.0), ("float_mm", 250.0), ("turbine_Hz", 1500.0))
    if "people" in needs:
        name, b = "float_mm", between(r, 200, 400)
    lab.respond(name, [b / top], b * between(r, -0.02, 0.02), (-3.8, -2.8))
    return lab


def photodiode(r, needs):
    """A photodiode behind a window, in the beam of a lamp with settings of power."""
    lab = Lab(r, needs)
    top = pick(r, 1.0, 5.0, 20.0)
    levels = np.round(np.linspace(0.05, 1, int(r.integers(7, 19))) * top, 4)
    lab.campaign(levels)
    lab.clock(10, 120)
    lab.add_basic(pick(r, "power_mW", "irradiance_W_per_m2", "lamp_mW"), ".4f")
    lab.room(), lab.humidity(), lab.people()
    name, b = pick(r, ("photo_uA", 300.0), ("detector_nA", 800.0), ("amp_V", 8.0))
    lab.respond(name, [b / top], b * between(r, -0.005, 0.005), (-4.0, -3.0))
    return lab


def electrode(r, needs):
    """A glass electrode in buffers."""
    lab = Lab(r, needs)
    pool = np.array([1.68, 3.0, 4.01, 5.0, 6.0, 6.86, 7.41, 8.0, 9.18, 10.01, 11.0, 12.45])
    lab.campaign(np.sort(r.choice(pool, int(r.integers(6, 12)), replace=False)), orders=("random", "random", "up", "updown"), rows=(60, 300))
    lab.clock(90, 400)
    lab.add_basic(pick(r, "buffer_pH", "pH_set"), ".2f")
    lab.room(), lab.people()
    lab.respond(pick(r, "emf_mV", "electrode_mV"), [-between(r, 57, 59.3)], between(r, 395, 425), (-3.6, -2.7))
    return lab


def decade(r, needs):
    """A voltmeter against a decade divider."""
    lab = Lab(r, needs)
    digits = pick(r, 100, 1000)
    lab.units_of = whole_numbers(r, digits - 1, int(r.integers(20, 51)))
    unit, name, form = pick(r, (0.01, "set_V", ".2f"), (1.0, "dial_mV", ".0f"), (0.1, "dial_V", ".1f"))
    lab.campaign(lab.units_of * unit, orders=("random", "up", "updown"))
    lab.units = np.round(lab.x / unit).astype(int)
    lab.pieces, lab.tens = None, 10 if digits == 100 else pick(r, 10, 100)
    lab.clock(5, 40)
    lab.add_basic(name, form)
    lab.room(), lab.humidity(), lab.neighbour("neighbour" in needs)
    lab.respond(pick(r, "dvm_V", "meter_V", "reading_mV"), [between(r, 0.99, 1.01)], between(r, -0.3, 0.3) * unit, (-5.0, -3.8))
    return lab


def bath(r, needs):
    """A resistance thermometer in a stirred bath, depth of immersion recorded, on a scanner."""
    lab = Lab(r, needs)
    low, top = pick(r, (0.0, 80.0), (-40.0, 60.0), (20.0, 200.0))
    nominal = np.linspace(low, top, int(r.integers(8, 21)))
    lab.campaign(nominal)
    lab.x = np.round(lab.x + 0.03 * r.standard_normal(lab.n), 4)
    lab.clock(200, 900)
    lab.add_basic(pick(r, "bath_degC", "standard_degC", "t90_degC"), ".4f", direction=False)
    depth = np.round(between(r, 120, 250) + 10 * r.integers(-3, 4, lab.n) + r.uniform(-1, 1, lab.n), 1)
    slope = [pick(r, 0.3908, 0.0039, 40.0)]
    if r.random() < 0.5:
        lab.add("immersion_mm", depth, ".1f")
        if r.random() < 0.5:            # it counts, and the formula says so
            lab.terms.append(("immersion_mm", depth))
            slope.append(slope[0] * between(r, 1e-4, 1e-3))
    lab.room(), lab.neighbour("neighbour" in needs)
    name = {0.3908: "R_ohm", 0.0039: "ratio", 40.0: "emf_uV"}[slope[0]]
    lab.respond(name, slope, slope[0] * between(r, 240, 260) if slope[0] < 1 else between(r, -5, 5), (-4.6, -3.6))
    return lab


def comparator(r, needs):
    """Gauge blocks on a comparator with a needle, or weights on a balance with one: carried by hand."""
    lab = Lab(r, needs)
    top = pick(r, 50.0, 100.0, 200.0)
    pool = np.unique(np.round(np.r_[top * np.geomspace(0.05, 1, 14), top * np.array([0.1, 0.25, 0.4, 0.6, 0.75])], 1))
    lab.campaign(np.sort(r.choice(pool, int(r.integers(7, 15)), replace=False)), orders=("random", "random", "up", "updown"), rows=(50, 400))
    lab.clock(40, 200)
    name, y = pick(r, ("length_mm", "needle_um"), ("mass_g", "balance_div"))
    lab.kind = name
    lab.add_basic(name, ".1f")
    lab.room(), lab.people("people" in needs), lab.humidity()
    lab.respond(y, [between(r, -0.08, 0.08) + 0.1], between(r, -20, 20), (-2.6, -1.7))
    return lab


# Effects: (lab, r) -> (rows,), any scale
def worn_screw(lab, r):
    low, high = lab.x.min(), lab.x.max()
    at, wide = low + between(r, 0.25, 0.75) * (high - low), between(r, 0.06, 0.18) * (high - low)
    worn = np.exp(-((lab.x - at) / wide) ** 2)
    return worn * (lab.direction < 0 if r.random() < 0.5 else lab.direction * 0.5)     # the probe's spring on one flank, or on none


def iron_remembers(lab, r):
    plays = np.array([0.15, 0.3, 0.5, 0.7, 0.85]) * lab.top
    weight = r.uniform(0.3, 1, plays.size)
    out, state = np.zeros(lab.n), np.zeros(plays.size)
    for i in range(lab.n):
        if i == 0 or lab.rep[i] != lab.rep[i - 1]:
            state[:] = 0.0                      # degaussed
        state = np.clip(state, lab.x[i] - plays, lab.x[i] + plays)
        out[i] = weight @ state
    return out


def damp_backing(lab, r):
    tau = between(r, 0.06, 0.3) * lab.t[-1]
    wet = np.empty(lab.n)
    wet[0] = lab.rh[:max(3, lab.n // 20)].mean()
    for i in range(1, lab.n):
        wet[i] = lab.rh[i] + (wet[i - 1] - lab.rh[i]) * np.exp(-lab.dt[i] / tau)
    return (wet - wet.mean()) * (1 + between(r, -0.6, 0.6) * lab.level)


def mains_beat(lab, r):
    period = between(r, 5, 35) * np.median(lab.dt)
    phase = between(r, 0, 6.28) + 2 * np.pi * lab.t / period + 0.4 * c.wander(r, lab.n, 60)
    return np.sin(phase) * (1.0 if r.random() < 0.5 else 0.3 + lab.level)


def rounding_hand(lab, r):
    raise NotImplementedError("not additive: made in make()")


def degassing_water(lab, r):
    clear = np.quantile(lab.water, between(r, 0.3, 0.7))
    return np.clip(lab.water - clear, 0, None) * (np.median(lab.x) / lab.x) ** between(r, 0.5, 1.2)


def dose(lab, r):
    light = lab.level + 0.05
    if lab.response in ("emf_mV", "electrode_mV"):
        light = np.clip(lab.x - between(r, 8.2, 9.5), 0, None)      # the strong bases etch the glass
        arm = lab.x - 7.0
    else:
        arm = lab.x
    got = np.cumsum(np.r_[0.0, (light * np.minimum(lab.dt, 3 * np.median(lab.dt)))[:-1]])
    got /= got[-1]
    return -arm * (1 - np.exp(-got * between(r, 0.5, 3)))


def next_slot_kick(lab, r):
    return np.diff(lab.next_slot, prepend=lab.next_slot[0])


def one_bad_weight(lab, r):
    if lab.pieces is None:
        digit = lab.units // lab.tens % 10
        worn = r.choice(np.arange(1, 10), int(r.integers(1, 3)), replace=False)
        return np.isin(digit, worn).astype(float)
    used = np.zeros((len(lab.pieces), lab.n))
    rest = lab.units.copy()
    for k in np.argsort(lab.pieces)[::-1]:
        take = rest >= lab.pieces[k]
        used[k], rest = take, rest - take * lab.pieces[k]
    share = used.mean(1)
    good = np.flatnonzero((share > 0.15) & (share < 0.85))
    return used[int(r.choice(good))] if good.size else np.zeros(lab.n)


def hands_warm(lab, r):
    tau = between(r, 4, 15) * np.median(lab.dt)
    warm = np.ones(lab.n)
    if hasattr(lab, "who"):
        warm = np.array([1.0, between(r, 0.1, 0.5), between(r, 0.7, 1.3), 0.3])[lab.who]     # some wear gloves
    heat, out = 0.0, np.zeros(lab.n)
    for i in range(lab.n):
        heat = heat * np.exp(-lab.dt[i] / tau) + warm[i]
        out[i] = heat
    return out * lab.x / lab.x.max() if lab.kind == "length_mm" else -out      # a warm block is long; a warm pan is light


SCENARIOS = {f.__name__: f for f in (screw, deadweights, dial, magnet, flow, photodiode, electrode, decade, bath, comparator)}
WHERE = {"worn_screw": {"screw"}, "iron_remembers": {"magnet"}, "damp_backing": {"screw", "deadweights"},
         "mains_beat": {"photodiode", "decade", "bath", "magnet"}, "rounding_hand": {"dial", "comparator", "flow"},
         "degassing_water": {"flow"}, "dose": {"photodiode", "electrode"}, "next_slot_kick": {"decade", "bath", "deadweights"},
         "one_bad_weight": {"deadweights", "dial", "decade"}, "hands_warm": {"comparator"}}
NEEDS = {"worn_screw": {"direction"}, "damp_backing": {"humidity", "long"}, "rounding_hand": {"people"}, "degassing_water": {"pauses"},
         "next_slot_kick": {"neighbour"}, "hands_warm": {"pauses"}}
EFFECTS = {f.__name__: f for f in (worn_screw, iron_remembers, damp_backing, mains_beat, rounding_hand, degassing_water, dose,
                                   next_slot_kick, one_bad_weight, hands_warm)}
PAIRS = [("worn_screw", "damp_backing"), ("one_bad_weight", "next_slot_kick"), ("dose", "mains_beat"), ("rounding_hand", "hands_warm"),
         ("mains_beat", "next_slot_kick"), ("iron_remembers", "mains_beat"), ("degassing_water", "rounding_hand")]
ABOUT = {
    "worn_screw": "The lead screw is worn where the carriage is used most; there the nut has play, taken up on the side it comes from. Depends on the setting "
                  "(a bell around one place) and direction, +1 against -1 or only when going down. Matters near the place.",
    "iron_remembers": "The pole pieces keep a remanence that depends on the current's turning points since the degaussing before each series (plays of several "
                      "widths). Depends on the current, its largest values before in the series, replicate. Matters for settings smaller than earlier ones.",
    "damp_backing": "The gauges' backing (or the probe's former) takes up water from the air with a delay of hours. Depends on recorded humidity, lagged in elapsed "
                    "time; somewhat on the level. Matters after changes of weather or when the humidifier starts.",
    "mains_beat": "The sampling and the mains beat: a slow sine in time of 5 to 35 rows, its phase wandering a little, in some laboratories growing with the level. "
                  "Depends on time. Matters always.",
    "rounding_hand": "One of the operators reads the needle to whole coarse divisions, the others between them. Depends on the operator and the response itself "
                     "(rounded to a step). Matters in that operator's rows.",
    "degassing_water": "Pumping warms the water; above the temperature at which it is saturated, bubbles are in the meter, more at small flow. Pauses bring fresh, cold "
                       "water. Depends on water temperature above a threshold, times a power of 1/flow. Matters late and at small flow.",
    "dose": "What has been measured wears the sensor: light browns the window (photodiode), strong bases etch the glass (electrode). A loss of slope that grows with "
            "the sum of levels of the rows before (electrode: of pH above about 9), saturating. Depends on time, earlier settings, times the setting now. Matters late.",
    "next_slot_kick": "The scanner's neighbour kicks charge into the channel when its own signal has changed since the scan before. Depends on the change of the "
                      "neighbour's recorded column from the row before. Matters when that jumps.",
    "one_bad_weight": "Loads are put together from pieces, large ones first, and one piece is wrong (in a decade divider: one or two positions of one dial). "
                      "Depends on the setting, whether the piece is in it (its digits). Matters at those loads; not a smooth curve.",
    "hands_warm": "Each handling brings heat from the hands (less from those with gloves), which goes in some rows; quick work adds up, pauses cool. Depends on times of the "
                  "rows before, operator if recorded; for blocks times length, for weights a lift. Matters in quick work.",
}
NOISES = {
    "white": lambda r, lab: c.white(r, lab.n), "student": lambda r, lab: c.student(r, lab.n),
    "uniform": lambda r, lab: c.uniform(r, lab.n), "skewed": lambda r, lab: c.skewed(r, lab.n),
    "outliers": lambda r, lab: c.outliers(r, lab.n), "ar1": lambda r, lab: c.ar1(r, lab.n),
    "level": lambda r, lab: c.weighted(r, 0.4 + 1.2 * lab.level), "bursts": lambda r, lab: c.bursts(r, lab.n),
    "flicker": lambda r, lab: c.flicker(r, lab.n),
}


def rounding(lab, r, y, size):
    """One hand's readings in whole divisions, the division chosen so that the size is as asked."""
    if size <= 0:
        return np.zeros(lab.n)
    share = np.bincount(lab.who) / lab.n
    order = r.permutation(share.size)
    hand = next((k for k in order if 0.2 <= share[k] <= 0.6), int(np.argmax(share)))
    his = lab.who == hand
    about = size * lab.sigma * np.sqrt(12 / share[hand])
    best = None
    for q in about * np.geomspace(0.6, 1.9, 400):
        h = np.where(his, np.round(y / q) * q - y, 0.0)
        miss = abs(c.rms(c.left_over(h, lab.model)) / lab.sigma / size - 1)
        if best is None or miss < best[0]:
            best = (miss, h)
    return best[1]


def make(effects, seed, size, noise):
    key = "+".join(effects)
    needs, where = set(), sorted(SCENARIOS)
    for e in effects:
        needs |= NEEDS.get(e, set())
        where = [s for s in where if s in WHERE[e]]
    if not where:
        raise ValueError("no laboratory has all of %r" % (effects,))
    for attempt in range(80):
        r = c.stream(seed, "general", "lab", key, attempt)
        name = where[int(r.integers(len(where)))]
        lab = SCENARIOS[name](r, needs)
        if not 40 <= lab.n <= 400:
            continue
        if "people" in needs and not 0.2 <= np.sort(np.bincount(lab.who) / lab.n)[-1] <= 0.8:
            continue
        shapes = {e: EFFECTS[e](lab, c.stream(seed, "general", e, key, attempt)) for e in effects if e != "rounding_hand"}
        lefts = {e: c.rms(c.left_over(s, lab.model)) for e, s in shapes.items()}
        if all(lefts[e] > 0.08 * c.rms(s - s.mean()) and lefts[e] > 0 for e, s in shapes.items()):
            break
    else:
        raise RuntimeError("no laboratory for %r" % (effects,))
    hidden, parts = np.zeros(lab.n), {}
    error = lab.sigma * NOISES[noise](c.stream(seed, "general", "noise", key), lab)
    for e, s in shapes.items():
        h = s * size * lab.sigma / lefts[e]
        parts[e] = c.rms(c.left_over(h, lab.model)) / lab.sigma
        hidden = hidden + h
    if "rounding_hand" in effects:       # the hand rounds all that is there
        h = rounding(lab, c.stream(seed, "general", "hand", key, attempt), lab.clean + error + hidden, size)
        parts["rounding_hand"] = c.rms(c.left_over(h, lab.model)) / lab.sigma
        hidden = hidden + h
    y = lab.clean + error + hidden
    columns = lab.columns + [(lab.response, y, ".%df" % c.digits(lab.sigma))]
    return c.Table(c.csv_text(columns), list(lab.options), float(np.mean(list(parts.values()))) if parts else 0.0, hidden, parts,
                   lab.sigma, lab.sigma, {"scenario": name, "attempt": attempt, "order": lab.order})
