"""Three other benches: a displacement sensor on a micrometer, a photometer with standard solutions, a turbine flow meter on a weighing rig."""
import numpy as np

from . import common as c


class Lab:
    pass


def _wander(rng, n, size):
    w = np.cumsum(rng.standard_normal(n)) / np.sqrt(n)
    return size * (w - w.mean())


def lvdt(rng):
    lab = Lab()
    reps, points = int(rng.integers(3, 7)), int(rng.integers(13, 36))
    half = rng.uniform(2.0, 6.0)
    style = ["random", "up", "up-down"][rng.integers(0, 3)]
    rep, x, t, now = [], [], [], 0.0
    base = rng.uniform(25, 70)
    for k in range(reps):
        grid = np.linspace(-half, half, points) + 0.3 * (2 * half / points) * rng.uniform(-1, 1, points)
        if style == "random":
            grid = rng.permutation(grid)
        elif style == "up-down" and k % 2:
            grid = grid[::-1]
        for a in grid:
            now += base * np.exp(0.25 * rng.standard_normal())
            rep.append(k + 1), x.append(round(a, 3)), t.append(round(now, 1))
        now += rng.uniform(300, 3000)
    n = lab.n = len(x)
    lab.rep, lab.x, lab.t, lab.half = np.array(rep), np.array(x), np.array(t), half
    lab.room = np.round(21 + _wander(rng, n, 0.6) + 0.02 * rng.standard_normal(n), 2)
    lab.supply = np.round(12.0 + _wander(rng, n, 0.3) - 0.35 * (rng.random(n) < 0.2) + 0.05 * rng.standard_normal(n), 3)
    lab.humidity = np.round(45 + _wander(rng, n, 5) + 0.3 * rng.standard_normal(n), 1)
    gain = rng.uniform(80, 400)
    lab.level = np.abs(lab.x) / half
    lab.sigma = gain * half * 10 ** rng.uniform(-4, -3)
    lab.y = gain * lab.x + rng.normal(0, 5) + (lab.sigma * rng.standard_normal(reps))[lab.rep - 1]
    lab.design = np.column_stack([c.dummies(lab.rep), lab.x / half])
    lab.session = lab.rep
    lab.header = ["rep", "t_s", "x_mm", "room_degC", "supply_V", "humidity_pct", "y_mV"]
    lab.columns, lab.decimals = [lab.rep, lab.t, lab.x, lab.room, lab.supply, lab.humidity], [0, 1, 3, 2, 3, 1]
    lab.options = ["--response", "y_mV", "--formula", "1 + x_mm", "--time", "t_s", "--replicate", "rep"]
    return lab


def photometer(rng):
    lab = Lab()
    points, again = int(rng.integers(7, 13)), int(rng.integers(7, 15))
    top = rng.choice([10.0, 20.0, 50.0])
    grid = np.round(np.linspace(0, top, points), 2)
    conc = np.concatenate([rng.permutation(grid) for _ in range(again)])
    n = lab.n = len(conc)
    lab.x = conc
    lab.t = np.round(np.cumsum(rng.uniform(1.5, 4.0) * np.exp(0.3 * rng.standard_normal(n))), 2)
    kinds = int(rng.integers(3, 5))
    lab.cuvette = rng.integers(0, kinds, n)
    lab.kinds = kinds
    lab.lamp = np.round(6.0 + _wander(rng, n, 0.01) + 0.001 * rng.standard_normal(n), 4)
    lab.room = np.round(22 + _wander(rng, n, 0.8) + 0.03 * rng.standard_normal(n), 2)
    lab.top, full = top, rng.uniform(0.8, 2.0)
    lab.a = full * lab.x / top
    lab.y = lab.a + rng.normal(0.01, 0.005)
    lab.level = lab.x / top
    lab.sigma = full * 10 ** rng.uniform(-3.3, -2.5)
    lab.design = np.column_stack([np.ones(n), lab.x / top])
    lab.session = np.arange(n) * 5 // n
    lab.header = ["order", "t_min", "c_mgL", "cuvette", "lamp_V", "room_degC", "absorbance"]
    lab.columns = [np.arange(1, n + 1), lab.t, lab.x, ["ABCD"[k] for k in lab.cuvette], lab.lamp, lab.room]
    lab.decimals = [0, 2, 2, 0, 4, 2]
    lab.options = ["--response", "absorbance", "--formula", "1 + c_mgL", "--time", "t_min", "--group", "cuvette"]
    return lab


def flow(rng):
    lab = Lab()
    runs, points = int(rng.integers(3, 7)), int(rng.integers(16, 33))
    low, high = rng.uniform(3, 8), rng.uniform(40, 90)
    run, x = [], []
    for k in range(runs):
        grid = np.linspace(low, high, points) * (1 + 0.01 * rng.standard_normal(points))
        grid = grid[::-1] if k % 2 else grid
        if runs % 2:
            grid = rng.permutation(grid)
        run += [k + 1] * points
        x += list(np.round(grid, 3))
    lab.run, lab.x = np.array(run), np.array(x)
    n = lab.n = len(x)
    chance = np.clip(1 - lab.x / high, 0.1, 0.9)
    lab.collect = np.where(rng.random(n) < chance, rng.choice([60.0, 120.0], n), rng.choice([20.0, 30.0, 60.0], n))
    lab.collect = np.round(lab.collect + rng.uniform(-1, 1, n), 2)
    lab.t = np.round(np.cumsum(lab.collect / 60 + rng.uniform(1, 3, n) + np.where(np.diff(lab.run, prepend=1) != 0, 25.0, 0)), 2)
    lab.water = np.round(rng.uniform(17, 20) + rng.uniform(3, 6) * (1 - np.exp(-lab.t / (0.6 * lab.t[-1]))) + _wander(rng, n, 1.0)
                         + 0.15 * rng.standard_normal(n), 2)
    lab.pressure = np.round(2.5 + 0.1 * rng.standard_normal(n) + _wander(rng, n, 0.2), 3)
    k = rng.uniform(8, 30)
    lab.high = high
    lab.level = lab.x / high
    lab.sigma = k * high * 10 ** rng.uniform(-4, -3)
    lab.y = k * lab.x - rng.uniform(1, 4) + (0.7 * lab.sigma * rng.standard_normal(runs))[lab.run - 1]
    lab.design = np.column_stack([c.dummies(lab.run), lab.x / high])
    lab.session = lab.run
    lab.header = ["run", "t_min", "q_Lmin", "collect_s", "water_degC", "line_bar", "f_Hz"]
    lab.columns, lab.decimals = [lab.run, lab.t, lab.x, lab.collect, lab.water, lab.pressure], [0, 2, 3, 2, 2, 3]
    lab.options = ["--response", "f_Hz", "--formula", "1 + q_Lmin", "--time", "t_min", "--replicate", "run"]
    return lab


BENCHES = {"lvdt": lvdt, "photometer": photometer, "flow": flow}


def drunken_thread(lab, rng):
    a = 2 * np.pi * lab.x / 0.5
    return np.sin(a + rng.uniform(0, 6.28)) + 0.25 * np.sin(2 * a + rng.uniform(0, 6.28))


def regulator_dropout(lab, rng):
    return lab.x / lab.half * np.maximum(0.0, np.quantile(lab.supply, rng.uniform(0.3, 0.55)) - lab.supply)


def anvil_dust(lab, rng):
    share, limit = rng.uniform(0.4, 0.6), rng.uniform(-0.3, 0.4) * lab.half
    first = lab.t[0] + rng.uniform(0.08, 0.92 - share) * np.ptp(lab.t)
    inside = (lab.t > first) & (lab.t < first + share * np.ptp(lab.t))
    return inside * (lab.x < limit).astype(float)


def stray_light(lab, rng):
    s = rng.uniform(0.002, 0.02)
    return -np.log10((10 ** -lab.a + s) / (1 + s)) - lab.a


def rinse_carryover(lab, rng):
    last, h = {}, np.zeros(lab.n)
    for i in range(lab.n):
        k = lab.cuvette[i]
        h[i] = (last.get(k, lab.x[i]) - lab.x[i]) / lab.top
        last[k] = lab.x[i]
    return h


def cuvette_reversed(lab, rng):
    k, when = int(rng.integers(0, lab.kinds)), rng.uniform(0.25, 0.6) * lab.t[-1]
    return ((lab.cuvette == k) & (lab.t > when)) * (1.0 + rng.uniform(0.2, 0.8) * lab.x / lab.top)


def evaporation(lab, rng):
    return lab.x / lab.top * np.maximum(0.0, lab.t / lab.t[-1] - rng.uniform(0.3, 0.65))


def shedding_lock_in(lab, rng):
    middle, width = lab.high * rng.uniform(0.3, 0.75), lab.high * rng.uniform(0.1, 0.18)
    return np.where(np.abs(lab.x - middle) < width, (middle - lab.x) / width, 0.0)


def diverter_timing(lab, rng):
    return lab.x / lab.high / lab.collect


def truncated_temperature(lab, rng):
    return lab.x / lab.high * (lab.water - np.floor(lab.water))


BENCH = {"drunken_thread": "lvdt", "regulator_dropout": "lvdt", "anvil_dust": "lvdt", "stray_light": "photometer", "rinse_carryover": "photometer",
         "cuvette_reversed": "photometer", "evaporation": "photometer", "shedding_lock_in": "flow", "diverter_timing": "flow",
         "truncated_temperature": "flow"}
EFFECTS = {name: globals()[name] for name in BENCH}
PAIRS = [("drunken_thread", "regulator_dropout"), ("drunken_thread", "anvil_dust"), ("stray_light", "cuvette_reversed"),
         ("rinse_carryover", "evaporation"), ("shedding_lock_in", "diverter_timing"), ("diverter_timing", "truncated_temperature")]
ABOUT = {
    "drunken_thread": "The screw of the micrometer (pitch 0.5 mm) is drunken: the true position is off periodically with each turn of the drum, with a weak "
    "second harmonic. Depends on x_mm, period 0.5 mm (and 0.25 mm).",
    "regulator_dropout": "The excitation regulator drops out when the supply falls below a limit: the gain falls with the deficit. Depends on x_mm times how "
    "far supply_V is below a threshold; nothing above it.",
    "anvil_dust": "A chip lies on the anvil from one moment until it is wiped off; it lifts the core by its thickness only where the spindle is below some "
    "position. Depends on time (a window of 40 to 60 % of the run) and x_mm (threshold): constant there.",
    "stray_light": "Stray light of the monochromator: high absorbances read too low, more than quadratically (logarithm of transmission plus a constant). "
    "Depends on c_mgL: smooth downward curvature.",
    "rinse_carryover": "Cuvettes are not rinsed: a fixed part of what was last in the same cuvette stays. Depends on the difference between the last "
    "concentration in the same cuvette and this one (history of c_mgL by cuvette; the row before only if it was the same cuvette).",
    "cuvette_reversed": "From some time on one cuvette is put in the wrong way round: offset and a gain for this cuvette only, only after that time. Depends "
    "on cuvette, time (step) and somewhat on c_mgL.",
    "evaporation": "The lids of the standards are left open from some time on: solvent evaporates and the concentrations rise in proportion to the time "
    "since. Depends on c_mgL times the time after a moment (a drift of gain with a kink).",
    "shedding_lock_in": "Vortices from a strut upstream lock to a resonance of the pipe: near one flow the rotor frequency is pulled towards that of the "
    "resonance. Depends on q_Lmin in a band about one flow: jump up, linear fall through zero, jump back.",
    "diverter_timing": "The diverter switches late by a fixed time, which counts as flow: the error of the reference is a constant time over the collection "
    "time. Depends on q_Lmin divided by collect_s.",
    "truncated_temperature": "The rig's program cuts the water temperature to whole degrees before it corrects for viscosity and density: the correction is "
    "off by the fraction of a degree. Depends on q_Lmin times the sawtooth of water_degC with period 1 degree.",
}
NOISES = {"white": c.white, "heavy": c.heavy, "level": c.with_level, "quantised": c.quantised, "ar1": c.ar1, "sessions": c.sessions,
          "skewed": c.skewed, "bursts": c.bursts, "walk": c.walk}


def laboratory(effects, seed):
    names = {BENCH[e] for e in effects}
    if len(names) > 1:
        raise ValueError("these effects are of different benches")
    bench = names.pop() if names else sorted(BENCHES)[int(seed) % 3]
    return BENCHES[bench](c.stream("general", seed, bench))


def table(effects, seed, size, noise):
    lab = laboratory(effects, seed)
    parts, sizes = c.scaled(EFFECTS, effects, lab, "general", seed, lab.design, lab.sigma, size, np.array([lab.sigma]))
    total = sum(parts.values(), np.zeros((lab.n, 1)))[:, 0]
    y = lab.y + total + lab.sigma * NOISES[noise](c.stream("general", seed, "noise", noise), lab.level, lab.session)
    if noise == "quantised":
        y = np.round(y / (c.QUANTUM * lab.sigma)) * c.QUANTUM * lab.sigma
    csv = c.text(lab.header, lab.columns + [y], lab.decimals + [c.digits(lab.sigma)])
    return csv, list(lab.options), total, lab.sigma, {k: v[:, 0] for k, v in parts.items()}, sizes
