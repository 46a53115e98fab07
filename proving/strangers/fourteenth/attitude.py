"""Accelerometers or inclinometers on a two-axis stage in Earth's gravity."""
import numpy as np
from .common import ROW_NOISES, Table, assemble, rng, row_noise

NUMBER = 1
NOISES = dict(ROW_NOISES)


def gravity(pitch, roll):
    a, r = np.radians(pitch), np.radians(roll)
    return np.column_stack([np.sin(a), -np.sin(r) * np.cos(a), -np.cos(r) * np.cos(a)])


def laboratory(seed):
    g = rng(NUMBER, seed, 1)
    reps = int(g.integers(3, 7))
    per = int(g.integers(110, 230))
    per = min(per, 1450 // reps)
    sensors = int(g.integers(1, 4))
    span = g.choice([45.0, 60.0, 75.0, 85.0])
    fixed = g.random() < 0.5
    order_kind = g.choice(["drawn", "snake"])
    if fixed:
        levels = int(g.integers(7, 12))
        ps = np.linspace(-span, span, levels)
        rs = np.arange(0, 360, 360 / np.ceil(per / levels))
        grid = np.array([(p, r) for i, p in enumerate(ps) for r in (rs if i % 2 == 0 else rs[::-1])])
        per = len(grid)
    pitch, roll, rep = [], [], []
    for k in range(reps):
        if fixed:
            at = grid[g.permutation(per)] if order_kind == "drawn" else grid[::(-1 if k % 2 else 1)]
        else:
            at = np.column_stack([g.uniform(-span, span, per), g.uniform(0, 360, per)])
        pitch.append(at[:, 0])
        roll.append(at[:, 1])
        rep.append(np.full(per, k + 1))
    digits = int(g.choice([2, 3]))
    pitch = np.round(np.concatenate(pitch), digits)
    roll = np.round(np.concatenate(roll), digits)
    rep = np.concatenate(rep)
    n = len(rep)
    pace = g.uniform(50, 130)
    move = np.abs(np.diff(pitch, prepend=0)) + np.abs(np.diff(roll, prepend=0))
    dt = pace * g.uniform(0.8, 1.2, n) + 0.1 * move
    dt[np.flatnonzero(np.diff(rep, prepend=1))] += g.uniform(3, 14) * 3600
    t = np.round(np.cumsum(dt), 1)
    base = g.uniform(18, 27)
    temp = base + g.uniform(0.8, 3.0) * np.sin(2 * np.pi * t / 86400 + g.uniform(0, 6))
    step = g.normal(0, 0.12, n)
    walk = np.zeros(n)
    for i in range(1, n):
        walk[i] = 0.985 * walk[i - 1] + step[i]
    temp = np.round(temp + walk + g.normal(0, 0.03, n), 2)
    grav = gravity(pitch, roll)
    scale = g.choice([0.5, 1.0, 2.5, 3.5, 5.0])
    sd = scale * g.choice([1e-4, 3e-4, 1e-3])
    moving = g.random() < 0.5
    axes, responses, shifts = [], [], []
    for j in range(sensors):
        main = (j + (int(g.integers(3)) if sensors == 1 else 0)) % 3
        s = g.normal(0, 0.02, 3)
        s[main] = g.choice([-1, 1])
        s = s * scale * g.uniform(0.9, 1.1)
        own = sd * g.uniform(0.8, 1.25) if j else sd
        axes.append(s / np.linalg.norm(s))
        responses.append(("xyz"[j] + "_V", g.normal(0, 0.02 * scale) + grav @ s, own))
        d = g.normal(0, 1.5 * own, (reps, 4)) * moving
        shifts.append(np.sum(d[rep - 1] * np.column_stack([np.ones(n), grav]), axis=1))
    cols = [("replicate", ["%d" % v for v in rep]), ("order", ["%d" % (i + 1) for i in range(n)]),
            ("elapsed_s", ["%.1f" % v for v in t]), ("pitch_deg", ["%.*f" % (digits, v) for v in pitch]),
            ("roll_deg", ["%.*f" % (digits, v) for v in roll]), ("sensor_temperature_degC", ["%.2f" % v for v in temp])]
    away = np.abs(pitch - g.uniform(-span, span)) / span
    forms = [0.4 + 1.6 * np.abs(grav @ axes[0]), 0.4 + 1.3 * away, 0.5 + 1.5 * (t - t[0]) / np.ptp(t),
             np.where(temp > np.median(temp), 1.8, 0.7), 0.5 + 2.0 * move / move.max()]
    return Table(n=n, rep=rep, t=t, pitch=pitch, roll=roll, temp=temp, grav=grav, axes=axes, responses=responses,
                 shifts=shifts, columns=cols, options=[], groups=rep, forms=forms, reps=reps,
                 model=np.column_stack([np.ones(n), grav]))


def encoder_zero(lab, g, j):
    """The zero mark of the pitch encoder sits beside the true level. The sensor is turned by this angle more."""
    off = g.choice([-1, 1]) * g.uniform(0.05, 0.3)
    return (gravity(lab.pitch + off, lab.roll) - lab.grav) @ lab.axes[j]


def gain_temp(lab, g, j):
    """The magnet of the torquer is weaker when warm: the sensor gives more volts for the same gravity."""
    inside = lab.temp.copy()
    for i in range(1, lab.n):
        dt = lab.t[i] - lab.t[i - 1]
        inside[i] = inside[i - 1] + (lab.temp[i] - inside[i - 1]) * (1 - np.exp(-dt / 60.0))
    return (lab.grav @ lab.axes[j]) * (inside - lab.temp.mean())


def torquer_flux(lab, g, j):
    """The current that holds the mass adds to the magnet's field one way and takes from it the other way."""
    force = lab.grav @ lab.axes[j]
    b = g.choice([-1, 1]) * g.uniform(0.01, 0.03)
    i = force.copy()
    for _ in range(30):
        i = force / (1 + b * i)
    return i - force


def pendulum_turn(lab, g, j):
    """The pendulum swings a little under load: its input axis turns toward the pendulous axis."""
    a = lab.axes[j]
    other = np.roll(np.eye(3)[int(np.argmax(np.abs(a)))], 1 + int(g.integers(2)))
    other = other - a * (a @ other)
    other /= np.linalg.norm(other)
    swing = np.zeros(lab.n)
    k = g.choice([-1, 1]) * 0.01
    for _ in range(20):
        swing = k * (np.cos(swing) * (lab.grav @ a) + np.sin(swing) * (lab.grav @ other))
    return np.cos(swing) * (lab.grav @ a) + np.sin(swing) * (lab.grav @ other) - lab.grav @ a


def tilted(lab, j, tip, lean):
    """What the sensor sees when the base tips (about the pitch axis) and leans (across it), small angles in rad."""
    a, r = np.radians(lab.pitch), np.radians(lab.roll)
    dp = np.column_stack([np.cos(a), np.sin(r) * np.sin(a), np.cos(r) * np.sin(a)])
    side = np.column_stack([np.zeros(lab.n), np.cos(r), -np.sin(r)])
    return (dp * tip[:, None] + side * lean[:, None]) @ lab.axes[j]


def harbour_tide(lab, g, j):
    """The quay bends under the water of the harbour: the building tilts with moon and sun."""
    p = g.uniform(0, 2 * np.pi, 2)
    level = np.cos(2 * np.pi * lab.t / 44714 + p[0]) + g.uniform(0.2, 0.4) * np.cos(2 * np.pi * lab.t / 43200 + p[1])
    w = g.uniform(0, 2 * np.pi)
    return tilted(lab, j, np.cos(w) * level * 1e-4, np.sin(w) * level * 1e-4)


def fingerprint(lab, g, j):
    """A finger touched the glass disc of the roll encoder: in this sector the grating reads a little too far."""
    at, half = g.uniform(0, 360), g.uniform(14, 28)
    d = (lab.roll - at + 180) % 360 - 180
    off = g.choice([-1, 1]) * 0.05 * np.exp(-0.5 * (d / half) ** 2)
    return (gravity(lab.pitch, lab.roll + off) - lab.grav) @ lab.axes[j]


def train_timetable(lab, g, j):
    """Goods trains pass on a timetable. The vertical shaking is rectified by the sensor's square term."""
    every, first, long_s = g.choice([1200.0, 1800.0, 2400.0]), g.uniform(0, 1200), g.uniform(240, 420)
    number = np.floor((lab.t - first) / every).astype(int)
    phase = (lab.t - first) - number * every
    weight = g.uniform(0.7, 1.3, number.max() - number.min() + 1)[number - number.min()]
    shake = weight * np.clip(np.sin(np.pi * phase / long_s), 0, None) ** 0.5 * (phase < long_s)
    return shake ** 2 * (0.15 + (lab.grav @ lab.axes[j]) ** 2)


def oil_sump(lab, g, j):
    """Thick oil in the gear housing flows to the low side in minutes. Its weight tips the stage until it has come to rest."""
    tau = g.uniform(1.2, 3.0) * float(np.median(np.diff(lab.t)))
    low = -lab.grav[:, [0, 1]]
    oil = low.copy()
    for i in range(1, lab.n):
        keep = np.exp(-(lab.t[i] - lab.t[i - 1]) / tau)
        oil[i] = low[i] + (oil[i - 1] - low[i]) * keep
    k = g.choice([-1, 1], 2) * g.uniform(0.5, 1.0, 2) * 1e-4
    return tilted(lab, j, k[0] * oil[:, 0], k[1] * oil[:, 1])


EFFECTS = {f.__name__: f for f in (encoder_zero, gain_temp, torquer_flux, pendulum_turn,
                                   harbour_tide, fingerprint, train_timetable, oil_sump)}
PAIRS = [("gain_temp", "fingerprint"), ("torquer_flux", "train_timetable"), ("pendulum_turn", "oil_sump")]
ABOUT = {
    "encoder_zero": "Everyday. The pitch encoder has a wrong zero: all pitches are off by one small angle. Depends on pitch and roll (the "
                    "derivative of gravity to pitch). Matters always, most where the sensor is across gravity.",
    "gain_temp": "Everyday. Sensitivity goes with sensor temperature. Depends on gravity along the sensor times temperature. Matters as the "
                 "temperature moves.",
    "torquer_flux": "Everyday. The holding current changes the magnet's flux: a square term. Depends on gravity along the sensor. Matters near "
                    "1 g.",
    "pendulum_turn": "Everyday. The pendulum's deflection turns the input axis: product of gravity along the sensor and along one cross axis. "
                     "Depends on pitch and roll.",
    "harbour_tide": "Unlisted. The building tilts with the tide of the harbour, 12.42 and 12.00 h. Depends on time, and on pitch and roll as "
                    "the tilt is fixed to the room.",
    "fingerprint": "Unlisted. Grease on a sector of the roll encoder's disc. Depends on roll (a bump in one sector), times the derivative of "
                   "gravity to roll.",
    "train_timetable": "Unlisted. Trains pass on a timetable; the sensor rectifies the vertical shaking. Depends on time (pulses of a fixed "
                       "period), and on gravity along the sensor squared.",
    "oil_sump": "Unlisted. Thick oil in the gear housing lags behind the attitude and tips the stage. Depends on the present and the previous "
                "attitudes, the move and the time since.",
}


def table(effects, seed, size, noise="white"):
    lab = laboratory(seed)
    form = lab.forms[int(rng(NUMBER, seed, 9).integers(len(lab.forms)))]

    def error(name, g, j):
        return row_noise(name, g, lab.n, form)

    return assemble(lab, effects, size, noise, NUMBER, seed, EFFECTS, list(EFFECTS), NOISES, error)
