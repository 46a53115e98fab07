"""Eight laboratories: flow, force, optics, mass, electricity, humidity, length, torque; with air, clock and people."""

from types import SimpleNamespace as World

import numpy as np

from .common import NOISES, Array, Causes, Lab, Output, Random, chance, last_side, memory, walk

__all__ = ["ABOUT", "EFFECTS", "NOISES", "PAIRS", "laboratory"]
# stimulus, from, to, supply, its settings, response, sensitivity
LABS = (
    ("flow_l_min", 2, 60, "coil_V", (6, 9, 12), "meter_mV", 14.0),
    ("load_kN", 0, 200, "bridge_V", (2.5, 5, 10), "cell_uV", 75.0),
    ("power_uW", 5, 800, "bias_V", (3, 5, 9), "photo_nA", 430.0),
    ("mass_g", 0, 2000, "coil_V", (4, 6, 8), "balance_mV", 1.6),
    ("current_A", 1, 100, "supply_V", (5, 12, 15), "shunt_mV", 0.75),
    ("vapour_hPa", 1, 22, "feed_V", (5, 8, 12), "film_pF", 3.1),
    ("length_mm", 0, 50, "drive_V", (2, 3, 5), "gauge_mV", 42.0),
    ("torque_Nm", 0, 500, "bridge_V", (2.5, 5, 10), "shaft_uV", 27.0),
)


def settings(g: Random, n: int) -> Array:
    """The stimulus as a part of its range."""
    style = str(g.choice(["anywhere", "mixed", "up and down"]))
    if style == "anywhere":
        return g.random(n)
    grid = np.linspace(0, 1, int(g.integers(17, 25)))
    tours = [g.permutation(grid) if style == "mixed" else grid[:: (-1) ** k] for k in range(-(-n // len(grid)))]
    return np.clip(np.concatenate(tours)[:n] + g.normal(0, 0.006, n), 0, 1)


def dew_point(celsius: Array, percent: Array) -> Array:
    """Magnus' formula."""
    m = np.log(percent / 100) + 17.62 * celsius / (243.12 + celsius)
    return 243.12 * m / (17.62 - m)


def surroundings(g: Random, t: Array, usual: float) -> dict[str, Array]:
    """What is recorded of the room, as it is recorded."""
    n = len(t)
    room = g.uniform(19, 24) + g.uniform(0.4, 1) * np.sin(2 * np.pi * (t / 86400 + g.random()))
    room = np.round(room + g.uniform(0.4, 0.8) * walk(g, t, usual * g.uniform(5, 20)), 2)
    wet = np.round(g.uniform(35, 60) + 5 * walk(g, t, usual * g.uniform(5, 15)), 1)
    baro = np.round(g.uniform(985, 1020) + 6 * walk(g, t, 3600 * g.uniform(2, 6)), 1)
    dew = dew_point(room, wet)
    coolant = np.median(dew) + g.uniform(-0.5, 1) + g.uniform(1, 1.8) * walk(g, t, usual * g.uniform(1, 5))
    fan = walk(g, t, usual * g.uniform(2, 6)) > g.uniform(-0.5, 0.5)
    air = 0.12 + 0.08 * g.random(n) + fan * g.uniform(0.3, 0.6) * g.uniform(0.6, 1.4, n)
    shake = g.uniform(0.2, 0.6) * np.exp(0.8 * walk(g, t, usual * g.uniform(1, 4)))
    coolant, air, shake = np.round(coolant, 2), np.round(air, 2), np.round(shake, 3)
    return {"room": room, "wet": wet, "baro": baro, "dew": dew, "coolant": coolant, "air": air, "shake": shake}


def laboratory(seed: int) -> Lab:
    """A laboratory and all that its causes need to know of it."""
    g = chance("general", seed, "laboratory")
    x_name, low, high, u_name, levels, y_name, sensitivity = LABS[int(g.integers(len(LABS)))]
    runs = int(g.integers(1, 6))
    n = runs * (int(g.integers(95, 300)) // (runs + 1) + 20)
    run = np.arange(n) * runs // n
    opens = np.diff(run, prepend=-1) > 0
    digits = 4 if high < 100 else 2
    x = np.round(low + (high - low) * settings(g, n), digits)
    u = np.repeat(g.choice(levels, n), int(g.integers(1, 4)))[:n]
    gaps = g.uniform(80, 300) * g.uniform(0.7, 1.4, n)
    usual = float(np.median(gaps))
    gaps[opens] += 3600 * g.uniform(1, 14, runs)
    t = np.round(np.cumsum(gaps))
    around = surroundings(g, t, usual)
    port = g.integers(0, 4, n)
    reset = opens | (g.random(n) < 1 / g.uniform(9, 18))
    zeroed = t[np.maximum.accumulate(np.where(reset, np.arange(n), 0))] - usual * 0.3
    age = np.round((t - zeroed) / 60, 1)
    block = np.cumsum(opens | (np.arange(n) % int(g.integers(6, 12)) == 0)) - 1
    roles = str(g.choice(["none", "runs", "blocks"])) if runs > 1 else str(g.choice(["none", "blocks"]))
    span = sensitivity * (high - low)
    gain = sensitivity * g.uniform(0.94, 1.06) * g.choice([-1, 1])
    sd = span * float(g.choice([3e-4, 1e-3, 2e-3]))
    declared = span * g.normal(0, 0.05) + gain * x
    terms = [np.ones(n), x]
    if g.random() < 0.4:
        declared = declared + span * g.uniform(-0.05, 0.05) * u / max(levels)
        terms.append(u)
    clock, unit, places = [("t_s", 1, 0), ("time_min", 60, 2), ("elapsed_h", 3600, 4)][int(g.integers(3))]
    beside = {
        str(g.choice(["room_degC", "air_degC"])): [f"{v:.2f}" for v in around["room"]],
        str(g.choice(["humidity_pct", "rh_pct"])): [f"{v:.1f}" for v in around["wet"]],
        str(g.choice(["baro_hPa", "barometer_hPa"])): [f"{v:.1f}" for v in around["baro"]],
        str(g.choice(["coolant_degC", "plate_degC"])): [f"{v:.2f}" for v in around["coolant"]],
        str(g.choice(["air_m_s", "draught_m_s"])): [f"{v:.2f}" for v in around["air"]],
        str(g.choice(["shake_mm_s", "vibration_mm_s"])): [f"{v:.3f}" for v in around["shake"]],
        str(g.choice(["since_zero_min", "zero_age_min"])): [f"{v:.1f}" for v in age],
        str(g.choice(["port", "connector", "channel"])): ["ABCD"[k] for k in port],
        u_name: [f"{v:g}" for v in u],
    }
    if g.random() < 0.4:
        beside["operator"] = [("Ada", "Ben", "Cleo")[k] for k in g.integers(0, 3, n)]
    options = ["--response", y_name, "--formula", f"1 + {x_name}" + f" + {u_name}" * (len(terms) > 2), "--time", clock]
    columns, shift = {}, np.zeros(n)
    if roles != "none":
        option, names, label = {
            "runs": ("--replicate", ["day", "run", "session"], run),
            "blocks": ("--whole-plot", ["setup", "mounting", "fixture"], block),
        }[roles]
        name = str(g.choice(names))
        options += [option, name]
        columns[name] = [str(k + 1) for k in label]
    if roles == "runs":
        shift = g.choice([0, 0.5]) * sd * g.standard_normal(runs)[run]
    columns |= {clock: [f"{v / unit:.{places}f}" for v in t], x_name: [f"{v:.{digits}f}" for v in x]}
    columns |= {k: beside[k] for k in g.permutation(list(beside))}
    part, swing, sense = (x - low) / (high - low), gain * x / span, np.sign(gain)
    recorded = {"t": t, "usual": usual, "u": u, "port": port, "age": age, "roles": roles, "run": run}
    world = World(part=part, swing=swing, sense=sense, **recorded, **around)
    lab = Lab(
        columns, [Output(y_name, declared, sd, gain, shift)], np.column_stack(terms), np.zeros(n), t, world, options
    )
    if roles == "blocks":
        lab.block, lab.share = block, float(g.uniform(0.04, 0.12))
    return lab


EFFECTS = Causes()


@EFFECTS(both=True)
def fan_blows(w: World, o: Output, g: Random, own: Random) -> Array:
    """Everyday. The draught of the ventilation presses on pan, lever or tube with its dynamic pressure. Depends on
    the air's speed, by its square. Matters while the fan is on.
    """
    return w.air**2


@EFFECTS()
def diode_in_the_supply(w: World, o: Output, g: Random, own: Random) -> Array:
    """Everyday. A diode against wrong polarity takes the same part of a volt from each supply, and the read-out
    divides by the nominal supply. Depends on the stimulus divided by the supply. Matters at low supply and large
    stimulus.
    """
    return -w.swing / w.u


@EFFECTS()
def bad_port(w: World, o: Output, g: Random, own: Random) -> Array:
    """Everyday. One of the four ports has a bad contact, or leaks: there a part of the signal is lost. Depends on the
    port (one against three) times the stimulus. Matters at that port, at large stimulus.
    """
    return -w.swing * (w.port == g.integers(4))


@EFFECTS()
def eccentric_dial(w: World, o: Output, g: Random, own: Random) -> Array:
    """Everyday. The stimulus is set by a dial (screw, potentiometer, valve) of some turns that is not centred.
    Depends on the stimulus: a sine with three to six and a half periods in its range, and a little of the double.
    Matters always.
    """
    turn = 2 * np.pi * (g.uniform(3, 6.5) * w.part + g.random())
    return np.sin(turn) + g.uniform(0, 0.3) * np.sin(2 * turn + g.uniform(0, 6))


@EFFECTS(both=True)
def zero_grows_old(w: World, o: Output, g: Random, own: Random) -> Array:
    """Everyday. The zero is set now and then, and runs away after it, first fast, then slower. Depends on the time
    since it was set (recorded), and not on the time of day. Matters long after a zero.
    """
    return -np.expm1(-w.age / (np.quantile(w.age, 0.8) * g.uniform(0.4, 1.5)))


@EFFECTS()
def shaking_frees_it(w: World, o: Output, g: Random, own: Random) -> Array:
    """Unlisted. Friction in the linkage keeps the reading behind the stimulus, but vibration of the floor frees it.
    Depends on the direction of the last change of the stimulus (not its size) times a falling exponential of the
    vibration. Matters when the floor is quiet.
    """
    side = last_side(np.diff(w.part, prepend=-1.0), 0.01, 1.0)
    return -w.sense * side * np.exp(-w.shake / (np.median(w.shake) * g.uniform(0.4, 1.2)))


@EFFECTS()
def dew_on_the_cold_side(w: World, o: Output, g: Random, own: Random) -> Array:
    """Unlisted. Where the coolant goes in, water condenses when it is colder than the dew point, and the film takes
    away signal (leakage, absorbed light, weight). Depends on humidity, the room's temperature and the coolant's
    together: the dew point less the coolant, nothing below zero; a row or so late. Matters in wet air with cold
    coolant.
    """
    return -w.sense * memory(np.maximum(w.dew - w.coolant, 0), w.t, w.usual * g.uniform(0.3, 0.9), 0.0)


@EFFECTS(both=True)
def air_weighs(w: World, o: Output, g: Random, own: Random) -> Array:
    """Unlisted. The air's density is taken as constant: buoyancy of weights, index of refraction, permittivity, mass
    of a volume. Depends on the stimulus times air pressure divided by absolute room temperature, and a little on
    humidity. Matters when the weather changes, at large stimulus.
    """
    vapour = w.wet / 100 * 6.112 * np.exp(17.62 * w.room / (243.12 + w.room))
    return w.swing * ((w.baro - 0.378 * vapour) / (w.room + 273.15) / 3.456 - 1)


ABOUT = EFFECTS.about()
PAIRS = [("fan_blows", "bad_port"), ("diode_in_the_supply", "shaking_frees_it"), ("eccentric_dial", "air_weighs")]
