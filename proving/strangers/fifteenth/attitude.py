"""Accelerometers on a stage that pitches and rolls in Earth's gravity."""

import numpy as np

from . import common
from .common import Table, assemble, relax, rng, row_noise

NUMBER = 1
NOISES = dict(common.NOISES)
HOUR = 3600.0


def gravity(pitch, roll):
    a, r = np.radians(pitch), np.radians(roll)
    return np.column_stack([np.sin(a), -np.sin(r) * np.cos(a), -np.cos(r) * np.cos(a)])


def positions(g, kind, per, span):
    """One replication: random attitudes, layers of pitch with a regular roll, or a spiral over the sphere."""
    if kind == "random":
        return g.uniform(-span, span, per), g.uniform(0, 360, per)
    if kind == "layers":
        levels = int(g.integers(9, 15))
        turn = int(np.ceil(per / levels))
        layer = np.repeat(np.arange(levels), turn)[:per]
        p = -span + 2 * span * (layer + g.uniform(0.1, 0.9, per)) / levels
        r = (np.tile(np.arange(turn), levels)[:per] * 360.0 / turn + 360.0 / turn * g.random()) % 360
        return p, r
    s = np.sin(np.radians(span)) * (2 * (np.arange(per) + 0.5) / per - 1)
    at = g.permutation(per)
    return np.degrees(np.arcsin(s))[at], ((np.arange(per) * 222.4922 + g.uniform(0, 360)) % 360)[at]


def laboratory(seed):
    g = rng(NUMBER, seed, 1)
    reps = int(g.integers(3, 7))
    per = min(int(g.integers(80, 240)), 1400 // reps)
    per = max(per, 105)
    sensors = int(g.choice([1, 1, 2, 3]))
    span = float(g.choice([40.0, 55.0, 70.0, 80.0, 88.0]))
    kind = str(g.choice(["random", "layers", "spiral"]))
    there_and_back = bool(g.random() < 0.5)
    pitch, roll = [], []
    for k in range(reps):
        p, r = positions(g, kind, per, span)
        if there_and_back and k % 2:
            p, r = p[::-1], r[::-1]
        pitch.append(p)
        roll.append(r)
    digits = int(g.choice([2, 3, 4]))
    pitch = np.round(np.concatenate(pitch), digits)
    roll = np.round(np.concatenate(roll), digits) % 360
    n = reps * per
    rep = np.repeat(np.arange(reps), per)
    first = np.arange(n) % per == 0
    dt = g.uniform(40, 110) * g.uniform(0.8, 1.3, n) + np.abs(np.diff(pitch, prepend=0)) * g.uniform(0.05, 0.3)
    pause = np.where(first, g.uniform(1.5, 12, n) * HOUR, 0)
    t = np.round(np.cumsum(dt + pause), 1)
    fine = np.arange(0, t[-1] + 60, 30.0)
    air = g.uniform(19, 26) + g.uniform(0.5, 2.0) * np.sin(2 * np.pi * fine / 86400 + g.uniform(0, 6.28))
    air = air + g.uniform(0.15, 0.4) * np.sin(2 * np.pi * fine / (g.uniform(0.6, 1.1) * HOUR) + g.uniform(0, 6.28))
    slow = 0.0
    weather = np.empty(len(fine))
    for i in range(len(fine)):
        slow += -slow * 30 / 9000 + g.normal(0, 0.05)
        weather[i] = slow
    air = relax(air + weather, fine, 600.0)
    temp = np.interp(t, fine, air)
    grav = gravity(pitch, roll)
    volts = float(g.choice([0.4, 1.0, 2.0, 5.0]))
    sd = volts * float(g.choice([5e-5, 2e-4, 6e-4]))
    skewed = bool(g.random() < 0.4)
    turn, _ = np.linalg.qr(g.normal(0, 1, (3, 3)))
    while skewed and np.min(np.abs(turn)) < 0.2:
        turn, _ = np.linalg.qr(g.normal(0, 1, (3, 3)))
    main = [[1, 2, 0], [2, 1, 0]][int(g.integers(2))]
    moving = bool(g.random() < 0.5)
    axes, gains, responses, shifts = [], [], [], []
    for j in range(sensors):
        v = turn[j] if skewed else g.choice([-1.0, 1.0]) * np.eye(3)[main[j]] + g.normal(0, 0.015, 3)
        v = v / np.linalg.norm(v)
        own = sd * (g.uniform(0.7, 1.4) if j else 1.0)
        gain = volts * g.uniform(0.9, 1.1)
        axes.append(v)
        gains.append(gain)
        responses.append(("xyz"[j] + "_V", g.normal(0, 0.01 * volts) + gain * (grav @ v), own))
        d = g.normal(0, own, (reps, 4)) * moving
        shifts.append(np.sum(d[rep] * np.column_stack([np.ones(n), grav]), axis=1))
    columns = [
        ("replicate", ["%d" % (v + 1) for v in rep]),
        ("order", ["%d" % (i + 1) for i in range(n)]),
        ("elapsed_s", ["%.1f" % v for v in t]),
        ("pitch_deg", ["%.*f" % (digits, v) for v in pitch]),
        ("roll_deg", ["%.*f" % (digits, v) for v in roll]),
        ("sensor_temperature_degC", ["%.3f" % v for v in temp + g.normal(0, 0.003, n)]),
    ]
    return Table(
        n=n, rep=rep, first=first, pause=pause, t=t, pitch=pitch, roll=roll, fine=fine, air=air, grav=grav, axes=axes,
        gains=gains, responses=responses, shifts=shifts, columns=columns, options=[], groups=rep, span=span,
        model=np.column_stack([np.ones(n), grav]),
    )  # fmt: skip


def seen(lab, j, pitch_off, roll_off):
    """Volts that sensor j gives more when stage angles are not what the encoders say."""
    return lab.gains[j] * ((gravity(lab.pitch + pitch_off, lab.roll + roll_off) - lab.grav) @ lab.axes[j])


def worm_turn(lab, g, j):
    """The worm of the pitch drive is not round: an error once and twice in its turn, largest where it is most worn."""
    turn = 360 / g.choice([72, 90, 120, 180])
    phase = 2 * np.pi * lab.pitch / turn
    wave = np.sin(phase + g.uniform(0, 6.28)) + g.uniform(0.1, 0.4) * np.sin(2 * phase + g.uniform(0, 6.28))
    worn = 0.6 + g.uniform(0.4, 0.9) * np.exp(-((lab.pitch / 25) ** 2))
    return seen(lab, j, 0.01 * worn * wave, 0.0)


def axes_skew(lab, g, j):
    """The roll axis is not square to the pitch axis: gravity is turned by a small angle between the two."""
    e = np.radians(g.choice([-1, 1]) * g.uniform(0.02, 0.1))
    a, r = np.radians(lab.pitch), np.radians(lab.roll)
    x, y, z = np.sin(a) * np.cos(e), -np.sin(a) * np.sin(e), -np.cos(a)
    turned = np.column_stack([x, y * np.cos(r) + z * np.sin(r), -y * np.sin(r) + z * np.cos(r)])
    return lab.gains[j] * ((turned - lab.grav) @ lab.axes[j])


def power_on(lab, g, j):
    """The electronics is off between replications. Its offset settles from the start, twice: chip, then box. The
    longer it was off the colder it was."""
    start = lab.t[lab.first][lab.rep]
    length = np.max(lab.t - start)
    chip = g.uniform(0.05, 0.12) * length
    cold = 1 - np.exp(-lab.pause[lab.first][lab.rep] / (3 * HOUR))
    since = lab.t - start + 60
    return cold * (0.65 * np.exp(-since / chip) + 0.35 * np.exp(-since / (g.uniform(3, 5) * chip)))


def loose_flank(lab, g, j):
    """Play between worm and wheel. A heavy side holds the wheel on one flank; near balance the flank is that of the
    last move."""
    moment = np.sin(np.radians(lab.pitch - g.uniform(-12, 12)))
    friction = np.sin(np.radians(lab.span)) * g.uniform(0.35, 0.6)
    side, flank = 1.0, np.empty(lab.n)
    for i in range(lab.n):
        move = lab.pitch[i] - (lab.pitch[i - 1] if i else 0.0)
        if abs(moment[i]) > friction:
            side = -np.sign(moment[i])
        elif move != 0:
            side = -np.sign(move)
        flank[i] = side
    return seen(lab, j, 0.005 * flank, 0.0)


def rollover(lab, g, j):
    """The dual-slope converter has two references, one for each polarity. They are not equal: negative volts read with
    another gain."""
    v = lab.responses[j][1]
    return np.where(v < 0, v, 0.0)


def heating_rate(lab, g, j):
    """While the room warms the case is ahead of the mechanism; the gradient inside strains the suspension."""
    inside = relax(lab.air, lab.fine, g.uniform(6, 18) * 60)
    return np.interp(lab.t, lab.fine, lab.air - inside)


def cable_twist(lab, g, j):
    """The cable winds round the roll shaft, which goes the short way each time and unwinds after a turn and a half. Its
    torque, stiffer the more it is wound, twists the coupling between encoder and sensor."""
    wound, out = 0.0, np.empty(lab.n)
    at = 0.0
    for i in range(lab.n):
        if lab.first[i]:
            wound, at = 0.0, 0.0
        wound += (lab.roll[i] - at + 180) % 360 - 180
        at = lab.roll[i]
        if abs(wound) > 540:
            wound -= 360 * np.sign(wound)
        out[i] = wound / 360
    return seen(lab, j, 0.0, -0.01 * (out + g.uniform(0.2, 0.6) * out**3))


def warm_from_below(lab, g, j):
    """The board that heats lies at one side of the mechanism. When it is below, warm gas rises to the mechanism (the
    law of free convection, power 5/4, above a threshold), some minutes late; when it is above the gas rests."""
    w = g.uniform(0, 2 * np.pi)
    down = lab.grav @ np.array([0.0, np.cos(w), np.sin(w)])
    drive = np.clip(down - g.uniform(0.1, 0.35), 0, None) ** 1.25
    return relax(drive, lab.t, g.uniform(1.0, 2.5) * float(np.median(np.diff(lab.t))))


EFFECTS = {
    f.__name__: f
    for f in (worm_turn, axes_skew, power_on, loose_flank, rollover, heating_rate, cable_twist, warm_from_below)
}
COMMON = ("worm_turn", "axes_skew", "loose_flank", "cable_twist")
SIGNED = ("power_on", "rollover", "heating_rate", "warm_from_below")
PAIRS = [("axes_skew", "heating_rate"), ("worm_turn", "power_on"), ("rollover", "cable_twist")]
ABOUT = {
    "worm_turn": "Everyday. Periodic error of the pitch drive, once and twice in a turn of the worm (2, 3, 4 or 5 deg),"
    " larger near level. Depends on pitch, and on roll as the sensor sees pitch. Matters always.",
    "axes_skew": "Everyday. Roll and pitch axis are not at right angles. Depends on sin(pitch) times cosine and sine of"
    " roll. Matters at large pitch, for sensors across the roll axis.",
    "power_on": "Everyday. The offset settles after power-on at the start of each replication. Depends on time in the"
    " replication. Matters in its first hour.",
    "loose_flank": "Everyday. Backlash of the pitch drive: near balance by the direction of the last pitch move, at"
    " large pitch by the sign of pitch. Depends on pitch and move.",
    "rollover": "Everyday. The converter's gain differs between positive and negative volts. Depends on gravity along"
    " the sensor: a kink at zero.",
    "heating_rate": "Everyday. The offset goes with the difference between case and inside, a lagged temperature."
    " Depends on temperature and time. Matters when the room's temperature changes fast.",
    "cable_twist": "Unlisted. Torque of the wound cable twists the roll shaft. Depends on the roll moves so far in the"
    " replication (order), and on pitch and roll as the sensor sees roll.",
    "warm_from_below": "Unlisted. Convection inside the sensor when its heated side is below, minutes late. Depends on"
    " roll and pitch (one-sided across gravity), and a little on the attitude before.",
}


def table(effects, seed, size, noise="white"):
    lab = laboratory(seed)

    def error(name, g, j):
        return row_noise(name, g, lab.t, lab.responses[j][1])

    return assemble(NUMBER, seed, lab, effects, size, noise, globals(), error)
