"""Four other laboratories (dead-weight force, flow of water, thermometer bath, photometer bench) with causes of their own."""
from types import SimpleNamespace

import numpy as np

from .common import noises, registry, relax, residual, rms, wander

EFFECTS, ABOUT, effect = registry()
NOISES = noises()


def _finish(rng, lab, needs, clock, decimals, response, powers, **options):
    """Declared columns, options; without --time the clock's column is left out as well."""
    lab.n, lab.decimals, lab.responses = len(lab.x), decimals, [response]
    lab.truth = lab.truth[:, None]
    lab.X = np.stack([lab.x ** p for p in range(powers + 1)], 1)
    lab.setting = np.abs(lab.x) / np.abs(lab.x).max()
    terms = ["1", lab.name] + [f"{lab.name}^{p}" for p in range(2, powers + 1)]
    lab.options = ["--response", response, "--formula", " + ".join(terms)]
    if needs.get("clock") or rng.random() < 0.6:
        lab.options += ["--time", clock]
    else:
        lab.columns.pop(clock)
    for option, column in options.items():
        if column:
            lab.options += ["--" + option.replace("_", "-"), column]
    return lab


def _updown(rng, levels, reps):
    """Each replicate up, then down; the top once."""
    x = np.tile(np.r_[levels, levels[-2::-1]], reps)
    up = np.tile(np.r_[np.ones(len(levels)), -np.ones(len(levels) - 1)], reps).astype(int)
    return x, up, np.repeat(np.arange(reps), 2 * len(levels) - 1)


def force(rng, needs):
    full = float(rng.choice([5, 20, 50, 200]))
    levels = np.round(np.linspace(0, full, rng.integers(7, 12)), 4)
    x, up, rep = _updown(rng, levels, int(rng.integers(4, 9)))
    per_day, n = int(rng.integers(2, 4)), len(x)
    dt = rng.uniform(50, 100) * rng.uniform(0.9, 1.2, n)
    first = np.flatnonzero(np.diff(rep)) + 1
    dt[first] += np.where(rep[first] % per_day == 0, rng.uniform(14, 20) * 3600, rng.uniform(300, 1500))
    t = np.cumsum(dt)
    T = 21 + rng.normal(0, 0.5) + wander(rng, t, rng.uniform(0.4, 1.2), 3)
    S = 2 * rng.uniform(0.98, 1.02) / full
    lab = SimpleNamespace(x=x, up=up, rep=rep, group=rep, t=t, T=T, full=full, S=S, name="force_kN", cycle=rep % per_day,
                          truth=rng.normal(0, 0.01) + S * x + rng.normal(0, 1e-4) * (x / full) ** 2, sd=np.exp(rng.uniform(np.log(1e-5), np.log(8e-5))))
    lab.columns = dict(replicate=rep + 1, order=np.arange(1, n + 1), elapsed_min=np.round(t / 60, 2), direction=up, force_kN=x, room_temperature_degC=np.round(T, 2))
    return _finish(rng, lab, needs, "elapsed_min", 7, "signal_mV_per_V", 2, direction="direction", replicate="replicate")


def flow(rng, needs):
    n, full = int(rng.integers(45, 160)), float(rng.choice([20, 60, 300]))
    levels = np.linspace(0.08, 1, rng.integers(7, 13)) * full
    x = np.round(rng.choice(levels, n) * rng.uniform(0.98, 1.02, n), 4)
    names = np.array(rng.permutation(["Anna", "Bert", "Clara", "Dieter"]))[:rng.integers(2, 4)]
    who = np.repeat(rng.integers(0, len(names), n // 4 + 1), rng.integers(4, 9))[:n]
    who[:len(names)] = np.arange(len(names))
    t = np.cumsum(rng.uniform(200, 420, n))
    T, p = rng.uniform(20, 32) + wander(rng, t, rng.uniform(2, 5), 4), rng.uniform(2.2, 3.0) + wander(rng, t, rng.uniform(0.1, 0.3), 1)
    K = rng.uniform(1, 3) * 60 / full * 10
    lab = SimpleNamespace(x=x, t=t, T=T, p=p, who=who, group=np.arange(n) // 10, full=full, K=K, name="flow_L_per_min",
                          truth=rng.normal(0, 0.3) + K * x * (1 + rng.normal(0, 2e-3) * x / full), sd=K * full * np.exp(rng.uniform(np.log(5e-5), np.log(4e-4))))
    lab.columns = dict(run=np.arange(1, n + 1), elapsed_h=np.round(t / 3600, 4), flow_L_per_min=x, water_temperature_degC=np.round(T, 2),
                       supply_pressure_bar=np.round(p, 3), operator=names[who])
    return _finish(rng, lab, needs, "elapsed_h", 4, "frequency_Hz", 2, group="operator")


def bath(rng, needs):
    m, each = int(rng.integers(7, 15)), int(rng.choice([4, 6, 8]))
    levels = np.linspace(rng.choice([-30, -10, 5]), rng.choice([70, 90, 120]), m)
    levels = levels if rng.random() < 0.4 else rng.permutation(levels)
    visit = np.repeat(np.arange(m), each)
    n = len(visit)
    dt = rng.uniform(180, 300, n)
    dt[::each] += rng.uniform(1200, 3600, m)
    t = np.cumsum(dt)
    x = np.round(levels[visit] + rng.normal(0, 0.02, n), 3)
    current = rng.choice(rng.choice([0.5, 0.707]) * np.array([1, 2]), n)
    lab = SimpleNamespace(x=x, t=t, visit=visit, group=visit, current=current, name="bath_temperature_degC",
                          truth=100 * (1 + 3.9083e-3 * x - 5.775e-7 * x ** 2) + rng.normal(0, 0.02), sd=0.39 * np.exp(rng.uniform(np.log(4e-4), np.log(3e-3))))
    lab.columns = dict(order=np.arange(1, n + 1), visit=visit + 1, elapsed_min=np.round(t / 60, 2), bath_temperature_degC=x, current_mA=np.round(current, 3))
    return _finish(rng, lab, needs, "elapsed_min", 6, "resistance_ohm", 2, whole_plot="visit" if rng.random() < 0.5 else None)


def light(rng, needs):
    full = float(rng.choice([500, 2000, 10000]))
    levels = np.round(full * np.linspace(0.02, 1, rng.integers(8, 13)), 2)
    x, up, rep = _updown(rng, levels, int(rng.integers(3, 8)))
    n = len(x)
    dt = rng.uniform(60, 140) * rng.uniform(0.9, 1.3, n)
    dt[np.flatnonzero(np.diff(rep)) + 1] += rng.uniform(200, 2400, rep.max())
    t = np.cumsum(dt)
    T, RH = rng.uniform(23, 29) + wander(rng, t, rng.uniform(0.8, 2), 1.5), np.clip(rng.uniform(50, 65) + wander(rng, t, rng.uniform(5, 12), 1.5), 20, 95)
    S = rng.uniform(0.5, 2) * 10 / full
    lab = SimpleNamespace(x=x, up=up, rep=rep, group=rep, t=t, T=T, RH=RH, S=S, full=full, name="illuminance_lx", truth=rng.normal(0, 0.01) + S * x,
                          sd=S * full * np.exp(rng.uniform(np.log(5e-5), np.log(5e-4))))
    lab.columns = dict(replicate=rep + 1, order=np.arange(1, n + 1), elapsed_min=np.round(t / 60, 2), direction=up, illuminance_lx=x,
                       detector_temperature_degC=np.round(T, 2), humidity_percent=np.round(RH, 1))
    return _finish(rng, lab, needs, "elapsed_min", 6, "signal_uA", 1, direction="direction", replicate="replicate")


LABS = dict(force=force, flow=flow, bath=bath, light=light)


def laboratory(rng, needs):
    return LABS[needs.get("lab") or str(rng.choice(list(LABS)))](rng, needs)


def ruler(lab, h, sd=False):
    if sd:
        return lab.sd
    r = residual(h, lab.X)
    return r, rms(r) / lab.sd


def errors(lab, noise, rng):
    return lab.sd * noise(rng, lab.setting, lab.group)[:, None]


@effect("""The hanger of the dead weights touches the guard ring once the machine's frame has bent far enough, earlier on a warm day as the gap closes. The ring then carries part of the weight, with
friction. Depends on force above a contact point that moves with room temperature, and a little on direction.""", lab="force")
def hanger_touches_guard(lab, rng, k):
    gap = rng.uniform(0.45, 0.75) - rng.uniform(0.06, 0.18) * (lab.T - lab.T.mean())
    return -k * 1e-3 * lab.S * lab.full * np.maximum(0, lab.x / lab.full - gap) * (1 + rng.uniform(0.1, 0.4) * lab.up)


@effect("""After a night without load the cell's joints have settled; the first loading of the day gives less per kilonewton, its way down half as
much less, the second cycle hardly so (nobody preloaded). Depends on the number of cycles since the last long rest (gaps in elapsed_min),
proportional to force, more on the way up.""", lab="force", clock=True)
def unexercised_cell(lab, rng, k):
    fresh = np.exp(-lab.cycle / rng.uniform(0.5, 1.2)) * np.where(lab.up > 0, 1.0, rng.uniform(0.3, 0.6))
    return -k * 1e-4 * lab.S * lab.x * fresh


@effect("""Time of collection is taken by hand: each operator presses late by his own tenth of a second, and collects into the small tank below some flow, into the
large one above. Relative error is reaction time over filling time. Depends on operator and flow squared, with a drop where the tank
changes.""", lab="flow")
def stopwatch_by_hand(lab, rng, k):
    late = (rng.uniform(0.03, 0.3) + rng.uniform(-0.15, 0.15, 4))[lab.who]
    volume = np.where(lab.x < rng.uniform(0.3, 0.6) * lab.full, 0.4, rng.uniform(1.2, 4)) * lab.full * 0.5
    return k * 0.1 * lab.K * lab.x * late * (lab.x / 60) / volume


@effect("""At high flow the pressure behind the meter's rotor falls to where warm water gives off air and vapour; bubbles take volume and the rotor runs fast. Depends on flow squared, supply
pressure and vapour pressure (water temperature) together, nothing until the three pass a threshold.""", lab="flow")
def cavitation_bubbles(lab, rng, k):
    pv = 6.1094e-3 * np.exp(17.625 * lab.T / (lab.T + 243.04))
    short = rng.uniform(1.2, 2.2) * (lab.x / lab.full) ** 2 + rng.uniform(3, 8) * pv - lab.p
    return k * 1e-3 * lab.K * lab.x * np.maximum(0, short - np.quantile(short, rng.uniform(0.55, 0.8)))


@effect("""Oil evaporates from the hot bath, and whenever the level alarm comes the operator pours in cold oil at the probe's side; the reference on the other side is held
by the controller. For half an hour the probe is too cold. Events follow from the evaporation summed along the run (hot hours), size from bath
minus room; decays in elapsed_min.""", lab="bath", clock=True)
def oil_topped_up(lab, rng, k):
    dt = np.diff(lab.t, prepend=0.0)
    lost = np.cumsum(np.exp(lab.x / 40) * dt)
    level = np.floor(lost / (lost[-1] / rng.integers(4, 9)) + rng.uniform(0, 1))
    out, s, tau = np.zeros(len(lab.t)), 0.0, rng.uniform(600, 2000)
    for i in range(1, len(out)):
        s *= np.exp(-dt[i] / tau)
        if level[i] > level[i - 1]:
            s += (lab.x[i] - 20) / 50
        out[i] = s
    return -k * 0.39 * 0.01 * out


@effect("""The measuring current warms the thermometer, and cold silicone oil is thick: its film around the probe sheds the heat worse the colder the bath, by viscosity to the power of a
third. Readings were taken with two currents and the temperature alone is in the model. Depends on current squared times a falling function of
bath temperature.""", lab="bath")
def thick_oil_self_heating(lab, rng, k):
    nu = np.exp(rng.uniform(600, 1000) / (lab.x + rng.uniform(110, 140)))
    heat = lab.current ** 2 * (0.3 + (nu / 50) ** (1 / 3))
    return k * 0.39 * 2e-3 * heat


@effect("""The dark current is measured once with the shutter closed at the start of each replicate and subtracted from all of it; it doubles every eight degrees, and the detector's temperature wanders on.
Depends on the difference of two exponentials of temperature, now and at the replicate's first row; not on the light.""", lab="light")
def stale_dark(lab, rng, k):
    dark = 2 ** ((lab.T - 25) / rng.uniform(5, 9))
    first = np.array([dark[lab.rep == r][0] for r in range(lab.rep.max() + 1)])
    return k * 1e-2 * (dark - first[lab.rep])


@effect("""The amplifier goes to its upper range above one level and comes back only below a lower one; the upper range's gain is off and its zero as well. Depends on
illuminance and on direction between the two thresholds: the same light is read on one range going up, on the other going down.""", lab="light")
def autorange_remembers(lab, rng, k):
    high, low, state = rng.uniform(0.5, 0.8), rng.uniform(0.15, 0.4), False
    upper = np.zeros(len(lab.x))
    for i, f in enumerate(lab.x / lab.full):
        state = f > high or (state and f > low)
        upper[i] = state
    return k * upper * lab.S * (1e-3 * rng.choice([-1, 1]) * lab.x + rng.normal(0, 3e-4) * lab.full)


@effect("""When the room's humidity passes a limit the hygroscopic window fogs within minutes and clears only after the better part of an hour of dry air. It takes a fraction of the light. Depends on
the history of humidity_percent above the limit, asymmetric in time, times illuminance.""", lab="light", clock=True)
def fogged_window(lab, rng, k):
    target = np.maximum(0, lab.RH - np.quantile(lab.RH, rng.uniform(0.4, 0.75))) / 10
    wet, dry, fog, s = rng.uniform(200, 500), rng.uniform(1500, 3600), np.zeros(len(target)), 0.0
    for i in range(1, len(fog)):
        tau = wet if target[i] > s else dry
        s = target[i] + (s - target[i]) * np.exp(-(lab.t[i] - lab.t[i - 1]) / tau)
        fog[i] = s
    return -k * 2e-3 * lab.S * lab.x * fog


PAIRS = [["hanger_touches_guard", "unexercised_cell"], ["stopwatch_by_hand", "cavitation_bubbles"], ["oil_topped_up", "thick_oil_self_heating"],
         ["stale_dark", "autorange_remembers"], ["stale_dark", "fogged_window"], ["autorange_remembers", "fogged_window"]]
