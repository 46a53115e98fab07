"""Inertial sensors on a dividing head."""
import numpy as np
from ._core import stream

KIND = "attitude"


def short(a, b):
    """Shortest turn from a to b, degrees, in (-180, 180]."""
    t = np.mod(b - a + 180.0, 360.0) - 180.0
    return np.where(t == -180.0, 180.0, t)


def design(seed):
    rng = stream(KIND, seed, "design")
    style = rng.choice(["grid random", "grid snake", "grid plain", "sphere", "circles"])
    reps = int(rng.integers(3, 7))
    if style == "sphere":
        m = int(rng.integers(105, 240))
        base_p = np.degrees(np.arcsin(rng.uniform(-1, 1, m)))
        base_r = rng.uniform(0, 360, m)
        base_p, base_r = np.round(base_p, 1), np.round(base_r, 1)
    else:
        np_, nr = [(11, 12), (7, 16), (7, 18), (11, 16), (7, 24), (9, 15), (13, 18)][int(rng.integers(7))]
        top = {7: [67.5, 90.0, 60.0], 9: [60.0, 80.0, 72.0], 11: [75.0, 90.0, 50.0], 13: [90.0, 72.0, 60.0]}[np_]
        pitches = np.linspace(-1, 1, np_) * top[int(rng.integers(3))]
        rolls = np.arange(nr) * 360.0 / nr
        base_p, base_r = [], []
        for i, p in enumerate(pitches):
            rr = rolls[::-1] if style in ("grid snake", "circles") and i % 2 else rolls
            base_p.extend([p] * nr)
            base_r.extend(rr)
        base_p, base_r = np.array(base_p), np.array(base_r)
    m = len(base_p)
    while m * reps > 1500:
        reps -= 1
    jitter = rng.choice([0.0, 0.0, 0.02, 0.4])
    same = rng.random() < 0.4
    fixed = rng.permutation(m)
    back = rng.random() < 0.5
    pitch, roll, rep = [], [], []
    for k in range(reps):
        if style in ("grid random", "sphere"):
            at = fixed if same else rng.permutation(m)
        elif style == "circles":
            blocks = rng.permutation(m // nr)
            at = np.concatenate([np.arange(b * nr, (b + 1) * nr) for b in blocks])
        else:
            at = np.arange(m)
        if back and k % 2:
            at = at[::-1]
        pitch.append(base_p[at])
        roll.append(base_r[at])
        rep.append(np.full(m, k + 1))
    pitch, roll, rep = map(np.concatenate, (pitch, roll, rep))
    n = len(pitch)
    pitch = np.round(np.clip(pitch + jitter * rng.standard_normal(n), -90, 90), 4)
    roll = np.round(np.mod(roll + jitter * rng.standard_normal(n), 360.0), 4)
    # time: a move, then a wait
    turn_p = np.abs(np.diff(pitch, prepend=0.0))
    turn_r = np.abs(short(np.concatenate([[0.0], roll[:-1]]), roll))
    speed = rng.uniform(4, 12)
    wait = rng.uniform(15, 60)
    gap = (turn_p + turn_r) / speed + wait + rng.exponential(0.15 * wait, n)
    rest = np.zeros(n)
    starts = np.flatnonzero(np.diff(rep, prepend=0))
    for s in starts[1:]:
        rest[s] = rng.choice([1200.0, 3600.0, 14 * 3600.0]) * rng.uniform(0.8, 1.2)
    t = np.round(np.cumsum(gap + rest), 1)
    # temperature: the room's day, its control, self heating after every start, and the laboratory's plan
    t0 = np.concatenate([np.full(np.sum(rep == k + 1), t[s]) for k, s in enumerate(starts)])
    plan = rng.choice(["room", "chamber", "open door"])
    temp = rng.uniform(19, 25) + rng.uniform(0.4, 1.5) * np.sin(2 * np.pi * (t / 86400 + rng.random()))
    temp = temp + rng.uniform(0.1, 0.5) * np.sin(2 * np.pi * t / rng.uniform(1500, 5000) + 6 * rng.random())
    temp = temp + rng.uniform(0.5, 2.0) * (1 - np.exp(-(t - t0) / rng.uniform(1200, 4000)))
    if plan == "chamber":
        temp = temp + (rng.permutation(reps) * rng.uniform(3, 9))[rep - 1]
    if plan == "open door":
        for _ in range(int(rng.integers(3, 7))):
            at = t[int(rng.integers(n))]
            temp = temp - rng.uniform(0.5, 1.5) * np.where(t > at, np.exp(-(t - at) / 900.0), 0.0)
    temp = np.round(temp + 0.03 * rng.standard_normal(n), 2)
    # the sensors
    a, r = np.radians(pitch), np.radians(roll)
    g = np.column_stack([np.sin(a), -np.sin(r) * np.cos(a), -np.cos(r) * np.cos(a)])
    tilt = np.column_stack([np.cos(a), np.sin(r) * np.sin(a), np.cos(r) * np.sin(a)])   # dg / d pitch
    k = int(rng.choice([1, 1, 3, 3, 2]))
    gain = rng.uniform(1.2, 5.0, 3)
    mis = np.eye(3) + rng.normal(0, 0.012, (3, 3)) * (1 - np.eye(3))
    matrix = (gain[:, None] * mis)[:k]
    sd = gain[:k] * 10 ** rng.uniform(-5, -4)
    offset = rng.normal(0, 0.05, k)[None, :] + (rng.standard_normal((reps, k)) * 8 * sd)[rep - 1]
    clean = offset + g @ matrix.T
    names = ["x_V", "y_V", "z_V"][:k]
    order = np.arange(1, n + 1)
    columns = [("replicate", rep, None), ("order", order, None), ("elapsed_s", t, 1), ("pitch_deg", pitch, 4),
               ("roll_deg", roll, 4), ("sensor_temperature_degC", temp, 2)]
    return dict(rep=rep, order=order, t=t, t0=t0, pitch=pitch, roll=roll, temp=temp, g=g, tilt=tilt, matrix=matrix,
                clean=clean, sd=sd, columns=columns, responses=names, options=[], grow=np.abs(g[:, 0]),
                noise_groups=rep, groups=rep, model=np.column_stack([np.ones(n), g]), starts=starts)


def temperature_scale(d, rng):
    return (d["temp"] - 20.0)[:, None] * d["g"]


def warm_up(d, rng):
    tau = rng.uniform(500, 1800)
    return np.exp(-(d["t"] - d["t0"]) / tau)


def own_square(d, rng):
    return d["g"] ** 2


def cable_windup(d, rng):
    n = len(d["roll"])
    wind = np.zeros(n)
    for i in range(n):
        if i in d["starts"]:
            w = float(short(0.0, d["roll"][i]))
        else:
            step = float(short(d["roll"][i - 1], d["roll"][i]))
            w = wind[i - 1] + step
            if abs(w) > 540.0:
                w -= np.sign(step) * 360.0
        wind[i] = w
    slack = np.quantile(np.abs(wind), rng.uniform(0.4, 0.65))
    pull = np.maximum(np.abs(wind) - slack, 0.0) * np.sign(wind) / 360.0
    return pull[:, None] * (d["tilt"] @ d["matrix"].T)


def trapped_bubble(d, rng):
    limit = rng.uniform(0.45, 0.75)
    down = d["g"][:, 2]
    side = np.empty(len(down))
    now = -1.0
    for i, v in enumerate(down):
        if i in d["starts"]:
            now = -1.0
        if v > limit:
            now = 1.0
        elif v < -limit:
            now = -1.0
        side[i] = now
    return side[:, None] * np.array([1.0, 0.5, -0.7])


def brake_heat(d, rng):
    tau = rng.uniform(400, 1300)
    n = len(d["t"])
    turn = np.abs(np.diff(d["pitch"], prepend=d["pitch"][0]))
    turn = turn + np.abs(short(np.concatenate([d["roll"][:1], d["roll"][:-1]]), d["roll"]))
    turn[d["starts"]] = 0.0
    heat = np.zeros(n)
    for i in range(1, n):
        heat[i] = heat[i - 1] * np.exp(-(d["t"][i] - d["t"][i - 1]) / tau) + turn[i]
    return heat / 100.0


def ghost_of_neighbour(d, rng):
    every = int(rng.choice([3, 4, 5, 7]))
    phase = int(rng.integers(every))
    ghost = np.vstack([d["g"][:1], d["g"][:-1]])[:, [1, 2, 0]]
    ghost[d["starts"]] = 0.0
    ghost[d["order"] % every != phase] = 0.0
    return ghost


def sun_on_one_face(d, rng):
    n = len(d["t"])
    noon = d["t"][int(rng.integers(n // 5, n - n // 5))]
    width = rng.uniform(2000, 4500)
    away = np.mod(d["t"] - noon + 43200.0, 86400.0) - 43200.0
    facing = np.maximum(0.0, np.cos(np.radians(d["roll"] - rng.uniform(0, 360)))) * np.cos(np.radians(d["pitch"]))
    return (np.exp(-0.5 * (away / width) ** 2) * facing)[:, None] * np.array([1.0, -0.6, 0.8])


EFFECTS = {f.__name__: f for f in (temperature_scale, warm_up, own_square, cable_windup, trapped_bubble, brake_heat,
                                   ghost_of_neighbour, sun_on_one_face)}
PAIRS = [("temperature_scale", "trapped_bubble"), ("warm_up", "cable_windup"),
         ("ghost_of_neighbour", "sun_on_one_face")]
ABOUT = {
    "temperature_scale": "Everyday: volts per g change linearly with the sensor's temperature: (T - 20) times the axis' own"
    " component of gravity. Depends on sensor_temperature_degC, pitch_deg (x), roll_deg (y, z). Matters when the temperature"
    " moves within a replication.",
    "warm_up": "Everyday: the offset settles exponentially after power comes on at the start of every replication, time"
    " constant 500 to 1800 s. Depends on elapsed_s since the replication's first row. Matters in its first rows.",
    "own_square": "Everyday: a term in the square of the axis' own component of gravity (even nonlinearity). Depends on"
    " pitch_deg (x), with roll_deg (y, z). Matters near +1 and -1 g.",
    "cable_windup": "Unlisted: the cable winds on the head with the signed turns of roll (the head takes the shorter way, but"
    " stays within 540 degrees, straightened at each replication's start); past its slack (40 to 65 % quantile) it pulls the"
    " package in pitch in proportion to the excess, in the sense of the winding: excess times cos(pitch) for x. Depends on the"
    " history of roll_deg in executed order, and on pitch_deg. Matters after many turns one way.",
    "trapped_bubble": "Unlisted: a bubble in the damping fluid is at one of two sides; it crosses only when the third component"
    " of gravity passes a limit (0.45 to 0.75 g) of the other sign, else it stays: a latch, and the offset is plus or minus."
    " Depends on pitch_deg and roll_deg of this and earlier rows. Matters at attitudes between the limits.",
    "brake_heat": "Unlisted: motors and brake of the head warm the mounting plate in proportion to recent travel: a leaky sum of"
    " |turns| in pitch and roll, time constant 400 to 1300 s, shifts the offset. Depends on the history of pitch_deg, roll_deg"
    " and elapsed_s. Matters where large and small moves alternate.",
    "ghost_of_neighbour": "Unlisted: the logger's scan restarts every 3rd, 4th, 5th or 7th reading, and on those rows the"
    " converter still holds a little charge of the neighbouring axis' channel (y for x, z for y, x for z) from the reading"
    " before; none in a replication's first row. Depends on order (modulo), and pitch_deg, roll_deg of the row before."
    " Matters on those rows when the neighbour was far from level.",
    "sun_on_one_face": "Unlisted: for an hour or two of the day (Gaussian, sd 2000 to 4500 s, each 24 h) the sun shines on one"
    " face of the package: max(0, cos(roll - R0)) cos(pitch) times the hour's weight. Depends on elapsed_s (modulo a day),"
    " roll_deg and pitch_deg together. Matters in that hour only.",
}
NOISES = {
    "white": "normal, independent", "heavy_tails": "Student's t, 3 degrees of freedom",
    "ar1": "AR(1) in executed order, coefficient 0.55 to 0.92", "flicker": "1/f in executed order, some white with it",
    "growing": "sd grows with |x|'s component of gravity", "bursts": "2 to 5 short stretches of 4 to 8 times the sd",
    "skew": "gamma, shape 1.3, centred", "rounded": "display's step of about 1.8 sd",
    "by_replication": "sd differs by replication",
}
