"""Servo accelerometers on a dividing head."""
import numpy as np

from . import common as c


class Lab:
    pass


def laboratory(seed):
    rng = c.stream("attitude", seed, "design")
    lab = Lab()
    while True:
        step = float(rng.choice([15, 20, 30]))
        top = float(rng.choice([90, 180, 180]))
        if top == 90 and step == 20:
            step = 15.0
        pitches = np.arange(-top, top + 0.1, step)
        rolls = [np.array([-180.0, -90, 0, 90]), np.array([-135.0, -90, -45, 0, 45, 90, 135, 180]), np.arange(-150.0, 181, 30),
                 np.arange(-120.0, 181, 60), np.array([-180.0, -90, 0, 90, 180])][rng.integers(0, 5)]
        reps = int(rng.integers(3, 7))
        if 300 <= len(pitches) * len(rolls) * reps <= 1500:
            break
    style = ["random", "random", "up-down", "random rolls, up-down pitch"][rng.integers(0, 4)]
    base = rng.uniform(18, 45)
    rep, pitch, roll, t = [], [], [], []
    now = 0.0
    for k in range(reps):
        if style == "random":
            points = [(a, b) for a in pitches for b in rolls]
            points = [points[i] for i in rng.permutation(len(points))]
        else:
            order = rolls if style == "up-down" else rng.permutation(rolls)
            if style == "up-down" and k % 2:
                order = order[::-1]
            points = [(a, b) for j, b in enumerate(order) for a in (pitches if (j + k) % 2 == 0 else pitches[::-1])]
        for a, b in points:
            now += base * np.exp(0.22 * rng.standard_normal())
            rep.append(k + 1), pitch.append(a), roll.append(b), t.append(round(now, 1))
        now += rng.uniform(1200, 9000) if rng.random() < 0.7 else rng.uniform(40000, 60000)
    lab.rep, lab.pitch, lab.roll, lab.t = np.array(rep), np.array(pitch), np.array(roll), np.array(t)
    n = lab.n = len(rep)
    lab.order = np.arange(1, n + 1)
    lab.restart = np.concatenate([[True], lab.rep[1:] != lab.rep[:-1]])
    p, r = np.radians(lab.pitch), np.radians(lab.roll)
    lab.p, lab.r = p, r
    lab.g = np.column_stack([np.sin(p), np.cos(p) * np.sin(r), np.cos(p) * np.cos(r)])
    # what a small turn about the axis of pitch adds, per radian, and one about the axis of roll
    lab.turn_pitch = np.column_stack([np.cos(p), -np.sin(p) * np.sin(r), -np.sin(p) * np.cos(r)])
    lab.sensors = int(rng.integers(1, 4))
    lab.g, lab.turn_pitch = lab.g[:, :], lab.turn_pitch[:, :lab.sensors]
    lab.scale = rng.uniform(1.0, 5.0, 1) * np.exp(0.05 * rng.standard_normal(lab.sensors))
    lab.scale = np.atleast_1d(lab.scale)
    lab.sigma = float(lab.scale[0] * 10 ** rng.uniform(-5.3, -4.1))
    phase, tau = rng.uniform(0, 2 * np.pi), rng.uniform(4000, 20000)
    temp = rng.uniform(20, 26) + rng.uniform(0.05, 0.3) * np.sin(2 * np.pi * lab.t / tau + phase) + 0.01 * rng.standard_normal(n)
    temp = temp + 0.1 * np.cumsum(rng.standard_normal(n)) / np.sqrt(n)
    lab.temp = np.round(temp, 3)
    lab.axes = []
    volts = []
    for k in range(lab.sensors):
        bias = rng.normal(0, 0.004)
        mis = rng.normal(0, 0.002, 3)
        v = np.zeros(n)
        own = rng.random() < 0.6
        for q in np.unique(lab.rep):
            rows = lab.rep == q
            b, m = bias, mis
            if own:
                s = 2.0 * lab.sigma / lab.scale[0]
                b, m = bias + s * rng.standard_normal(), mis + 0.7 * s * rng.standard_normal(3)
            axis = np.eye(3)[k] + m
            v[rows] = lab.scale[k] * (b + lab.g[rows] @ axis)
        volts.append(v)
    lab.volts = np.column_stack(volts)
    d = c.dummies(lab.rep)
    lab.design = np.column_stack([d] + [d * lab.g[:, [j]] for j in range(3)])
    return lab


def _shortest(step):
    s = (step + 180.0) % 360.0 - 180.0
    return np.where((s == -180.0) & (step > 0), 180.0, s)


def _moves(lab, v):
    m = np.concatenate([[0.0], np.diff(v)])
    m[lab.restart] = 0.0
    return m


def cable_flop(lab, rng):
    high, low = rng.uniform(5, 80), rng.uniform(-110, -20)
    return c.schmitt(lab.roll, low, high, int(rng.integers(0, 2)))[:, None] * lab.turn_pitch


def cable_windup(lab, rng):
    turns = np.zeros(lab.n)
    step = _shortest(_moves(lab, lab.roll))
    for i in range(1, lab.n):
        turns[i] = 0.0 if lab.restart[i] else turns[i - 1] + step[i] / 360.0
    slack = rng.uniform(0.1, 0.4)
    return (np.sign(turns) * np.maximum(np.abs(turns) - slack, 0.0))[:, None] * lab.turn_pitch


def big_move_overshoot(lab, rng):
    m = _moves(lab, lab.pitch)
    limit = np.quantile(np.abs(m[m != 0]), rng.uniform(0.3, 0.6)) - 1e-6
    return (np.sign(m) * (np.abs(m) >= limit))[:, None] * lab.turn_pitch


def warm_hand(lab, rng):
    touch = np.abs(_shortest(_moves(lab, lab.roll))) / 90.0
    tau, warm, w = rng.uniform(90, 300), 0.0, np.zeros(lab.n)
    lag = rng.uniform(8, 16)
    for i in range(lab.n):
        dt = lab.t[i] - lab.t[i - 1] if i else 1e9
        warm = warm * np.exp(-dt / tau) + touch[i] * np.exp(-max(min(dt, 60.0) - lag, 0.0) / tau)
        w[i] = warm
    out = np.zeros((lab.n, lab.sensors))
    for k in range(lab.sensors):
        out[:, k] = w * (rng.choice([-1, 1]) * rng.uniform(0.7, 1.3) + 0.6 * rng.standard_normal() * lab.g[:, k])
    return out


def torquer_memory(lab, rng):
    tau = rng.uniform(60, 220)
    g = lab.g[:, :lab.sensors]
    return np.column_stack([g[:, k] * c.low_pass(g[:, k] ** 2, lab.t, tau, 0.3, lab.restart) for k in range(lab.sensors)])


def pivot_play(lab, rng):
    out = np.zeros((lab.n, lab.sensors))
    for k in range(lab.sensors):
        half, y = rng.uniform(0.05, 0.35), 0.0
        for i in range(lab.n):
            g = lab.g[i, k]
            y = min(max(y, g - half), g + half)
            out[i, k] = y - g
    return out


def pier_aircon(lab, rng):
    period, duty, tau = rng.uniform(1000, 2600), rng.uniform(0.3, 0.6), rng.uniform(150, 500)
    offset = rng.uniform(0, period)
    grid = np.arange(0.0, lab.t[-1] + 20.0, 10.0)
    on = ((grid + offset) % period) < duty * period
    tilt, y = np.empty(len(grid)), duty
    for i, a in enumerate(on):
        y += (float(a) - y) * (1 - np.exp(-10.0 / tau))
        tilt[i] = y
    return np.interp(lab.t, grid, tilt)[:, None] * lab.turn_pitch


def compressor_rectification(lab, rng):
    on, now = np.zeros(lab.n, bool), rng.uniform(0, 900)
    while now < lab.t[-1]:
        run = rng.uniform(400, 900)
        on |= (lab.t >= now) & (lab.t < now + run)
        now += run + rng.uniform(900, 2200)
    other = [2, 0, 1]
    return np.column_stack([on * lab.g[:, k] * lab.g[:, other[k]] for k in range(lab.sensors)])


def bearing_clearance(lab, rng):
    moment = np.cos(lab.p + rng.uniform(-0.5, 0.5)) + rng.uniform(0.2, 0.7) * np.cos(lab.p) * np.cos(lab.r + rng.uniform(0, 6.28)) \
        + rng.uniform(-0.35, 0.35)
    return np.tanh(rng.uniform(4, 12) * moment)[:, None] * lab.turn_pitch


def autorange_step(lab, rng):
    out = np.zeros((lab.n, lab.sensors))
    part, gain, off = rng.uniform(0.4, 0.75), rng.choice([-1, 1]), rng.uniform(-0.5, 0.5)
    for k in range(lab.sensors):
        v = np.abs(lab.volts[:, k]) / lab.scale[0]
        up = c.schmitt(v, rng.uniform(0.6, 0.9) * part, part)
        out[:, k] = up * (gain * lab.volts[:, k] / lab.scale[k] + off)
    return out


EFFECTS = {f.__name__: f for f in (cable_flop, cable_windup, big_move_overshoot, warm_hand, torquer_memory, pivot_play, pier_aircon,
                                   compressor_rectification, bearing_clearance, autorange_step)}
PAIRS = [("cable_flop", "torquer_memory"), ("pier_aircon", "autorange_step"), ("warm_hand", "pivot_play"),
         ("big_move_overshoot", "bearing_clearance"), ("compressor_rectification", "cable_windup"),
         ("torquer_memory", "big_move_overshoot"), ("pier_aircon", "bearing_clearance")]
ABOUT = {
    "cable_flop": "The sensor's cable bundle hangs on the roll stage and falls over to the other side when the roll goes above one angle; it falls "
    "back only below another, lower angle. Its weight tilts the fixture about the axis of pitch by a constant angle while it lies on that side, so "
    "the output changes with cos(pitch) for x. Depends on roll and its history (which side the roll came from), and pitch. In all sensors.",
    "cable_windup": "The operator turns the roll by the shorter way, so the cable winds up round the roll axis by whole turns within a replication "
    "(it is unwound before each). Beyond some slack its torque twists the fixture in pitch in proportion to the accumulated turns. Depends on the "
    "history of roll moves (sum of shortest moves since the start of the replication), times cos(pitch) for x. In all sensors.",
    "big_move_overshoot": "After a long move of the pitch crank the operator overshoots and the detent seats on the far flank: a pitch error of fixed "
    "size with the sign of the move, only if the move in pitch was longer than a limit. Depends on the move in pitch since the row before, times "
    "cos(pitch) for x. In designs whose moves are all of one length it is plain backlash. In all sensors.",
    "warm_hand": "To change the roll the operator reaches into the fixture and warms the sensor block with his hand: bias and scale factor shift in "
    "proportion to how far the roll was turned and decay with 1.5 to 5 minutes; touches add up. The recorded thermometer is elsewhere and does not "
    "see it. Depends on the time since roll changes and their length (move in roll, recent history). In all sensors with own coefficients.",
    "torquer_memory": "The torquer coil of the servo is heated by its own current: the scale factor follows the square of the sensed gravity with a "
    "thermal lag of 1 to 4 minutes. Depends on gravity along the sensor now and in the preceding rows (at rest it would be cubic in gravity). Each sensor.",
    "pivot_play": "Friction in the pivot of the proof mass: the output follows gravity along the sensor only after a dead band (play, 0.05 to 0.35 g "
    "half width), so it lags by the half width with the sign of the last large change. Depends on gravity along the sensor and the side it came from. Each sensor.",
    "pier_aircon": "The air conditioner runs in cycles of 17 to 43 minutes and its on-off cooling tilts the pier of the dividing head about the axis of "
    "pitch, rising and falling exponentially (rounded sawtooth). Depends on time (periodic), times cos(pitch) for x. In all sensors.",
    "compressor_rectification": "A compressor next door runs for 7 to 15 minutes at irregular intervals; its vertical vibration is rectified by the pendulous "
    "mass, which adds a constant times the product of gravity along the sensing axis and along the pendulous axis (for x: x and z) while it runs. "
    "Depends on time (windows) and on pitch and roll (product of gravity components).",
    "bearing_clearance": "The pitch bearing has clearance: the spindle rests on one side or the other according to the sign of the moment of the payload, "
    "which depends on pitch and, as the payload is eccentric, on roll. The pitch is wrong by plus or minus a fixed angle with a sharp change-over. "
    "Depends on pitch and roll only (no history). In all sensors.",
    "autorange_step": "The voltmeter ranges automatically: above a voltage it goes to the next range, whose gain and offset are a bit wrong, and comes back "
    "only below a lower voltage. Depends on the magnitude of the output (gravity along the sensor), with hysteresis in a band between. Each sensor.",
}
NOISES = {"white": c.white, "heavy": c.heavy, "level": c.with_level, "quantised": c.quantised, "ar1": c.ar1, "sessions": c.sessions,
          "outliers": c.outliers, "bursts": c.bursts, "hum": c.hum}


def table(effects, seed, size, noise):
    lab = laboratory(seed)
    parts, sizes = c.scaled(EFFECTS, effects, lab, "attitude", seed, lab.design, lab.sigma, size, lab.scale)
    total = sum(parts.values(), np.zeros((lab.n, lab.sensors)))
    rng = c.stream("attitude", seed, "noise", noise)
    columns = []
    for k in range(lab.sensors):
        sigma = lab.sigma * lab.scale[k] / lab.scale[0]
        v = lab.volts[:, k]
        level = np.abs(v) / np.abs(v).max()
        y = v + total[:, k] + sigma * NOISES[noise](rng, level, lab.rep)
        if noise == "quantised":
            y = np.round(y / (c.QUANTUM * sigma)) * c.QUANTUM * sigma
        columns.append(y)
    d = c.digits(lab.sigma)
    csv = c.text(["replicate", "order", "elapsed_s", "pitch_deg", "roll_deg", "sensor_temperature_degC"] + ["x_V", "y_V", "z_V"][:lab.sensors],
                 [lab.rep, lab.order, lab.t, lab.pitch, lab.roll, lab.temp] + columns, [0, 0, 1, 1, 1, 3] + [d] * lab.sensors)
    return csv, [], total[:, 0], lab.sigma, {k: v[:, 0] for k, v in parts.items()}, sizes
