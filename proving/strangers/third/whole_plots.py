"""Pressure transducers in a chamber: each setting of the temperature is a whole plot."""
import numpy as np

from . import common as c


class Lab:
    pass


def laboratory(seed):
    rng = c.stream("whole_plots", seed, "design")
    lab = Lab()
    while True:
        levels = int(rng.integers(3, 10))
        plots = int(rng.integers(max(6, levels), 16))
        points = int(rng.integers(6, 25))
        if 80 <= plots * points <= 300:
            break
    low, high = rng.uniform(-40, 5), rng.uniform(50, 85)
    temps = np.round(np.linspace(low, high, levels))
    plan = np.concatenate([temps, rng.choice(temps, plots - levels)])
    plan = rng.permutation(plan)
    lab.p0, lab.pmax = [(0.5, 100.0), (0.5, 50.0), (15.0, 500.0), (2.0, 250.0)][rng.integers(0, 4)]
    style = ["random", "up-down", "random"][rng.integers(0, 3)]
    base = rng.uniform(60, 240)
    day = rng.uniform(0, 86400)
    wp, t, press, tin, nominal, tplot = [], [], [], [], [], []
    now = 0.0
    grid = np.linspace(lab.p0, lab.pmax, points) if style == "random" else None
    half = (points + 1) // 2
    for k, temp in enumerate(plan):
        if style == "random":
            run = rng.permutation(grid)
        else:
            up = np.linspace(lab.p0, lab.pmax, half)
            down = np.linspace(lab.p0, lab.pmax, points - half + 2)[::-1][1:-1] if points - half > 0 else up[:0]
            run = np.concatenate([up, down])
        start = now
        for q in run:
            now += base * np.exp(0.35 * rng.standard_normal())
            wp.append(k + 1), t.append(round(now, 1)), tin.append(now - start), nominal.append(q), tplot.append(temp)
            press.append(round(max(q + 2e-4 * lab.pmax * rng.standard_normal(), 0.01), 4))
        now += rng.uniform(2400, 7200) if rng.random() < 0.8 else rng.uniform(36000, 55000)
    lab.wp, lab.t, lab.press, lab.tin = np.array(wp), np.array(t), np.array(press), np.array(tin)
    lab.nominal, lab.tplot = np.array(nominal), np.array(tplot)
    n = lab.n = len(wp)
    lab.order = np.arange(1, n + 1)
    lab.restart = np.concatenate([[True], lab.wp[1:] != lab.wp[:-1]])
    off = 0.4 * rng.standard_normal(plots)[lab.wp - 1]
    before = np.concatenate([[23.0], plan[:-1]])[lab.wp - 1]
    lab.before = before
    lab.temp = np.round(lab.tplot + off + 0.01 * (before - lab.tplot) * np.exp(-lab.tin / 1500) + 0.03 * rng.standard_normal(n), 3)
    lab.sse = rng.uniform(22, 28) + rng.uniform(0.02, 0.08) * (lab.tplot - 23) + 1.5 * np.sin(2 * np.pi * (lab.t + day) / 86400) \
        + 1.3 * rng.standard_normal(plots)[lab.wp - 1] + 0.5 * np.sin(2 * np.pi * lab.t / rng.uniform(2500, 6000)) + 0.05 * rng.standard_normal(n)
    lab.sse = np.round(lab.sse, 3)
    lab.u = lab.press / lab.pmax
    lab.v = (lab.temp - lab.temp.mean()) / (0.5 * np.ptp(lab.temp))
    lab.dwell = np.concatenate([[0.0], np.diff(lab.t)])
    lab.dwell[lab.restart] = lab.tin[lab.restart]
    lab.sensors = int(rng.integers(1, 4))
    full = rng.uniform(30, 100)
    lab.scale = full * np.exp(0.08 * rng.standard_normal(lab.sensors))
    lab.sigma = float(full * 10 ** rng.uniform(-4.6, -3.7))
    lab.ratio = rng.uniform(0.15, 0.8)  # whole-plot to subplot error
    a, b = lab.u, lab.v
    lab.mV = np.column_stack([s * (rng.normal(0, 0.01) + a + rng.normal(0, 0.006) * b + rng.normal(0, 0.004) * a ** 2 + rng.normal(0, 0.003) * b ** 2
                                   + rng.normal(0, 0.01) * a * b) for s in lab.scale])
    lab.design = np.column_stack([np.ones(n), a, b, a ** 2, b ** 2, a * b])
    return lab


def _all(lab, h, rng, spread=0.0):
    """A cause in the reference or the line is the same for all transducers; with spread each has a coefficient of its own."""
    f = np.ones(lab.sensors)
    f[1:] = np.exp(spread * rng.standard_normal(lab.sensors - 1))
    return h[:, None] * f[None, :]


def condensate_slug(lab, rng):
    cold = lab.temp < np.quantile(lab.tplot, rng.uniform(0.3, 0.6)) + 1.5
    return _all(lab, (cold & (lab.u < rng.uniform(0.25, 0.6))).astype(float), rng)


def hot_creep(lab, rng):
    tau = rng.uniform(200, 900)
    lag = c.low_pass(lab.u, lab.t, tau, min(14.7 / lab.pmax, 1.0), lab.restart) - lab.u
    return _all(lab, np.exp((lab.temp - 23.0) / rng.uniform(25, 50)) * lag, rng, 0.5)


def leak_dwell(lab, rng):
    return _all(lab, -np.sqrt(np.maximum(lab.press - 14.7, 0.0) / lab.pmax) * lab.dwell / lab.dwell.mean(), rng)


def sse_gain(lab, rng):
    return _all(lab, lab.u * (lab.sse - np.mean(lab.sse)), rng, 0.6)


def fan_thermostat(lab, rng):
    mid, width = np.quantile(lab.sse, rng.uniform(0.35, 0.65)), rng.uniform(0.4, 1.2)
    return _all(lab, c.schmitt(lab.sse, mid - width / 2, mid + width / 2) * (lab.u + rng.uniform(0.1, 0.4)), rng, 0.2)


def stop_touch(lab, rng):
    return np.maximum(0.0, lab.u - rng.uniform(0.55, 0.8) - rng.uniform(0.05, 0.2) * lab.v)[:, None]


def atmospheric_tide(lab, rng):
    a, b, k = rng.uniform(0, 6.28), rng.uniform(0, 6.28), rng.uniform(1.0, 2.5)
    slow = rng.uniform(30, 60) * 3600.0

    def air(t):
        return np.cos(2 * np.pi * t / 43200.0 + a) + k * np.cos(2 * np.pi * t / slow + b)
    return _all(lab, air(lab.t) - air(lab.t - lab.tin), rng)


def adiabatic(lab, rng):
    step = lab.u - c.previous(lab.u, 0.0)
    step[lab.restart] = lab.u[lab.restart] - min(14.7 / lab.pmax, 1.0)
    tau = rng.uniform(0.3, 1.0) * np.median(lab.dwell)
    return _all(lab, np.where(step > 0, step, 0.6 * step) * np.exp(-lab.dwell / tau), rng, 0.3)


def soak_gradient(lab, rng):
    tau = rng.uniform(0.25, 0.6) * np.max(lab.tin)
    return _all(lab, (lab.before - lab.tplot) / np.ptp(lab.tplot) * np.exp(-lab.tin / tau) * (rng.uniform(0.1, 0.6) + lab.u), rng, 0.4)


def wrong_disc(lab, rng):
    discs = [0.4, 0.2, 0.2, 0.1, 0.05, 0.02, 0.02]
    used = np.zeros((lab.n, len(discs)), bool)
    for i, q in enumerate(lab.nominal / lab.pmax):
        rest = q + 1e-9
        for j, d in enumerate(discs):
            if rest >= d:
                used[i, j] = True
                rest -= d
    share = used.mean(0)
    fit = [j for j in range(len(discs)) if 0.12 < share[j] < 0.88]
    j = fit[int(rng.integers(0, len(fit)))]
    return _all(lab, used[:, j].astype(float), rng)


EFFECTS = {f.__name__: f for f in (condensate_slug, hot_creep, leak_dwell, sse_gain, fan_thermostat, stop_touch, atmospheric_tide, adiabatic,
                                   soak_gradient, wrong_disc)}
PAIRS = [("condensate_slug", "adiabatic"), ("hot_creep", "wrong_disc"), ("leak_dwell", "sse_gain"), ("fan_thermostat", "stop_touch"),
         ("atmospheric_tide", "wrong_disc"), ("soak_gradient", "stop_touch"), ("hot_creep", "sse_gain")]
ABOUT = {
    "condensate_slug": "In the cold plots (sensor temperature below a limit) water condenses in the loop of the pressure line and adds a constant head; "
    "above some pressure it is pushed clear of the loop, below it runs back. Depends on sensor temperature (threshold) and pressure (threshold): a "
    "constant offset in that corner. In all transducers.",
    "hot_creep": "The cement of the diaphragm's strain gauges creeps: part of the output follows pressure with a lag of 3 to 15 minutes, and the more the "
    "hotter (exponential in sensor temperature). Vented between plots. Depends on the history of pressure in the plot, times temperature. Each transducer has its own amount.",
    "leak_dwell": "The line leaks after it is shut off: between the reference reading and the bridge reading pressure is lost in proportion to the wait at "
    "the point (elapsed time since the row before) and to the square root of the pressure over atmosphere. Depends on duration of the row times pressure. In all transducers.",
    "sse_gain": "The reference resistor of the signal electronics has a temperature coefficient: the gain follows the temperature of the electronics. "
    "Depends on pressure times sse_temperature. Each transducer has its own coefficient.",
    "fan_thermostat": "The electronics' fan is switched by a thermostat with hysteresis on sse_temperature; while it runs, supply sag lowers gain and zero by "
    "a fixed amount. Depends on sse_temperature (threshold with memory) times pressure. In all transducers.",
    "stop_touch": "The diaphragm touches its overload stop at high pressure, sooner when cold: zero below a limit and linear in the excess above, the limit "
    "rises with sensor temperature. Depends on pressure (kink) and sensor temperature. Only in the first transducer.",
    "atmospheric_tide": "The reference is a gauge instrument plus a barometer that is read only at the start of each whole plot: the change of the weather "
    "and the 12-hour tide of the atmosphere since then are missing. An offset that drifts within each plot from zero, with a rate and sign of its "
    "own in each plot. Depends on time in plot and time. In all transducers.",
    "adiabatic": "Gas warms when it is compressed and cools when let out; the diaphragm's zero shifts by the pressure step since the row before and decays "
    "with the wait at the point; downward steps count 0.6. Depends on the move of pressure and the duration of the row. In all transducers.",
    "soak_gradient": "The soak before each plot is too short: the body is still warm or cold from the plot before, a gradient that shifts zero and gain in "
    "proportion to the change of temperature between plots and dies out exponentially in the plot. Depends on time in plot times the step of "
    "temperature since the plot before (times pressure). Each transducer has its own amount.",
    "wrong_disc": "One disc of the piston gauge has a wrong mass: a constant offset at those nominal pressures that the operator makes up with that disc "
    "(largest disc first: 0.4, 0.2, 0.2, 0.1, 0.05, 0.02, 0.02 of full scale). Depends on pressure only, as an on-off pattern. In all transducers.",
}
NOISES = {"white": c.white, "heavy": c.heavy, "level": c.with_level, "quantised": c.quantised, "ar1": c.ar1, "plot_ar": c.white,
          "outliers": c.outliers, "skewed": c.skewed, "flicker": c.flicker}


def table(effects, seed, size, noise):
    lab = laboratory(seed)
    total_sigma = lab.sigma * np.sqrt(1 + lab.ratio ** 2)
    parts, sizes = c.scaled(EFFECTS, effects, lab, "whole_plots", seed, lab.design, total_sigma, size, lab.scale)
    total = sum(parts.values(), np.zeros((lab.n, lab.sensors)))
    rng = c.stream("whole_plots", seed, "noise", noise)
    columns = []
    plots = int(lab.wp.max())
    for k in range(lab.sensors):
        sigma = lab.sigma * lab.scale[k] / lab.scale[0]
        e = rng.standard_normal(plots)
        if noise == "plot_ar":
            for i in range(1, plots):
                e[i] = 0.7 * e[i - 1] + np.sqrt(1 - 0.49) * e[i]
        y = lab.mV[:, k] + total[:, k] + sigma * lab.ratio * e[lab.wp - 1] + sigma * NOISES[noise](rng, lab.u / lab.u.max(), lab.wp)
        if noise == "quantised":
            y = np.round(y / (c.QUANTUM * sigma)) * c.QUANTUM * sigma
        columns.append(y)
    names = ["bridge_mV"] if lab.sensors == 1 else [f"bridge_{k + 1}_mV" for k in range(lab.sensors)]
    csv = c.text(["whole_plot", "order", "elapsed_s", "pressure_psia", "sensor_temperature_degC", "sse_temperature_degC"] + names,
                 [lab.wp, lab.order, lab.t, lab.press, lab.temp, lab.sse] + columns, [0, 0, 1, 4, 3, 3] + [c.digits(lab.sigma)] * lab.sensors)
    return csv, [], total[:, 0], total_sigma, {k: v[:, 0] for k, v in parts.items()}, sizes
