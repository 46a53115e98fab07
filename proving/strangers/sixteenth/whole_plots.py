"""Pressure transducers and their electronics in two chambers, whose temperatures stay for a whole plot."""

import numpy as np

from .common import NOISES, Lab, Output, Register, World, chance, make, softened

NUMBER = 2
BOLTZMANN = 8.617e-5  # eV/K
__all__ = ["ABOUT", "EFFECTS", "NOISES", "PAIRS", "table"]

# degC: the transducers from, to; their electronics from, to
CHAMBERS = ((-150, 20, -20, 40), (-60, 70, -10, 50), (-40, 95, -30, 55), (10, 130, 10, 65), (-100, 60, 0, 40))


def temperatures(g, low, high, plots):
    if g.random() < 0.4:  # all different
        cells = (np.arange(plots) + g.uniform(0.1, 0.9, plots)) / plots
        return low + (high - low) * g.permutation(cells)
    few = np.linspace(low, high, int(g.integers(4, 7)))
    rounds = [g.permutation(few) for _ in range(-(-plots // len(few)))]
    return np.concatenate(rounds)[:plots]


def pressures(g, style, grid):
    if style == "drawn":
        return g.permutation(grid)
    if style == "there and back":
        return np.concatenate([grid[::2], grid[1::2][::-1]])
    return np.roll(grid, int(g.integers(len(grid))))  # rising from a drawn start, once over the end


def laboratory(seed):
    g = chance(NUMBER, seed, 0)
    plots = int(g.integers(6, 21))
    per = int(g.integers(11 if plots < 9 else 8, 16))
    n = plots * per
    plot = np.arange(n) // per
    done = np.arange(n) % per / per
    top = float(g.choice([20.0, 45.0, 80.0, 150.0, 300.0]))
    low = top * g.uniform(0.05, 0.12)
    grid = np.linspace(low, top, per) if g.random() < 0.65 else np.geomspace(low, top, per)
    style = str(g.choice(["drawn", "drawn", "there and back", "from the middle"]))
    decimals = 4 if top < 50 else 3
    p = np.concatenate([pressures(g, style, grid) for _ in range(plots)])
    p = np.round(p * (1 + g.normal(0, 0.001, n)), decimals)
    gaps = g.uniform(100, 220) * g.uniform(0.75, 1.35, n)
    gaps[::per] += g.uniform(2000, 5500, plots)
    t = np.round(np.cumsum(gaps))
    c = CHAMBERS[int(g.integers(len(CHAMBERS)))]
    s = temperatures(g, c[0], c[1], plots)[plot] + g.normal(0, 0.15, plots)[plot] * done + g.normal(0, 0.03, n)
    e = temperatures(g, c[2], c[3], plots)[plot] + g.normal(0, 0.1, plots)[plot] * done + g.normal(0, 0.03, n)
    s, e = np.round(s, 2), np.round(e, 2)
    a, b, d = ((v - v.mean()) / v.std() for v in (p, s, e))
    model = np.column_stack([np.ones(n), a, b, d, a * a, a * b, a * d, b * b, b * d, d * d])
    bridges = int(g.integers(1, 4))
    full = float(g.choice([15.0, 30.0, 60.0, 120.0]))
    sd = full * float(g.choice([1.5e-4, 4e-4, 1e-3]))
    outputs, slopes = [], []
    for j in range(bridges):
        k = g.normal(0, 1, 10) * ([0.03, 0.0] + [0.012] * 2 + [0.003] * 6)
        k[0] += 0.5
        k[1] = g.uniform(0.22, 0.3)
        label = "bridge_mV" if bridges == 1 else "bridge_%d_mV" % (j + 1)
        outputs.append(Output(label, full * (model @ k), sd * (1.0 if j == 0 else g.uniform(0.75, 1.35))))
        slopes.append(full * k[1] / p.std())
    columns = [
        ("whole_plot", ["%d" % k for k in plot + 1]),
        ("order", ["%d" % k for k in range(1, n + 1)]),
        ("elapsed_s", ["%d" % v for v in t]),
        ("pressure_psia", ["%.*f" % (decimals, v) for v in p]),
        ("sensor_temperature_degC", ["%.2f" % v for v in s]),
        ("sse_temperature_degC", ["%.2f" % v for v in e]),
    ]
    world = World(
        n=n, plot=plot, opens=np.arange(n) % per == 0, t=t, p=p, s=s, e=e, top=top, low=low, slopes=slopes,
        outputs=[o.declared for o in outputs], usual=float(np.median(np.diff(t))),
    )  # fmt: skip
    return Lab(columns, outputs, model, np.zeros(n), t, world, block=plot, share=float(g.uniform(0.2, 0.4)))


def activated(celsius, ev):
    """How fast a process with an activation energy goes, against the warmest row."""
    k = celsius + 273.15
    return np.exp(-ev / BOLTZMANN * (1 / k - 1 / k.max()))


EFFECTS = Register()


@EFFECTS(
    "Everyday. The insulation of the sensor's cable is damp and leaks when it is warm: a shunt across the bridge, which"
    " takes away a part of its output. Depends on sensor temperature (exponential, e-fold in 15 to 55 K) times"
    " pressure, and the zero output. Matters in the warmest whole plots.",
)
def damp_cable(w, g, j):
    return -w.outputs[j] * activated(w.s, g.uniform(0.25, 0.5))


@EFFECTS(
    "Everyday. The electronics corrects the span for the sensor's temperature, but how much it corrects goes with its"
    " own temperature. Depends on the product of pressure, sensor temperature and SSE temperature. Matters where both"
    " temperatures are far from those of the adjustment.",
    both=True,
)
def correction_shifts(w, g, j):
    sensor, board = w.s - g.uniform(15, 25), w.e - g.uniform(18, 28)
    return w.slopes[j] * w.p * sensor * board


@EFFECTS(
    "Everyday. The common supply of the bridges stands in the hall, which is warm in the afternoon and cold at night:"
    " all outputs follow, in proportion. Depends on time (a day, and a little of half a day) times pressure, and the"
    " zero output. Matters always.",
    bench=True,
    both=True,
)
def day_in_the_hall(w, g, j):
    day = 2 * np.pi * (w.t / 86400 + g.random())
    return w.outputs[j] * (np.sin(day) + g.uniform(0.1, 0.3) * np.sin(2 * day + g.uniform(0, 2 * np.pi)))


@EFFECTS(
    "Everyday. Gas flows to the transducers through a long thin tube, the slower the lower the pressure (viscous flow:"
    " it goes with the difference of the squares). The reading does not wait for it. Depends on the move of pressure"
    " since the row before, on pressure, and on the time between rows. Matters at low pressure after a higher"
    " one.",
    bench=True,
)
def thin_tube(w, g, j):
    speed = g.uniform(1.3, 2.6) / (w.low * w.usual)
    inside, out = w.p[0], np.zeros(w.n)
    for i in range(1, w.n):
        ratio = (inside - w.p[i]) / (inside + w.p[i]) * np.exp(-speed * w.p[i] * (w.t[i] - w.t[i - 1]))
        inside = w.p[i] * (1 + ratio) / (1 - ratio)
        out[i] = inside - w.p[i]
    return w.slopes[j] * out


@EFFECTS(
    "Everyday. The piston of the pressure standard rubs. It sinks under added weights, and friction bears a part of"
    " them: the pressure stays a little low. When weights are taken off it rises, and the pressure stays a little high;"
    " more at higher load. Depends on the direction of the last move of pressure (not on its size), and on pressure."
    " Matters always.",
    bench=True,
)
def piston_rubs(w, g, j):
    side, sides = 1.0, np.empty(w.n)
    for i in range(w.n):
        step = w.p[i] - (w.p[i - 1] if i else 0.0)
        if abs(step) > 0.005 * w.top:
            side = np.sign(step)
        sides[i] = side
    return -w.slopes[j] * sides * (w.p / w.top + g.uniform(0.15, 0.4))


@EFFECTS(
    "Unlisted. The glass that holds the diaphragm slips a little at each change of temperature and stays behind: its"
    " stress is another one after cooling than after warming. Zero and span follow the stress. Depends on the sensor"
    " temperature's change from whole plots before (its direction), constant in a whole plot, with a part times"
    " pressure. Matters for the same temperature from both sides.",
    both=True,
)
def glass_stays_behind(w, g, j):
    slack = np.ptp(w.s) * g.uniform(0.12, 0.25)
    glass, behind = w.s[0] + g.uniform(-1, 1) * slack, np.empty(w.n)
    for i, now in enumerate(w.s):
        glass = np.clip(glass, now - slack, now + slack)
        behind[i] = (glass - now) / slack
    return behind * (g.uniform(0.2, 0.5) + w.p / w.top)


@EFFECTS(
    "Unlisted. The test gas is helium. It seeps through the wall of the vacuum reference, faster when warm, and never"
    " leaves: the reference rises, the output falls. Depends on time: the sum over the run of pressure times an"
    " exponential of sensor temperature. Matters after warm whole plots, and to the end of the run.",
)
def helium_seeps_in(w, g, j):
    flow = w.p * activated(w.s, g.uniform(0.2, 0.35))
    hours = np.where(w.opens, 0.0, np.diff(w.t, prepend=w.t[0])) / 3600
    return -w.slopes[j] * np.cumsum(flow * hours)


@EFFECTS(
    "Unlisted. Too little oil behind the isolating membrane. The cold oil shrinks; then the membrane lies on its seat"
    " at high pressure, and what is more than that is not passed on. Depends on pressure and sensor temperature"
    " together: a bend at a pressure that falls as it gets colder. Matters in cold whole plots at high pressure only.",
)
def oil_too_short(w, g, j):
    warmth = (w.s - w.s.min()) / np.ptp(w.s)
    seat = g.uniform(0.35, 0.5) + g.uniform(0.9, 1.5) * warmth
    return -w.slopes[j] * w.top * softened(w.p / w.top - seat, g.uniform(0.01, 0.03))


ABOUT = EFFECTS.about
PAIRS = [("damp_cable", "piston_rubs"), ("day_in_the_hall", "oil_too_short"), ("thin_tube", "correction_shifts")]


def table(effects, seed, size, noise="white"):
    return make(NUMBER, laboratory(seed), EFFECTS, effects, seed, size, noise)
