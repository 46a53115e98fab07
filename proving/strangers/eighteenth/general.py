"""Eight laboratories: temperature, magnetic field, conductivity, viscosity, speed, dose, sound, wind."""

from types import SimpleNamespace as World

import numpy as np

from .common import NOISES, Array, Causes, Lab, Output, Random, chance, memory, walk

__all__ = ["ABOUT", "EFFECTS", "NOISES", "PAIRS", "laboratory"]
# stimulus, from, to, response, sensitivity
LABS = (
    ("bath_degC", -40, 180, "probe_ohm", 0.385),
    ("field_mT", 5, 800, "hall_mV", 0.11),
    ("conductivity_mS_cm", 0.1, 110, "cell_uA", 45.0),
    ("viscosity_mPa_s", 1, 400, "drag_uNm", 2.3),
    ("speed_rpm", 20, 6000, "tacho_mV", 1.7),
    ("dose_uGy_h", 1, 900, "chamber_fA", 0.35),
    ("sound_Pa", 0.02, 20, "microphone_mV", 48.0),
    ("wind_m_s", 0.5, 40, "vane_Hz", 17.5),
)


def settings(g: Random, n: int) -> Array:
    """The stimulus as a part of its range."""
    style = str(g.choice(["anywhere", "mixed", "levels", "up and down"]))
    if style == "anywhere":
        return g.random(n)
    grid = np.linspace(0, 1, int(g.integers(7, 12) if style == "levels" else g.integers(15, 26)))
    tours = [grid[:: (-1) ** k] if style == "up and down" else g.permutation(grid) for k in range(-(-n // len(grid)))]
    return np.clip(np.concatenate(tours)[:n] + g.normal(0, 0.005, n), 0, 1)


def surroundings(g: Random, t: Array, usual: float) -> dict[str, Array]:
    """What is recorded of the room, as it is recorded."""
    n = len(t)
    day = np.sin(2 * np.pi * (t / 86400 + g.random()))
    room = g.uniform(18, 26) + g.uniform(0.4, 1.2) * day + g.uniform(0.5, 1) * walk(g, t, usual * g.uniform(2, 10))
    wet = g.uniform(28, 48) + g.uniform(5, 8) * walk(g, t, usual * g.uniform(8, 25))
    mains = g.choice([115, 230]) * (1 + 0.012 * walk(g, t, usual * g.uniform(1, 8)) + 0.006 * g.standard_normal(n))
    light = g.uniform(150, 400) + 600 * np.exp(0.6 * walk(g, t, usual * g.uniform(3, 12))) * (0.4 + np.maximum(day, 0))
    busy = walk(g, t, usual * g.uniform(3, 9)) > g.uniform(-0.5, 0.5)
    amps = g.uniform(0.2, 0.6) + busy * g.uniform(3, 12) * g.uniform(0.7, 1.3, n)
    near = np.round(amps, 2)
    return {"room": np.round(room, 2), "wet": np.round(wet, 1), "mains": np.round(mains, 2), "near": near} | {
        "light": np.round(light)
    }


def written(
    g: Random, around: dict[str, Array], room: str, wait: Array, head: Array, person: Array
) -> dict[str, list[str]]:
    """The columns beside stimulus, clock and response; one of them may do nothing at all."""
    beside = {
        room: [f"{v:.2f}" for v in around["room"]],
        str(g.choice(["humidity_pct", "rh_pct"])): [f"{v:.1f}" for v in around["wet"]],
        str(g.choice(["mains_V", "line_V"])): [f"{v:.2f}" for v in around["mains"]],
        str(g.choice(["light_lx", "window_lx"])): [f"{v:.0f}" for v in around["light"]],
        str(g.choice(["neighbour_A", "compressor_A", "furnace_A"])): [f"{v:.2f}" for v in around["near"]],
        str(g.choice(["wait_s", "dwell_s"])): [f"{v:.0f}" for v in wait],
        str(g.choice(["head_deg", "azimuth_deg"])): [f"{v:.0f}" for v in head],
        str(g.choice(["operator", "reader"])): [("Dora", "Emil", "Fay", "Gus")[k] for k in person],
    }
    if g.random() < 0.5:
        beside["specimen"] = ["KLM"[k] for k in g.integers(0, 3, len(wait))]
    return {k: beside[k] for k in map(str, g.permutation(list(beside)))}


def laboratory(seed: int) -> Lab:
    """A laboratory and all that its causes need to know of it."""
    g = chance("general", seed, "laboratory")
    x_name, low, high, y_name, sensitivity = LABS[int(g.integers(len(LABS)))]
    runs = int(g.integers(1, 6))
    n = runs * (int(g.integers(100, 320)) // (runs + 1) + 20)
    run = np.arange(n) * runs // n
    opens = np.diff(run, prepend=-1) > 0
    digits = 4 if high < 150 else 2
    part = settings(g, n)
    x = np.round(low + (high - low) * part, digits)
    part = (x - low) / (high - low)
    wait = np.round(g.uniform(25, 60) * g.uniform(0.6, 3, n))
    gaps = wait + g.uniform(40, 160) * g.uniform(0.8, 1.4, n)
    usual = float(np.median(gaps))
    gaps[opens] += 3600 * g.uniform(1, 16, runs)
    t = np.round(np.cumsum(gaps))
    around = surroundings(g, t, usual)
    head = np.round(g.uniform(0, 360, n) if g.random() < 0.4 else g.integers(0, 8, n) * 45.0, 0)
    person = np.repeat(np.arange(n), g.integers(8, 20, n))[:n] % int(g.integers(2, 5))
    block = np.cumsum(opens | (np.arange(n) % int(g.integers(6, 12)) == 0)) - 1
    roles = str(g.choice(["none", "runs", "blocks"])) if runs > 1 else str(g.choice(["none", "blocks"]))
    span = sensitivity * (high - low)
    gain = sensitivity * g.uniform(0.94, 1.06) * float(g.choice([-1, 1]))
    sd = span * float(g.choice([3e-4, 1e-3, 2e-3]))
    declared = span * g.normal(0, 0.05) + gain * x
    terms = [np.ones(n), x]
    room_name = str(g.choice(["room_degC", "lab_degC", "ambient_degC"]))
    formula = f"1 + {x_name}"
    if g.random() < 0.3:
        declared = declared + 2 * sd * g.uniform(-1, 1) * (around["room"] - 20)
        terms.append(around["room"])
        formula += f" + {room_name}"
    clock, unit, places = [("elapsed_s", 1, 0), ("t_min", 60, 2), ("time_h", 3600, 4)][int(g.integers(3))]
    options = ["--response", y_name, "--formula", formula, "--time", clock]
    columns, shift = {}, np.zeros(n)
    if roles != "none":
        option, names, label = {
            "runs": ("--replicate", ["series", "night", "repeat"], run),
            "blocks": ("--whole-plot", ["filling", "insertion", "alignment"], block),
        }[roles]
        name = str(g.choice(names))
        options += [option, name]
        columns[name] = [str(k + 1) for k in label]
    if roles == "runs":
        shift = float(g.choice([0, 0.5])) * sd * g.standard_normal(runs)[run]
    columns |= {clock: [f"{v / unit:.{places}f}" for v in t], x_name: [f"{v:.{digits}f}" for v in x]}
    columns |= written(g, around, room_name, wait, head, person)
    recorded = {"t": t, "gaps": gaps, "wait": wait, "head": head, "person": person, "usual": usual}
    world = World(part=part, sense=np.sign(gain), run=run, roles=roles, **recorded, **around)
    out = Output(y_name, declared, sd, gain, shift)
    lab = Lab(columns, [out], np.column_stack(terms), np.zeros(n), t, world, options)
    if roles == "blocks":
        lab.block, lab.share = block, float(g.uniform(0.04, 0.12))
    return lab


EFFECTS = Causes()


@EFFECTS()
def read_too_soon(w: World, o: Output, g: Random, own: Random) -> Array:
    """Everyday. The instrument is read before it has come to rest after a new setting. Depends on the change of the
    stimulus before the reading, and on how long one waited (recorded): a decay. Matters after large changes and short
    waits.
    """
    tau = float(np.median(w.wait)) * g.uniform(0.35, 0.8)
    behind, carried = np.zeros_like(w.part), 0.0
    for i, step in enumerate(np.diff(w.part, prepend=0.0)):
        behind[i] = (carried * np.exp((w.wait[i] - w.gaps[i]) / tau) - step) * np.exp(-w.wait[i] / tau)
        carried = behind[i]
    return w.sense * behind


@EFFECTS(both=True)
def room_arrives_late(w: World, o: Output, g: Random, own: Random) -> Array:
    """Everyday. The zero goes with the temperature inside the instrument, which follows the room's after 2 to 8 rows.
    Depends on room temperature and its past. Matters when the room is far from its mean for long.
    """
    return memory(w.room, w.t, w.usual * g.uniform(2, 8)) - w.room.mean()


@EFFECTS(both=True)
def neighbour_draws(w: World, o: Output, g: Random, own: Random) -> Array:
    """Everyday. A neighbouring machine has the same earth wire: its current times the wire's resistance is added to
    the reading. Depends on the neighbour's current, in proportion. Matters while the machine runs.
    """
    return w.near


@EFFECTS(both=True)
def person_reads_askew(w: World, o: Output, g: Random, own: Random) -> Array:
    """Everyday. One of the persons looks at the pointer from the side, or aligns it in another way: an offset. Depends
    on who reads (one against the others). Matters always.
    """
    return (w.person == g.integers(w.person.max() + 1)) * 1.0


@EFFECTS()
def reading_bends(w: World, o: Output, g: Random, own: Random) -> Array:
    """Everyday. The detector saturates (dead time, load of the source, leakage of flux): x / (1 + k x). Depends on the
    stimulus: less and less than in proportion. Matters at the ends and the middle, as the line takes up most of it.
    """
    return w.sense * w.part / (1 + g.uniform(0.1, 0.8) * w.part)


@EFFECTS()
def sun_through_the_window(w: World, o: Output, g: Random, own: Random) -> Array:
    """Unlisted. Light from the window falls into the housing and adds to the signal of a junction inside, when the
    head is turned to it. Depends on light times the cosine of the head's angle to the window, nothing if it looks
    away. Matters in bright light and one half of a turn.
    """
    return w.sense * w.light * np.maximum(np.cos(np.radians(w.head - g.uniform(0, 360))), 0)


@EFFECTS()
def regulator_drops_out(w: World, o: Output, g: Random, own: Random) -> Array:
    """Unlisted. When the mains voltage is low, the regulator of the supply has too little, and the sensitivity falls.
    Depends on mains voltage (below a threshold, in proportion; nothing above) times the stimulus. Matters at low mains
    and large stimulus.
    """
    return -w.sense * w.part * np.maximum(np.quantile(w.mains, g.uniform(0.35, 0.6)) - w.mains, 0)


@EFFECTS(both=True)
def charge_stays_in_dry_air(w: World, o: Output, g: Random, own: Random) -> Array:
    """Unlisted. Each handling rubs some charge on the plastic window, which pulls at the moving part or adds to the
    current. In humid air it leaks away soon, in dry air (exponentially) later. Depends on humidity, and on the time
    between rows: a sum with a memory of a row to many. Matters in dry air and after many rows.
    """
    fade = np.exp(-np.diff(w.t) / (w.usual * g.uniform(0.8, 2) * np.exp((np.median(w.wet) - w.wet[1:]) / 6)))
    charge = np.ones_like(w.part)
    for i, f in enumerate(fade, 1):
        charge[i] += f * charge[i - 1]
    return charge


ABOUT = EFFECTS.about()
PAIRS = [
    ("read_too_soon", "regulator_drops_out"),
    ("neighbour_draws", "reading_bends"),
    ("person_reads_askew", "sun_through_the_window"),
]
