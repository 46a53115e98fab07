"""Pressure transducers in a cold chamber, electronics in another chamber; temperatures change between whole plots."""
from types import SimpleNamespace
import numpy as np
from . import common
from .common import ar1, white

NOISES = dict(common.NOISES, plots_ar=white)


def laboratory(r):
    plots = int(r.integers(12, 21))
    rows = int(r.integers(7, 15))
    while plots * rows > 295 or plots * rows < 84:
        rows += 1 if plots * rows < 84 else -1
    cold, warm = r.uniform(-120, -70), r.uniform(-10, 25)
    ts_levels = np.linspace(cold, warm, int(r.integers(3, 6)))
    te_levels = np.linspace(r.uniform(-15, 5), r.uniform(35, 55), int(r.integers(3, 5)))
    every = [(a, b) for a in ts_levels for b in te_levels]
    chosen = []
    while len(chosen) < plots:
        chosen += [every[i] for i in r.permutation(len(every))]
    chosen = chosen[:plots]
    if r.random() < 0.3:
        chosen = sorted(chosen, key=lambda v: v[1] + 0.01 * (v[0] if int(v[1]) % 2 else -v[0]))
    top = float(r.choice([50.0, 100.0, 150.0, 200.0]))
    levels = np.linspace(r.uniform(0.02, 0.06), 1.0, int(r.integers(6, 10))) * top
    if r.random() < 0.4:
        levels = top * np.geomspace(r.uniform(0.03, 0.07), 1.0, len(levels))
    how = str(r.choice(["drawn", "up and down", "drawn"]))
    step, ramp, hold = r.uniform(150, 320), r.uniform(900, 2400), r.uniform(1500, 6000)
    t, p, plot, ts, te = [], [], [], [], []
    now = 0.0
    path = []                 # (time, sensor chamber, electronics chamber) at the corners
    before = chosen[0]
    for k, (a, b) in enumerate(chosen):
        a, b = a + r.normal(0, 0.3), b + r.normal(0, 0.15)
        path.append((now, before[0], before[1]))
        path.append((now + ramp, a, b))
        now += ramp + (hold * r.uniform(0.9, 1.2) if k else 600.0)
        if how == "drawn":
            seq = np.concatenate([r.permutation(levels) for _ in range(-(-rows // len(levels)))])[:rows]
        else:
            there = np.concatenate([levels, levels[-2::-1]])
            seq = there[np.round(np.linspace(0, len(there) - 1, rows)).astype(int)]
        for x in seq:
            now += step * r.uniform(0.8, 1.3)
            t.append(now)
            p.append(x * (1 + r.normal(0, 0.003)))
            plot.append(k + 1)
            ts.append(a)
            te.append(b)
        now += 120.0
        path.append((now, a, b))
        before = (a, b)
    n = len(t)
    t, plot = np.round(np.array(t)), np.array(plot)
    p = np.round(np.array(p), 3)
    ts = np.round(np.array(ts) + common.walk(r, t, 900.0, 0.06) + r.normal(0, 0.01, n), 2)
    te = np.round(np.array(te) + common.walk(r, t, 900.0, 0.04) + r.normal(0, 0.01, n), 2)
    q = [(v - v.mean()) / v.std() for v in (p, ts, te)]
    model = np.column_stack([np.ones(n)] + q + [q[i] * q[j] for i in range(3) for j in range(i, 3)])
    sensors = int(r.integers(2, 4))
    span = r.uniform(15, 60)
    sds = list(span * 10 ** r.uniform(-3.7, -2.7) * np.ones(sensors))
    clean = {}
    for j in range(sensors):
        c = span * np.r_[0.3, 0.3 * r.uniform(0.9, 1.1), r.normal(0, [0.02, 0.01, 0.004, 0.01, 0.005, 0.003, 0.002, 0.001])]
        clean["bridge_%d_mV" % (j + 1)] = model @ c
    share = r.uniform(0.2, 0.35)

    def error(r, draw, noise, level):
        row = draw(r, n, level)
        if noise == "rounded":
            row = row * np.sqrt(1 - 1 / 12 / (1 - share ** 2))
        if noise == "plots_ar":
            z = np.empty(plots)
            e = r.standard_normal(plots)
            for k in range(plots):
                z[k] = e[k] if k == 0 else 0.5 * z[k - 1] + np.sqrt(0.75) * e[k]
        else:
            z = r.standard_normal(plots)
        return np.sqrt(1 - share ** 2) * row + share * z[plot - 1]

    columns = {"whole_plot": (plot, None), "order": (np.arange(1, n + 1), None), "elapsed_s": (t, 0), "pressure_psia": (p, 3),
               "sensor_temperature_degC": (ts, 2), "sse_temperature_degC": (te, 2)}
    path = np.array(path)
    return SimpleNamespace(columns=columns, responses=clean, error_sds=sds, options=[], groups=np.ones(n), error=error, model=model,
                           share=share, plot=plot, t=t, p=p, ts=ts, te=te, path=path, sensors=sensors, top=top, step=step)


def sisters(r, lab, v):
    sign = r.choice([-1, 1])
    return sign * v[:, None] * np.r_[1.0, r.uniform(0.6, 1.3, 2)][None, :lab.sensors]


def fine(lab, dt=20.0):
    """Times and temperatures of both chambers, in small steps."""
    x = np.arange(0.0, lab.t[-1] + dt, dt)
    return x, np.interp(x, lab.path[:, 0], lab.path[:, 1]), np.interp(x, lab.path[:, 0], lab.path[:, 2])


def gauge_factor_power(lab, r):
    k = r.uniform(1.0, 1.9)
    return sisters(r, lab, lab.p / lab.top * ((lab.ts + 273.15) / 293.15) ** -k)


def line_lag(lab, r):
    # viscous flow through a long tube: dP/dt = (S^2 - P^2) / (2 C), S the pressure at the controller
    slow = r.uniform(0.25, 0.5) * lab.step * lab.top * 0.15
    out = np.empty(len(lab.p))
    state = 14.7
    for i in range(len(out)):
        s = lab.p[i]
        if i and lab.plot[i] != lab.plot[i - 1]:
            state = 14.7
        wait = lab.step if i == 0 or lab.plot[i] != lab.plot[i - 1] else lab.t[i] - lab.t[i - 1]
        f = (s - state) / (s + state) * np.exp(-s * wait / slow)
        state = s * (1 - f) / (1 + f)
        out[i] = state - s
    return sisters(r, lab, out)


def potting_cures(lab, r):
    x, _, te = fine(lab)
    rate = np.exp(-r.uniform(4500, 6500) * (1 / (te + 273.15) - 1 / 300.0))
    dose = np.cumsum(rate)
    dose *= r.uniform(1.0, 2.5) / dose[-1]
    return sisters(r, lab, np.interp(lab.t, x, 1 - np.exp(-dose)))


def connector_emf(lab, r):
    x, _, te = fine(lab)
    tau = r.uniform(1500, 4500)
    f = np.exp(-20.0 / tau)
    pin = np.empty(len(x))
    pin[0] = te[0]
    for i in range(1, len(x)):
        pin[i] = te[i] + f * (pin[i - 1] - te[i])
    d = np.interp(lab.t, x, pin - te)
    return sisters(r, lab, d * (1 + r.uniform(-0.004, 0.004) * (lab.te - 20)))


def helium_through_glass(lab, r):
    x, ts, _ = fine(lab)
    at = np.searchsorted(lab.t, x)
    at = np.minimum(at, len(lab.t) - 1)
    running = lab.t[at] - x < 1.4 * lab.step
    p = np.where(running, lab.p[at], 0.0)
    rate = np.exp(-r.uniform(1200, 2000) * (1 / (ts + 273.15) - 1 / 280.0))
    rate *= r.uniform(4.0, 9.0) / np.sum(rate * 20.0)
    inside = np.zeros(len(x))
    for i in range(1, len(x)):
        inside[i] = inside[i - 1] + 20.0 * rate[i] * (p[i] - inside[i - 1])
    return sisters(r, lab, -np.interp(lab.t, x, inside) * (lab.ts + 273.15) / 280.0)


def box_breathes(lab, r):
    x, ts, _ = fine(lab)
    tau = r.uniform(1500, 4500)
    k = ts + 273.15
    box = np.empty(len(x))
    box[0] = 14.7
    for i in range(1, len(x)):
        box[i] = box[i - 1] * k[i] / k[i - 1]
        box[i] += (14.7 - box[i]) * (1 - np.exp(-20.0 / tau))
    return sisters(r, lab, np.interp(lab.t, x, box) - 14.7)


def defrost_timer(lab, r):
    x, ts, _ = fine(lab)
    due, lasts, tau = r.uniform(8000, 13000), r.uniform(900, 1500), r.uniform(900, 2000)
    heat = np.zeros(len(x))
    ran, until, state = r.uniform(0, due), -1.0, 0.0
    for i in range(len(x)):
        if x[i] < until:                          # fan stands, the coil is heated, warm air sinks through
            drive = np.clip((15.0 - ts[i]) / 60.0, 0.0, 2.0)
        else:
            drive = 0.0
            ran += 20.0 * (ts[i] < 8.0)           # the timer counts only while the compressor runs
            if ran > due:
                ran, until = 0.0, x[i] + lasts
        state += (drive - state) * 20.0 / tau
        heat[i] = state
    return sisters(r, lab, np.interp(lab.t, x, heat))


def regulator_whistles(lab, r):
    # screech of the jet f = c / (D sqrt(R - 1.9)) meets the tone of the cold line, which goes with the root of its temperature
    back = lab.top * r.uniform(0.06, 0.12)
    meet = back * (1.9 + r.uniform(2.5, 4.5) * 293.15 / (lab.ts + 273.15))
    wide = r.uniform(0.15, 0.28) * meet
    return sisters(r, lab, 1 / (1 + ((lab.p - meet) / wide) ** 2))


EFFECTS = {f.__name__: f for f in (gauge_factor_power, line_lag, potting_cures, connector_emf, helium_through_glass, box_breathes,
                                   defrost_timer, regulator_whistles)}
PAIRS = [("gauge_factor_power", "line_lag"), ("potting_cures", "regulator_whistles"), ("connector_emf", "helium_through_glass")]
ABOUT = {
    "gauge_factor_power": "Everyday. The gauge factor goes with a power of the absolute temperature; the declared parabola leaves pressure times "
                          "the higher powers of temperature. Depends on: pressure and sensor temperature.",
    "line_lag": "Everyday. The gas reaches the transducer through a long thin tube, slower at low pressure; the reading comes before it is "
                "equal. Depends on: move of pressure since the row before, and pressure; matters at low pressure after high.",
    "potting_cures": "Everyday. The potting of the electronics goes on curing and shrinks, faster when warm, until done: zero drift. "
                     "Depends on: time, order, electronics temperature in the past.",
    "connector_emf": "Everyday. Thermal voltage of a heavy connector that follows the electronics chamber late after each change. "
                     "Depends on: time in plot, change of electronics temperature since the plot before.",
    "helium_through_glass": "Unlisted. The test gas is helium; it goes through the glass header into the reference vacuum, faster when warm and at "
                            "high pressure, and out again. Depends on: pressures and sensor temperatures of the past; time, order.",
    "box_breathes": "Unlisted. The tight cold chamber loses pressure when cooled and draws air in slowly; the case is squeezed by the difference. "
                    "Depends on: time in plot, change of sensor temperature since the plot before.",
    "defrost_timer": "Unlisted. A timer that counts the hours of the compressor defrosts its coil now and then: the fan stands and the case gets "
                     "warmer on one side, which the thermometer does not see. Depends on: time (pulses with a tail), larger in the cold.",
    "regulator_whistles": "Unlisted. The jet in the regulator screeches when its tone meets that of the line, and the sensor rectifies it: a hump in "
                          "pressure that moves up in the cold. Depends on: pressure and sensor temperature.",
}
