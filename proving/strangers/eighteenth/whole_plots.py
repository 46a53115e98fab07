"""Pressure transducers in one chamber, their electronics in another; each whole plot has its temperatures."""

from types import SimpleNamespace as World

import numpy as np

from .common import NOISES, Array, Causes, Lab, Output, Random, chance, memory

__all__ = ["ABOUT", "EFFECTS", "NOISES", "PAIRS", "laboratory"]
# degC: transducers from, to; electronics from, to
CHAMBERS = ((-100, 40, -15, 50), (-55, 125, -30, 70), (-40, 85, -10, 55), (-60, 70, 0, 45), (-30, 60, -5, 40))


def temperatures(g: Random, low: float, high: float, plots: int) -> Array:
    """All different, or some levels in random order, again and again."""
    many = plots if g.random() < 0.4 else int(g.integers(5, 8))
    levels = np.linspace(low, high, many) + (high - low) * g.uniform(-0.02, 0.02, many)
    return np.concatenate([g.permutation(levels) for _ in range(-(-plots // many))])[:plots]


def pressures(g: Random, style: str, grid: Array) -> Array:
    """The pressures of one whole plot, in their order."""
    match style:
        case "random":
            return g.permutation(grid)
        case "down and up":
            return np.concatenate([grid[::2][::-1], grid[1::2]])
        case "from the ends":
            return np.column_stack([grid, grid[::-1]]).ravel()[: len(grid)]
    return np.concatenate([grid[1:], grid[:1]])  # up, and the lowest again


def laboratory(seed: int) -> Lab:
    """A laboratory and all that its causes need to know of it."""
    g = chance("whole_plots", seed, "laboratory")
    plots = int(g.integers(6, 21))
    per = int(g.integers(9 if plots > 8 else 12, 16))
    n = plots * per
    plot = np.arange(n) // per
    top = float(g.choice([10, 20, 45, 75, 150, 300]))
    low = top * g.uniform(0.04, 0.1)
    grid = np.linspace(low, top, per) if g.random() < 0.7 else np.geomspace(low, top, per)
    style = str(g.choice(["random", "down and up", "from the ends", "up"], p=[0.45, 0.25, 0.15, 0.15]))
    p = np.concatenate([pressures(g, style, grid) for _ in range(plots)])
    p = np.round(p * (1 + g.normal(0, 0.002, n)), 4 if top < 50 else 3)
    gaps = g.uniform(80, 260) * g.uniform(0.7, 1.4, n)
    usual = float(np.median(gaps))
    gaps[::per] += g.uniform(1800, 6600, plots)
    t = np.round(np.cumsum(gaps))
    chambers = CHAMBERS[int(g.integers(len(CHAMBERS)))]
    s, e = (
        np.round(temperatures(g, a, b, plots)[plot] + g.normal(0, 0.1, plots)[plot] + g.normal(0, 0.03, n), 2)
        for a, b in (chambers[:2], chambers[2:])
    )
    z = [(v - v.mean()) / v.std() for v in (p, s, e)]
    model = np.column_stack([np.ones(n), *z, *(z[a] * z[b] for a in range(3) for b in range(a, 3))])
    full = float(g.choice([10, 25, 50, 100]))
    sd = full * float(g.choice([2e-4, 5e-4, 1e-3]))
    bridges = int(g.integers(1, 4))
    outputs = []
    for j in range(bridges):
        k = g.normal([0.5, 0.25, *[0] * 8], [0.03, 0.02, 0.015, 0.01, *[0.003] * 6])
        name = "bridge_mV" if bridges == 1 else f"bridge_{j + 1}_mV"
        own = sd * (g.uniform(0.75, 1.35) if j else 1.0)
        outputs.append(Output(name, full * model @ k, own, full * float(k[1]) / float(p.std())))
    columns = {
        "whole_plot": [str(k + 1) for k in plot],
        "order": [str(k + 1) for k in range(n)],
        "elapsed_s": [f"{v:.0f}" for v in t],
        "pressure_psia": [f"{v:.{4 if top < 50 else 3}f}" for v in p],
        "sensor_temperature_degC": [f"{v:.2f}" for v in s],
        "sse_temperature_degC": [f"{v:.2f}" for v in e],
    }
    world = World(t=t, p=p, part=p / top, s=s, e=e, warmth=(s - s.min()) / np.ptp(s), usual=usual)
    share = float(g.uniform(0.04, 0.16))
    return Lab(columns, outputs, model, np.zeros(n), t, world, block=plot, share=share)


EFFECTS = Causes()


@EFFECTS(bench=True)
def battery_runs_down(w: World, o: Output, g: Random, own: Random) -> Array:
    """Everyday. A battery feeds the bridges: its voltage falls fast at first, then slowly, and faster at the end.
    Depends on time over the whole run, times pressure. Matters at the beginning and the end, at high pressure.
    """
    used = g.uniform(0.7, 0.95) * (w.t - w.t[0]) / np.ptp(w.t)
    lost = g.uniform(0.2, 0.5) * used - 0.15 * np.expm1(-used / g.uniform(0.05, 0.15)) + np.exp((used - 1) / 0.08)
    return -o.gain * w.part * lost


@EFFECTS()
def friction_in_the_stem(w: World, o: Output, g: Random, own: Random) -> Array:
    """Everyday. The stem between membrane and beam rubs in its guide and holds the beam back, until the pressure has
    changed by some hundredths to a quarter of the range. Depends on pressure by its history: the sign of the last
    changes, and smaller after a small one. Matters always: two branches.
    """
    span, held = own.uniform(0.05, 0.25), np.zeros_like(w.part)
    for i, step in enumerate(np.diff(w.part), 1):
        side = np.sign(step)
        held[i] = side + (held[i - 1] - side) * np.exp(-abs(step) / span)
    return -held


@EFFECTS(bench=True)
def reference_out_of_range(w: World, o: Output, g: Random, own: Random) -> Array:
    """Everyday. Below some temperature of the electronics the regulator that feeds the bridges has not enough voltage
    any more, and the excitation falls. Depends on electronics temperature (a kink, in proportion below) times
    pressure. Matters in the whole plots with cold electronics.
    """
    return -o.gain * w.part * np.maximum(np.quantile(w.e, g.uniform(0.3, 0.6)) - w.e, 0)


@EFFECTS()
def amplifier_at_its_rail(w: World, o: Output, g: Random, own: Random) -> Array:
    """Everyday. The amplifier comes near the voltage of its supply, and the largest outputs are cut softly. Depends on
    pressure (a bend downwards near the top), a little sooner or later by sensor temperature. Matters at the highest
    pressures.
    """
    beyond = w.part * (1 + own.uniform(-0.06, 0.06) * (w.warmth - 0.5)) - own.uniform(0.7, 0.85)
    width = own.uniform(0.01, 0.04)
    return -width * np.logaddexp(0, beyond / width)


@EFFECTS(bench=True, both=True)
def hall_by_day(w: World, o: Output, g: Random, own: Random) -> Array:
    """Everyday. The pressure standard stands in the hall, not in a chamber, and its span follows the hall's
    temperature, which nobody wrote down. Depends on the time of day (a period of 24 h) times pressure. Matters at high
    pressure.
    """
    return o.gain * w.part * np.sin(2 * np.pi * (w.t / 86400 + g.random()))


@EFFECTS()
def reference_vacuum_fills(w: World, o: Output, g: Random, own: Random) -> Array:
    """Unlisted. Gas passes through the seal of the vacuum behind the membrane, in proportion to the pressure, and
    faster when it is warm (Arrhenius, 0.15 to 0.35 eV): the output falls. Depends on the sum over time of pressure
    times this factor of sensor temperature. Matters after hot whole plots; it never comes back.
    """
    rate = w.part * np.exp(own.uniform(0.15, 0.35) / 8.617e-5 * (1 / 300 - 1 / (w.s + 273.15)))
    return -np.cumsum(np.append(0.0, rate[:-1] * np.diff(w.t)))


@EFFECTS(both=True)
def gas_cools_the_bridge(w: World, o: Output, g: Random, own: Random) -> Array:
    """Unlisted. The bridge's own current warms it, and gas carries the heat off, the better the denser it is (root of
    the density, by convection). The zero goes with the bridge's excess of temperature. Depends on pressure over
    absolute sensor temperature: steep at low pressure, flat at high. Matters at low pressure.
    """
    density = w.part * 300 / (w.s + 273.15)
    return 1 / (1 + own.uniform(1, 4) * np.sqrt(density))


@EFFECTS(bench=True)
def ice_in_the_line(w: World, o: Output, g: Random, own: Random) -> Array:
    """Unlisted. Moisture in the line freezes in the cold chamber and narrows the bore: the transducers are still on
    the way from the pressure before. Depends on the pressures of the last rows less the present one, and on time,
    only below some sensor temperature. Matters in cold whole plots after large changes.
    """
    late = memory(w.part, w.t, w.usual * g.uniform(0.4, 1.5)) - w.part
    return o.gain * late * (w.s < np.quantile(w.s, g.uniform(0.3, 0.55)))


ABOUT = EFFECTS.about()
PAIRS = [
    ("battery_runs_down", "amplifier_at_its_rail"),
    ("friction_in_the_stem", "reference_out_of_range"),
    ("hall_by_day", "gas_cools_the_bridge"),
]
