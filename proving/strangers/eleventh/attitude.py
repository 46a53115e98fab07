"""Accelerometers or inclinometers on a two-axis stage in Earth's gravity."""
import math
import numpy as np
from . import common

NOISES = dict(common.NOISES)


def body(w1, w2, w3, p, r):
    """A vector of the room (along the stage, along the pitch axis, up) in the axes of the sensors."""
    x, y, z = np.cos(p) * w1 - np.sin(p) * w3, w2 + 0 * p, np.sin(p) * w1 + np.cos(p) * w3
    return np.column_stack([x, np.cos(r) * y + np.sin(r) * z, np.cos(r) * z - np.sin(r) * y])


def gravity(p, r, tilt=0.0):
    """tilt: of the pitch axis; along the sensors."""
    return body(0.0, tilt, -1.0, p, r)


def laboratory(seed):
    g = common.rng("attitude", "lab", seed)
    lab = common.Lab()
    reps = int(g.integers(3, 7))
    sensors = int(g.integers(2, 4))
    fixed = g.random() < 0.5
    if fixed:
        np_, nr = int(g.integers(6, 10)), int(g.integers(11, 17))
        top = g.choice([60.0, 75.0, 85.0])
        levels = np.array([(a, b) for a in np.linspace(-top, top, np_) for b in np.arange(nr) * 360.0 / nr])
        lab.poses = len(levels)
    else:
        lab.poses = int(g.integers(100, 231))
        top = g.choice([65.0, 80.0, 89.0])
    while reps > 3 and reps * lab.poses > 1300:
        reps -= 1
    while reps * lab.poses < 300:
        reps += 1
    same_order = g.random() < 0.3
    decimals = 2 if fixed or g.random() < 0.5 else 4
    gap = g.uniform(60, 200)
    first = g.uniform(5.5, 10.5)
    rep, p, r, t = [], [], [], []
    order = g.permutation(lab.poses)
    drawn = None
    for k in range(reps):
        if fixed:
            pose = levels[order if same_order else g.permutation(lab.poses)] + g.normal(0, 0.03, (lab.poses, 2))
        elif drawn is None or not same_order:
            s = math.sin(math.radians(top))
            pose = np.column_stack([np.degrees(np.arcsin(g.uniform(-s, s, lab.poses))), g.uniform(0, 360, lab.poses)])
            drawn = pose
        else:
            pose = drawn
        at = 86400.0 * (k + 2 * ((k + 1) // 5)) + 3600 * g.uniform(-1, 1)
        steps = gap * g.uniform(0.7, 1.4, lab.poses)
        rep += [k + 1] * lab.poses
        p += list(pose[:, 0])
        r += list(np.mod(pose[:, 1], 360))
        t += list(at + np.cumsum(steps))
    t = np.array(t)
    t = t - t[0] + gap
    lab.rep = np.array(rep)
    lab.t = common.shown(t, 1)
    lab.clock = first + lab.t / 3600.0
    lab.p, lab.r = np.radians(common.shown(p, decimals)), np.radians(common.shown(r, decimals))
    n = len(t)
    lab.gap = gap
    # the room: day, control cycle, slow drift
    day = g.uniform(0.1, 0.6) * np.sin(2 * np.pi * (lab.clock - g.uniform(8, 11)) / 24)
    cycle = g.uniform(0.03, 0.12) * np.sin(2 * np.pi * lab.t / g.uniform(1200, 4000) + g.uniform(0, 6))
    slow = np.repeat(g.normal(0, 0.15, reps), lab.poses)
    lab.temp = g.uniform(20, 25.5) + day + cycle + slow
    lab.columns = [("replicate", [str(k) for k in lab.rep]),
                   ("order", [str(i + 1) for i in range(n)]),
                   ("elapsed_s", common.text(t, 1)),
                   ("pitch_deg", common.text(p, decimals)), ("roll_deg", common.text(r, decimals)),
                   ("sensor_temperature_degC", common.text(lab.temp + g.normal(0, 0.02, n), 2))]
    lab.responses = ["x_V", "y_V", "z_V"][:sensors]
    lab.options = []
    lab.g = gravity(lab.p, lab.r)
    scale = g.uniform(0.5, 5.0) * g.uniform(0.97, 1.03, sensors)
    lab.axes = np.eye(3)[:sensors] + g.normal(0, 0.006, (sensors, 3))
    lab.scale = scale
    zero = g.normal(0, 0.01, sensors) * scale
    lab.sd = scale * 10 ** g.uniform(-4.5, -3.4) * g.uniform(0.85, 1.2, sensors)
    lab.base = zero + (lab.g @ lab.axes.T) * scale
    lab.model = np.column_stack([np.ones(n), lab.g])
    lab.groups = lab.rep
    lab.drifts = g.random() < 0.5
    if lab.drifts:
        for k in range(1, reps + 1):
            at = lab.rep == k
            lab.base[at] += lab.model[at] @ (g.normal(0, 1.5, (4, sensors)) * lab.sd)
    lab.errors = lambda h, noise, j: common.unit_errors(h, noise, n, np.abs(lab.g[:, j]))
    return lab


def seen(lab, true):
    """What the sensors say of a gravity that is not the one on record."""
    return ((true - lab.g) @ lab.axes.T) * lab.scale


def pendulum_cross(lab, g):
    # the pendulum hangs out of line by what it feels; its turned arm then also feels the pull along the arm
    arm = {0: 2, 1: 0, 2: 1}
    give = 1e-4 * g.uniform(0.6, 1.4, lab.base.shape[1])
    out = []
    for j in range(lab.base.shape[1]):
        felt = lab.g[:, j]
        for _ in range(3):
            swing = give[j] * felt
            felt = lab.g[:, j] * np.cos(swing) + lab.g[:, arm[j]] * np.sin(swing)
        out.append((felt - lab.g[:, j]) * lab.scale[j])
    return np.column_stack(out)


def bearing_wobble(lab, g):
    # the race of the roll bearing is a little oval: the axis nods and yaws twice in a turn
    nod, phase = 1e-4 * g.uniform(0.5, 1.0), g.uniform(0, 2 * np.pi)
    yaw = 1e-4 * g.uniform(0.5, 1.0)
    dp, tilt = nod * np.cos(2 * lab.r + phase), yaw * np.sin(2 * lab.r + phase)
    return seen(lab, gravity(lab.p + dp, lab.r, tilt))


def resolver_ripple(lab, g):
    # two windings of unlike gain: the decoded pitch errs twice in each electrical turn
    phase = g.uniform(0, 2 * np.pi)
    for pairs in [int(k) for k in g.permutation([2, 3, 4, 5])]:
        el = pairs * lab.p + phase
        read = np.arctan2((1 + 1e-4) * np.sin(el), np.cos(el))
        err = np.angle(np.exp(1j * (read - el))) / pairs
        raw = seen(lab, gravity(lab.p - err, lab.r))
        if common.rms(common.left(lab.model, lab.groups, raw[:, 0])) > 0.3 * common.rms(raw[:, 0]):
            break
    return raw


def zero_temperature(lab, g):
    tc = g.uniform(0.5, 1.5, lab.base.shape[1]) * g.choice([-1, 1], lab.base.shape[1])
    return 1e-4 * np.outer(lab.temp - lab.temp[0], tc * lab.scale)


def car_park(lab, g):
    # cars fill the yard beside the building, some leave for lunch, on two days of the week there are none
    hour, date = np.mod(lab.clock, 24), np.floor(lab.clock / 24).astype(int)
    arrive, leave = g.uniform(7.8, 9.5), g.uniform(15.5, 17.5)
    lunch = g.uniform(0.2, 0.5)
    cars = 1 / (1 + np.exp(-(hour - arrive) / 0.25)) - 1 / (1 + np.exp(-(hour - leave) / 0.3))
    cars = cars * (1 - lunch * ((hour > 12) & (hour < 13)))
    cars = cars * g.uniform(0.75, 1.0, date.max() + 1)[date]
    cars = np.where(date % 7 >= 5, 0.05 * cars, cars)
    sag = common.lowpass(lab.t, cars, 900.0) * 2e-5     # the ground gives way with a delay
    way = g.uniform(0.3, 1.2) * g.choice([-1, 1])
    return seen(lab, gravity(lab.p + sag * math.cos(way), lab.r, tilt=sag * math.sin(way)))


def lost_steps(lab, g):
    # the pitch motor slips a step now and then when it lifts the fixture, which is heavy on one side; homing sets it right
    lean, heavy, limit = g.uniform(0.2, 0.5), g.uniform(0, 2 * np.pi), g.uniform(0.75, 0.95)
    low = np.zeros(len(lab.t))
    lost = 0
    for i in range(1, len(lab.t)):
        if lab.rep[i] != lab.rep[i - 1]:
            lost = 0
        elif lab.p[i] > lab.p[i - 1]:
            path = np.linspace(lab.p[i - 1], lab.p[i], 15)
            torque = np.max(np.cos(path)) * (1 + lean * math.cos(lab.r[i - 1] - heavy)) / (1 + lean)
            over = torque / limit * g.uniform(0.8, 1.1)      # the mains, the grease
            if over > 1:
                lost += 1 + int((over - 1) / 0.08)
        low[i] = lost
    return seen(lab, gravity(lab.p - 1e-5 * low, lab.r))


def earth_field(lab, g):
    # the pendulums are a little magnetic; the field of the Earth dips and points to the north, gravity does not
    north, dip = g.uniform(0.2, 1.3) + g.integers(0, 4) * np.pi / 2, np.radians(g.uniform(45, 70))
    b = body(math.cos(dip) * math.cos(north), math.cos(dip) * math.sin(north), -math.sin(dip), lab.p, lab.r)
    k = lab.base.shape[1]
    moment = np.eye(3)[:k] * g.uniform(0.6, 1.4, k)[:, None] * g.choice([-1, 1], k)[:, None] + g.normal(0, 0.2, (k, 3))
    return 1e-5 * (b @ moment.T) * lab.scale


def chimney(lab, g):
    # air warmed by the circuit board rises on the sensors only while the board is below them, and they warm up slowly
    where = g.standard_normal(3)
    where /= np.linalg.norm(where)
    below = np.maximum(0.0, lab.g @ where)      # gravity along the way from the sensors to the board
    plume = below ** 1.25
    warm = common.lowpass(lab.t, plume, g.uniform(0.9, 2.5) * lab.gap)
    k = lab.base.shape[1]
    return 1e-4 * np.outer(warm, g.uniform(0.5, 1.5, k) * g.choice([-1, 1], k) * lab.scale)


EFFECTS = {f.__name__: f for f in (pendulum_cross, bearing_wobble, resolver_ripple, zero_temperature,
                                   car_park, lost_steps, earth_field, chimney)}
PAIRS = [("pendulum_cross", "car_park"), ("bearing_wobble", "chimney"), ("zero_temperature", "lost_steps")]
ABOUT = {
    "pendulum_cross": "Everyday. The pendulum of each sensor swings out with the acceleration that it feels and then also feels that along its arm; "
                      "depends on pitch and roll (product of two gravity components); matters where both are large.",
    "bearing_wobble": "Everyday. The race of the roll bearing is oval, the roll axis nods and yaws twice in a turn; "
                      "depends on roll (two cycles a turn), with cos(pitch) in the sensor along the axis; matters at small pitch.",
    "resolver_ripple": "Everyday. The two windings of the pitch resolver have unlike gains, the angle errs twice in each electrical turn; "
                       "depends on pitch (4 to 10 cycles a turn), by cos(pitch) in the sensor along the roll axis.",
    "zero_temperature": "Everyday. The zero of each sensor goes with its temperature; depends on temperature (recorded with a little noise), and so on time.",
    "car_park": "Unlisted. Cars of the staff in the yard press the ground down, the floor under the stage tilts, with a delay; "
                "depends on the time of day and, by the tilt, on pitch and roll; no cars on days off.",
    "lost_steps": "Unlisted. The stepper motor of pitch loses steps when it lifts a fixture that is heavy on one side, the true pitch falls behind "
                  "until the replication ends; depends on order (lifts before) and, by the angle, on pitch.",
    "earth_field": "Unlisted. Slightly magnetic pendulums feel the field of the Earth, which dips and points north; "
                   "depends on pitch and roll in directions that gravity does not have.",
    "chimney": "Unlisted. Warm air from the circuit board rises on the sensors while the board is below them, and they warm and cool slowly; "
               "depends on pitch and roll of this row and the rows before, and on the time between them.",
}
