"""Pressure transducers in one chamber, their electronics in another; each whole plot has its temperatures."""

from types import SimpleNamespace as World

import numpy as np

from .common import NOISES, Array, Causes, Lab, Output, Random, chance, last_side, memory

__all__ = ["ABOUT", "EFFECTS", "NOISES", "PAIRS", "laboratory"]
# degC: transducers from, to; electronics from, to
CHAMBERS = ((-120, 25, -10, 45), (-55, 85, -20, 60), (-40, 120, 0, 50), (-80, 60, -15, 40), (-20, 70, 5, 45))


def temperatures(g: Random, low: float, high: float, plots: int) -> Array:
    """All different, or some levels in random order, again and again."""
    many = plots if g.random() < 0.4 else int(g.integers(5, 8))
    levels = np.linspace(low, high, many) + (high - low) * g.uniform(-0.02, 0.02, many)
    return np.concatenate([g.permutation(levels) for _ in range(-(-plots // many))])[:plots]


def pressures(g: Random, style: str, grid: Array) -> Array:
    """The pressures of one whole plot, in their order."""
    if style == "random":
        return g.permutation(grid)
    if style == "up and down":
        return np.concatenate([grid[::2], grid[1::2][::-1]])
    return np.roll(grid, int(g.integers(len(grid))))  # up, from anywhere


def laboratory(seed: int) -> Lab:
    """A laboratory and all that its causes need to know of it."""
    g = chance("whole_plots", seed, "laboratory")
    plots = int(g.integers(6, 21))
    per = int(g.integers(9 if plots > 8 else 12, 16))
    n = plots * per
    plot = np.arange(n) // per
    top = float(g.choice([15, 30, 60, 100, 250, 500]))
    low = top * g.uniform(0.04, 0.1)
    grid = np.linspace(low, top, per) if g.random() < 0.7 else np.geomspace(low, top, per)
    style = str(g.choice(["random", "random", "up and down", "up"]))
    p = np.concatenate([pressures(g, style, grid) for _ in range(plots)])
    p = np.round(p * (1 + g.normal(0, 0.002, n)), 4 if top < 50 else 3)
    gaps = g.uniform(90, 240) * g.uniform(0.7, 1.4, n)
    usual = float(np.median(gaps))
    gaps[::per] += g.uniform(1800, 6000, plots)
    t = np.round(np.cumsum(gaps))
    chambers = CHAMBERS[int(g.integers(len(CHAMBERS)))]
    s, e = (
        np.round(temperatures(g, a, b, plots)[plot] + g.normal(0, 0.1, plots)[plot] + g.normal(0, 0.03, n), 2)
        for a, b in (chambers[:2], chambers[2:])
    )
    z = [(v - v.mean()) / v.std() for v in (p, s, e)]
    model = np.column_stack([np.ones(n), *z, *(z[a] * z[b] for a in range(3) for b in range(a, 3))])
    full = float(g.choice([10, 20, 50, 100]))
    sd = full * float(g.choice([2e-4, 5e-4, 1e-3]))
    bridges = int(g.integers(1, 4))
    outputs = []
    for j in range(bridges):
        k = g.normal([0.5, 0.25, *[0] * 8], [0.03, 0.02, 0.015, 0.01, *[0.003] * 6])
        name = "bridge_mV" if bridges == 1 else f"bridge_{j + 1}_mV"
        own = sd * (g.uniform(0.75, 1.35) if j else 1.0)
        outputs.append(Output(name, full * model @ k, own, full * k[1] / p.std()))
    columns = {
        "whole_plot": [str(k + 1) for k in plot],
        "order": [str(k + 1) for k in range(n)],
        "elapsed_s": [f"{v:.0f}" for v in t],
        "pressure_psia": [f"{v:.{4 if top < 50 else 3}f}" for v in p],
        "sensor_temperature_degC": [f"{v:.2f}" for v in s],
        "sse_temperature_degC": [f"{v:.2f}" for v in e],
    }
    world = World(t=t, p=p, part=p / top, s=s, warmth=(s - s.min()) / np.ptp(s), plot=plot, per=per, usual=usual)
    share = float(g.uniform(0.04, 0.16))
    return Lab(columns, outputs, model, np.zeros(n), t, world, block=plot, share=share)


EFFECTS = Causes()


@EFFECTS()
def membrane_stiffens(w: World, o: Output, g: Random, own: Random) -> Array:
    """Everyday. A thin membrane that bends by more than half its thickness is stretched, too, and gets stiffer by the
    cube of its deflection. Depends on pressure: less and less output than in proportion. Matters at high pressure; a
    parabola takes up most of it.
    """
    k = own.uniform(0.3, 1.5)
    bent = 2 / np.sqrt(3 * k) * np.sinh(np.arcsinh(1.5 * np.sqrt(3 * k) * w.part) / 3)  # of bent + k bent^3 = part
    return bent - w.part


@EFFECTS()
def ring_goes_hard(w: World, o: Output, g: Random, own: Random) -> Array:
    """Everyday. The elastomer ring around the cell turns to glass in the cold, grips the cell and bears a part of the
    load. Depends on sensor temperature (a smooth step of some kelvins) times pressure, with a little zero. Matters in
    the cold whole plots.
    """
    glass, width = g.uniform(0.25, 0.5), g.uniform(0.02, 0.06)
    return -(w.part + own.uniform(-0.3, 0.3)) / (1 + np.exp((w.warmth - glass) / width))


@EFFECTS(both=True)
def not_soaked(w: World, o: Output, g: Random, own: Random) -> Array:
    """Everyday. The reading begins when the chamber's thermometer stands, but the transducer's core has still a part
    of the temperature of the whole plot before. Depends on the time in the whole plot (a decay over 3 to 7 rows)
    times the change of sensor temperature before it; zero and span. Matters at the beginning of whole plots after
    large changes.
    """
    opens = w.plot * w.per
    before = np.where(opens > 0, w.s[opens - 1], 22.0)
    fade = np.exp(-(w.t - w.t[opens]) / (w.usual * own.uniform(3, 7)))
    return (before - w.s) * fade * (own.uniform(0.3, 1) + w.part)


@EFFECTS(both=True)
def glue_creeps(w: World, o: Output, g: Random, own: Random) -> Array:
    """Everyday. Glue or spring creep under load and come back slowly: a part of the output follows the pressures of
    the last rows. Depends on pressure and time: a lag of 3 to 9 rows, through whole plots. Matters after large
    changes; with rising pressures it looks like the slope.
    """
    return memory(w.part, w.t, w.usual * own.uniform(3, 9), 0.0)


@EFFECTS(bench=True, both=True)
def standard_changes_range(w: World, o: Output, g: Random, own: Random) -> Array:
    """Everyday. The pressure controller has two gauges inside, and above a pressure takes the other one, which was
    adjusted another time: another zero and span. Depends on pressure: a step, and a little change of slope above it.
    Matters always.
    """
    change = np.quantile(w.part, g.uniform(0.35, 0.7))
    return o.gain * (w.part > change) * (1 + g.uniform(-1, 1) * (w.part - change))


@EFFECTS(both=True)
def filling_warms_the_gas(w: World, o: Output, g: Random, own: Random) -> Array:
    """Unlisted. Gas that is compressed quickly is warmed, and cooled on release; it warms the membrane, whose zero
    goes with it, until the wall has taken the heat. Depends on the logarithm of the ratio of pressure to the one
    before (move), on absolute sensor temperature, and on the time since. Matters after large ratios and short waits.
    """
    heat = np.log(w.p[1:] / w.p[:-1]) * (w.s[1:] + 273.15) / 300
    fade = np.exp(-np.diff(w.t) / (w.usual * own.uniform(0.4, 1.2)))
    warm = np.zeros_like(w.p)
    for i, (h, f) in enumerate(zip(heat, fade, strict=True), 1):
        warm[i] = (warm[i - 1] + h) * f
    return warm


@EFFECTS(both=True)
def table_of_chords(w: World, o: Output, g: Random, own: Random) -> Array:
    """Unlisted. The electronics corrects the span from a table over the sensor's temperature, in straight lines
    between few points; the truth is curved. Depends on sensor temperature (no error at the table's points, arcs of
    one sign between them) times pressure. Matters midway between the points.
    """
    between = (w.warmth * g.uniform(1.8, 3.2) + g.uniform(0.2, 0.8)) % 1
    return w.part * between * (1 - between)


@EFFECTS(both=True)
def membrane_snaps(w: World, o: Output, g: Random, own: Random) -> Array:
    """Unlisted. The membrane was welded with compression in it, and snaps from one shape to the other at some
    pressure; on the way down it snaps back at a lower one. Both are a little lower when it is warm. Depends on
    pressure, and between the two on the pressures before (which was last outside them). Matters always: two branches.
    """
    middle = own.uniform(0.4, 0.6) + own.uniform(0, 0.1) * (0.5 - w.warmth)
    return last_side(w.part - middle, own.uniform(0.06, 0.14), -1.0)


ABOUT = EFFECTS.about()
PAIRS = [
    ("membrane_stiffens", "not_soaked"),
    ("standard_changes_range", "filling_warms_the_gas"),
    ("glue_creeps", "table_of_chords"),
]
