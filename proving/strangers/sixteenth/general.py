"""Transducers of any kind, with the weather of the room, the mains, people and a clock beside them."""

import numpy as np

from .common import NOISES, Lab, Output, Register, World, chance, make, ramped, softened, walk

NUMBER = 3
__all__ = ["ABOUT", "EFFECTS", "NOISES", "PAIRS", "table"]

# stimulus, from, to, supply, its settings, response, sensitivity
INSTRUMENTS = (
    ("height_mm", 0, 40, "drive_V", (1, 2, 3, 5), "lvdt_mV", 52.0),
    ("force_N", 0, 500, "bridge_V", (2.5, 5, 10), "cell_mV", 0.04),
    ("level_cm", 5, 180, "loop_V", (12, 18, 24), "level_mA", 0.09),
    ("tilt_deg", 0, 35, "feed_V", (3, 4, 5), "tilt_mV", 31.0),
    ("light_lx", 10, 2000, "bias_V", (1, 5, 9), "diode_uA", 0.02),
    ("gap_um", 100, 1500, "drive_V", (2, 6, 10), "probe_mV", 3.2),
    ("turns_rpm", 50, 3000, "supply_V", (5, 9, 12), "tacho_mV", 2.1),
)
NAMES = ("Aiko", "Bruno", "Chidi", "Dora", "Elif", "Farid", "Greta", "Hugo", "Ines")


def settings(g, n, low, high):
    style = str(g.choice(["anywhere", "shuffled", "up and down"]))
    if style == "anywhere":
        return g.uniform(low, high, n)
    grid = np.linspace(low, high, int(g.integers(14, 22)))
    tours = -(-n // len(grid))
    if style == "shuffled":
        x = np.concatenate([g.permutation(grid) for _ in range(tours)])
    else:
        x = np.concatenate([grid[:: 1 - 2 * (k % 2)] for k in range(tours)])
    return (x[:n] + (high - low) * g.normal(0, 0.005, n)).clip(low, high)


def laboratory(seed):
    g = chance(NUMBER, seed, 0)
    x_name, low, high, u_name, u_levels, y_name, sensitivity = INSTRUMENTS[int(g.integers(len(INSTRUMENTS)))]
    runs = 1 + int(g.choice(5, p=[0.25, 0.15, 0.2, 0.2, 0.2]))
    length = int(g.integers(*((100, 170), (60, 130), (40, 100), (36, 90), (32, 78))[runs - 1]))
    n = runs * length
    run = np.arange(n) // length
    opens = np.arange(n) % length == 0
    digits = 4 if high <= 40 else 3 if high <= 500 else 2
    x = np.round(settings(g, n, low, high), digits)
    u = np.repeat(g.choice(u_levels, n), int(g.integers(1, 5)))[:n].astype(float)
    gaps = g.uniform(110, 320) * g.uniform(0.75, 1.4, n)
    gaps[opens] += 3600 * g.uniform(1.5, 10.0, runs)
    t = np.round(np.cumsum(gaps))
    usual = float(np.median(np.diff(t)))
    hour = t / 3600 + g.uniform(0, 24)
    room = g.uniform(19.5, 24.5) + g.uniform(0.4, 1.1) * np.sin(np.pi * hour / 12)
    room = room + g.uniform(0.5, 0.9) * walk(g, t, usual * g.uniform(6, 18))
    humidity = g.uniform(35, 55) + 5 * walk(g, t, usual * g.uniform(4, 14))
    baro = g.uniform(980, 1020) + 6 * walk(g, t, 3600 * g.uniform(4, 9)) + 0.05 * g.standard_normal(n)
    mains = g.uniform(228, 233) + g.uniform(1.5, 2.5) * mixture(g, t, usual)
    team = g.permutation(NAMES)[: int(g.integers(3, 5))]
    ends = np.cumsum(g.integers(5, 14, n))
    who = np.searchsorted(ends, np.arange(n), side="right") % len(team)
    cable = g.integers(0, 3, n)
    piece = int(g.integers(6, 13))
    block = np.cumsum(opens | (np.arange(n) % length % piece == 0)) - 1
    way = str(g.choice(["none", "runs", "blocks"]))
    if way == "runs" and runs == 1:
        way = "blocks"
    span = sensitivity * (high - low)
    sd = span * float(g.choice([3e-4, 1e-3, 2.5e-3]))
    gain = sensitivity * g.uniform(0.93, 1.07) * g.choice([1.0, -1.0])
    with_supply = bool(g.random() < 0.4)
    declared = span * g.normal(0, 0.04) + gain * x
    if with_supply:
        declared = declared + span * g.uniform(-0.08, 0.08) * u / max(u_levels)
    clock, unit, form = [("t_s", 1, "%d"), ("time_min", 60, "%.2f"), ("elapsed_h", 3600, "%.4f")][int(g.integers(3))]
    beside = [
        (str(g.choice(["room_degC", "ambient_degC", "lab_degC"])), ["%.2f" % v for v in room]),
        (str(g.choice(["humidity_pct", "rh_pct"])), ["%.1f" % v for v in humidity]),
        (str(g.choice(["baro_hPa", "air_hPa"])), ["%.1f" % v for v in baro]),
        (str(g.choice(["mains_V", "line_V"])), ["%.1f" % v for v in mains]),
        (str(g.choice(["operator", "reader", "person"])), [str(team[k]) for k in who]),
        (u_name, ["%g" % v for v in u]),
    ]
    if g.random() < 0.5:
        beside.append(("cable", ["ABC"[k] for k in cable]))
    if g.random() < 0.4:
        beside.append(("pause_s", ["%d" % v for v in g.integers(5, 90, n)]))
    columns = [(clock, [form % (v / unit) for v in t]), (x_name, ["%.*f" % (digits, v) for v in x])]
    columns += [beside[k] for k in g.permutation(len(beside))]
    options = ["--response", y_name, "--formula", "1 + " + x_name + with_supply * (" + " + u_name), "--time", clock]
    shift = np.zeros(n)
    if way == "runs":
        label = str(g.choice(["day", "run", "session"]))
        columns = [(label, ["%d" % k for k in run + 1]), *columns]
        options += ["--replicate", label]
        shift = g.choice([0.0, 0.5]) * sd * g.standard_normal(runs)[run]
    elif way == "blocks":
        label = str(g.choice(["setup", "fixture", "mount"]))
        columns = [(label, ["%d" % k for k in block + 1]), *columns]
        options += ["--whole-plot", label]
    world = World(
        n=n, t=t, usual=usual, opens=opens, x=x, part=(x - low) / (high - low), sense=np.sign(gain), room=room,
        humidity=humidity, baro=baro, mains=mains, who=who, team=len(team), declared=declared, swing=gain * x / span,
        way=way, run=run,
    )  # fmt: skip
    model = np.column_stack([np.ones(n), x, u] if with_supply else [np.ones(n), x])
    share = float(g.uniform(0.2, 0.35)) if way == "blocks" else 0.0
    return Lab(columns, [Output(y_name, declared, sd, shift)], model, np.zeros(n), t, world, options, block, share)


def mixture(g, t, usual):
    """Of unit variance: a half from row to row, a half slower."""
    return (g.standard_normal(len(t)) + walk(g, t, usual * g.uniform(3, 8))) / np.sqrt(2)


EFFECTS = Register()


@EFFECTS(
    "Everyday. The amplifier comes near the end of its output and gives less and less. Depends on the stimulus (first"
    " term of the formula): straight up to 65 to 82 % of its range, then bent down. Matters at the high end.",
)
def near_the_rail(w, g, j):
    return -w.sense * softened(w.part - g.uniform(0.65, 0.82), g.uniform(0.01, 0.04))


@EFFECTS(
    "Everyday. A needle is read, and each person's eye is at another height (parallax). Depends on the person: an"
    " offset for each. Matters always.",
)
def eye_height(w, g, j):
    eyes = g.permutation(np.linspace(-1, 1, w.team)) + g.uniform(-0.25, 0.25, w.team)
    return eyes[w.who]


@EFFECTS(
    "Everyday. The feedback resistor of the amplifier has a coefficient of temperature: the span goes with the room, a"
    " few minutes late. Depends on the room's temperature times the stimulus. Matters at large stimulus.",
    both=True,
)
def warm_resistor(w, g, j):
    return w.swing * (ramped(w.room, w.t, w.usual * g.uniform(0.3, 1.0)) - 22.0)


@EFFECTS(
    "Everyday. The adhesive under the sensing element takes up water from the air and swells, slowly. Depends on the"
    " humidity of the last rows (a lag of 3 to 8 rows in real time). Matters when the weather changes.",
    both=True,
)
def adhesive_swells(w, g, j):
    return ramped(w.humidity, w.t, w.usual * g.uniform(3.0, 8.0)) - 45.0


@EFFECTS(
    "Everyday. The read-out runs on a battery without a good regulator. Its voltage falls at first, then slowly, and"
    " fast at the end; it is off between runs. The response falls in proportion. Depends on time in use times the"
    " stimulus. Matters in the last tenth of the use, and at large stimulus.",
)
def battery_runs_down(w, g, j):
    use = np.cumsum(np.where(w.opens, w.usual, np.diff(w.t, prepend=0.0)))
    used = use / use[-1] * g.uniform(0.93, 1.02)
    fall = 0.12 * -np.expm1(-used / 0.04) + 0.3 * used + np.exp((used - 1.0) / g.uniform(0.05, 0.1))
    return -w.swing * fall


@EFFECTS(
    "Unlisted. The supply's regulator needs some volts to work with. When the mains is low it drops out, and the span"
    " falls with the mains. Depends on the mains' voltage below a threshold (a bend near the lower third or the middle"
    " of what it had) times the stimulus. Matters when the mains is low, and at large stimulus.",
)
def regulator_drops_out(w, g, j):
    enough = np.quantile(w.mains, g.uniform(0.35, 0.55))
    return -w.swing * np.maximum(enough - w.mains, 0.0)


@EFFECTS(
    "Unlisted. The can of the sensor is sealed with air in it. It bulges with the difference between the pressure of"
    " its own air, which goes with absolute temperature (3.4 hPa for a degree), and that of the barometer. Depends on"
    " air pressure and on the room's temperature (a little late), with opposite signs. Matters when the weather or the"
    " room changes.",
    both=True,
)
def sealed_can(w, g, j):
    inside = ramped(w.room, w.t, w.usual * g.uniform(0.3, 1.0)) + 273.15
    return 1000.0 * inside / 295.15 - w.baro


@EFFECTS(
    "Unlisted. One of the higher bits of the converter has a wrong weight. Depends on the response, and so on the"
    " stimulus (and the supply if it is in the formula): a square wave with two or four periods in the converter's full"
    " scale, of which 70 to 95 % are used. Matters always.",
    both=True,
)
def heavy_bit(w, g, j):
    used = g.uniform(0.7, 0.95)
    bottom, width = w.declared.min(), np.ptp(w.declared) / used
    code = (w.declared - bottom) / width + g.uniform(0.02, 0.98) * (1 - used)
    return np.floor(code * g.choice([4, 8])) % 2


ABOUT = EFFECTS.about
PAIRS = [("near_the_rail", "adhesive_swells"), ("battery_runs_down", "heavy_bit"), ("eye_height", "sealed_can")]


def table(effects, seed, size, noise="white"):
    return make(NUMBER, laboratory(seed), EFFECTS, effects, seed, size, noise)
