"""Accelerometers on a two-axis stage in Earth's gravity: the roll spindle is carried by the pitch trunnion."""
import numpy as np
from . import common
from .common import stream

NOISES = dict(common.NOISES)


def laboratory(seed):
    g = stream("attitude", seed, "laboratory")
    lab = common.Lab()
    reps = int(g.integers(3, 7))
    fixed = g.random() < 0.5
    if fixed:
        step = float(g.choice([15.0, 20.0]))
        top = step * int(g.integers(3, 5))
        turn = float(g.choice([30.0, 36.0, 45.0]))
        if step == 20.0 and top == 80.0:
            top = float(g.choice([60.0, 80.0]))
        levels = [(p, r) for p in np.arange(-top, top + 1, step) for r in np.arange(0.0, 359.0, turn)]
        levels = np.array(levels)
        reps = max(reps, int(np.ceil(310 / len(levels))))
        per = len(levels)
    else:
        per = int(g.integers(90, 240))
        reps = max(reps, int(np.ceil(310 / per)))
        top = g.uniform(60, 86)
    reps = min(reps, 1490 // per)
    serpentine = fixed and g.random() < 0.4
    again = g.random() < 0.5
    even = g.random() < 0.5
    lab.slip_ring = bool(g.random() < 0.6)

    def draw():
        if even:
            p = np.degrees(np.arcsin(g.uniform(-1, 1, per) * np.sin(np.radians(top))))
        else:
            p = g.uniform(-top, top, per)
        return np.column_stack([p, g.uniform(0, 359.9, per)])

    base = levels if fixed else draw()
    pitch, roll, rep, session, pause = [], [], [], [], []
    count = 0
    for k in range(reps):
        at = base if fixed or again else draw()
        if serpentine:
            if k % 2:
                at = at[::-1]
        else:
            at = at[g.permutation(per)]
        if fixed:
            at = at + g.uniform(-0.45, 0.45, at.shape)
        parts = int(g.integers(2, 5))
        cuts = np.sort(np.round(per * (np.arange(1, parts) / parts + g.uniform(-0.08, 0.08, parts - 1))).astype(int))
        for i in range(per):
            fresh = i == 0 or i in cuts
            count += fresh
            pitch.append(at[i, 0])
            roll.append(at[i, 1] % 360.0)
            rep.append(k + 1)
            session.append(count - 1)
            pause.append((g.uniform(2400, 7000) if g.random() < 0.4 else g.uniform(40000, 60000)) if fresh and (k or i) else 0.0)
    n = len(pitch)
    lab.n, lab.rep, lab.session = n, np.array(rep), np.array(session)
    lab.pitch, lab.roll = np.round(pitch, 2), np.round(np.array(roll), 2) % 360.0
    lab.pause = np.array(pause)
    lab.way_pitch = np.abs(np.diff(lab.pitch, prepend=0.0))
    move = np.diff(lab.roll, prepend=lab.roll[0])
    if lab.slip_ring:
        move = (move + 180.0) % 360.0 - 180.0
    lab.move_roll = move
    lab.turned = lab.roll[0] + np.cumsum(move)
    speed, settle = g.uniform(3, 9), g.uniform(25, 70)
    dt = np.maximum(lab.way_pitch, np.abs(move)) / speed + settle + g.uniform(8, 30, n)
    lab.dt = dt + lab.pause
    lab.time = np.round(np.cumsum(lab.dt), 1)
    lab.hour0 = g.uniform(7.5, 10.5)
    lab.a, lab.r = np.radians(lab.pitch), np.radians(lab.roll)
    lab.g = np.column_stack([np.sin(lab.a), -np.sin(lab.r) * np.cos(lab.a), -np.cos(lab.r) * np.cos(lab.a)])
    lab.model = np.column_stack([np.ones(n), lab.g])
    lab.groups = lab.rep
    swing, mean = g.uniform(0.1, 1.2), g.uniform(19, 27)
    day = 2 * np.pi * (lab.time / 86400.0 + g.random())
    wander = np.cumsum(g.standard_normal(n)) * 0.01
    temp = mean + swing * np.sin(day) + wander + 0.04 * g.standard_normal(n)
    names = ["x_V", "y_V", "z_V"][:int(g.integers(2, 4))]
    span = g.uniform(1.0, 5.0)
    wanted = [span * g.uniform(2e-4, 1e-3)] * len(names)
    common.resolution(lab, g, wanted)
    lab.span = [span * g.uniform(0.97, 1.03) for _ in names]
    lab.truth, lab.drifts = {}, []
    differ = g.random() < 0.5
    for j, name in enumerate(names):
        k = g.normal(0, 0.004 * span, 3)
        k[j] = lab.span[j]
        lab.truth[name] = g.normal(0, 0.01 * span) + lab.g @ k
        own = 1.5 * g.standard_normal((reps, 4)) * differ
        lab.drifts.append(np.sum(lab.model * own[lab.rep - 1], axis=1))
    lab.share, lab.ar = 0.0, g.uniform(0.3, 0.7)
    lab.form, lab.phase = int(g.integers(0, 5)), g.uniform(0, 2 * np.pi)
    lab.options = []
    lab.columns = {"replicate": [str(k) for k in lab.rep], "order": [str(i + 1) for i in range(n)],
                   "elapsed_s": common.fixed(lab.time, 1), "pitch_deg": common.fixed(lab.pitch, 2),
                   "roll_deg": common.fixed(lab.roll, 2), "sensor_temperature_degC": common.fixed(temp, 2)}

    def spread(j):
        if lab.form == 0:    # the angle of the stage is uncertain
            return np.sqrt(0.1 + np.sum(tangent(lab)[j][:, None] ** 2, axis=1))
        if lab.form == 1:    # people walk about in office hours
            h = (lab.hour0 + lab.time / 3600.0) % 24
            return np.where((h > 9) & (h < 12.5), 2.2, 0.8)
        if lab.form == 2:    # the cable hangs and swings on one side
            return 0.5 + 1.6 * np.maximum(0, np.cos(lab.r - lab.phase))
        if lab.form == 3:    # the gain is noisy
            return 0.35 + 1.5 * np.abs(lab.g[:, j])
        return 0.5 + 1.5 * lab.time / lab.time[-1]    # a bearing wears out
    lab.spread = spread
    return lab


def tangent(lab):
    """What a radian of pitch does to the gravity along each sensor."""
    return [np.cos(lab.a), np.sin(lab.r) * np.sin(lab.a), np.cos(lab.r) * np.sin(lab.a)]


def tilted(lab, angle):
    return [s * t * angle for s, t in zip(lab.span, tangent(lab))]


def offsets(lab, g, v):
    return [v] + [v * g.uniform(0.5, 1.2) for _ in lab.span[1:]]


def open_loop_droop(lab, g):
    stiff = g.uniform(0.01, 0.03)    # radians that the pendulum turns in one g
    out = []
    at = g.uniform(0, 2 * np.pi)
    for j, s in enumerate(lab.span):
        across = lab.g[:, (j + 1) % 3] * np.cos(at) + lab.g[:, (j + 2) % 3] * np.sin(at)
        turn = np.zeros(lab.n)
        for _ in range(40):
            turn = stiff * (lab.g[:, j] * np.cos(turn) + across * np.sin(turn))
        out.append(s * (turn / stiff - lab.g[:, j]))
    return out


def strain_wave(lab, g):
    ratio = int(g.choice([50, 80, 100, 120]))
    wave = 2 * ratio * lab.a + g.uniform(0, 2 * np.pi)    # the flexible cup is squeezed twice in each turn of the motor
    return tilted(lab, np.sin(wave) + 0.25 * np.sin(2 * wave + g.uniform(0, 2 * np.pi)))


def homing(lab, g):
    switch = g.standard_normal(lab.session[-1] + 1)
    switch += 0.6 * np.sign(switch)
    return tilted(lab, switch[lab.session])


def room_thermostat(lab, g):
    step = 10.0
    m = int(lab.time[-1] / step) + 2
    load, hold = g.uniform(3.0, 6.0), g.uniform(400, 900)
    outside = 2.0 * np.sin(2 * np.pi * (np.arange(m) * step / 86400.0 + g.random()))
    cool, half = g.uniform(9, 13), g.uniform(0.5, 0.9)
    slow = g.uniform(120, 300)
    air, rack, on = 0.0, 0.0, False
    track = np.empty(m)
    a, b = step / hold, step / slow
    for i in range(m):
        on = air > -half if on else air > half
        air += a * (load + outside[i] - (cool if on else 0.0) - air)
        rack += b * (air - rack)
        track[i] = rack
    return offsets(lab, g, np.interp(lab.time, np.arange(m) * step, track))


def parked_brush(lab, g):
    wide, wipe, film = g.uniform(12, 20), g.uniform(0.01, 0.03), g.uniform(4000, 12000)
    spots = []    # [place on the track, tarnish]
    out = np.zeros(lab.n)
    for i in range(lab.n):
        stood = lab.pause[i] if i else 50000.0
        if stood > 0:
            place = lab.roll[i - 1] if i else g.uniform(0, 360)
            spots.append([place, 1 - np.exp(-stood / film)])
        end = lab.turned[i]
        start = end - lab.move_roll[i]
        lo, hi = min(start, end), max(start, end)
        for s in spots:
            for brush in (0.0, 180.0):    # two brushes, each has its spot
                d = (lab.roll[i] - s[0] - brush + 180.0) % 360.0 - 180.0
                out[i] += s[1] * np.exp(-0.5 * (d / wide) ** 2)
            passes = np.floor((hi - s[0]) / 180.0) - np.floor((lo - s[0]) / 180.0)
            s[1] *= (1 - wipe) ** passes
    return offsets(lab, g, out)


def grease_film(lab, g):
    draw, squeeze = g.uniform(50, 140), g.uniform(80, 250)
    film = 0.0
    out = np.empty(lab.n)
    for i in range(lab.n):
        film *= np.exp(-lab.pause[i] / squeeze)
        film += (1 - film) * (1 - np.exp(-abs(lab.move_roll[i]) / draw))
        film *= np.exp(-(lab.dt[i] - lab.pause[i]) * 0.6 * (0.3 + 0.7 * np.cos(lab.a[i])) / squeeze)
        out[i] = film
    return tilted(lab, out)


def vernier_backwards(lab, g):
    hundredths = np.round(np.abs(lab.pitch) * 100).astype(int) % 10
    wrong = (lab.pitch < 0) & (hundredths > 0)
    return tilted(lab, np.where(wrong, 2.0 * hundredths - 10.0, 0.0))


def big_ball(lab, g):
    size = g.uniform(0.08, 0.2)    # ball over pitch circle
    cage = np.radians(lab.turned) * 0.5 * (1 - size) + g.uniform(0, 2 * np.pi)
    lift = np.cos(cage)
    up = np.maximum(0.0, lift) ** 1.5 - 0.5 * np.maximum(0.0, -lift) ** 1.5    # Hertz: the loaded side lifts more
    return tilted(lab, up)


EFFECTS = {"open_loop_droop": open_loop_droop, "strain_wave": strain_wave, "homing": homing, "room_thermostat": room_thermostat,
           "parked_brush": parked_brush, "grease_film": grease_film, "vernier_backwards": vernier_backwards, "big_ball": big_ball}
PAIRS = [("open_loop_droop", "grease_film"), ("strain_wave", "room_thermostat"), ("homing", "big_ball")]
ABOUT = {
    "open_loop_droop": "Everyday. The pendulum of an open-loop sensor turns with its load, and its input axis with it: gravity along the "
                       "sensor times gravity along the pendulum. Depends on pitch and roll. Always there.",
    "strain_wave": "Everyday. The strain wave gear of the pitch axis errs with two waves in each turn of the motor (1.5 to 3.6 deg of "
                   "pitch, and a second harmonic). Depends on pitch; counts most near the horizon.",
    "homing": "Everyday. After every break the incremental pitch axis is homed on a switch that does not repeat: another pitch offset "
              "in each session. Depends on time (sessions between breaks) and on cosine of pitch.",
    "room_thermostat": "Everyday. The two-point thermostat of the room hunts with a period of some tens of minutes or less; the rack of the "
                       "electronics follows, its offset too; the heavy stage does not. Depends on time.",
    "parked_brush": "Unlisted. In every break the slip ring tarnishes where its two brushes stand; each pass wipes a little. Offset near "
                    "the roll angles (and opposite) of the last rows before the breaks. Depends on roll and time.",
    "grease_film": "Unlisted. Turning the roll spindle draws grease under its front bearing, and rest squeezes it out under the load: the "
                   "spindle tilts. Depends on the move since the row before, on the time since then and on cosine of pitch.",
    "vernier_backwards": "Unlisted. At negative pitch the vernier is read in the wrong direction within a tenth of a degree: saw tooth of "
                         "0.1 deg, zero at whole tenths. Depends on pitch, only below zero.",
    "big_ball": "Unlisted. One ball of the roll bearing is too big; it goes round with the cage at less than half the speed: tilt by the "
                "turned angle added up, not by the angle shown. Depends on roll, its moves and their sum.",
}
