"""Servo accelerometers on a dividing head: hidden causes in the head, the building, the package, the meter."""
from types import SimpleNamespace

import numpy as np

from .common import ARCSEC, noises, registry, relax, residual, rms, wander

EFFECTS, ABOUT, effect = registry()
NOISES = noises()


def gravity(a, R):
    return np.stack([np.sin(a), -np.sin(R) * np.cos(a), -np.cos(R) * np.cos(a)], 1)


def laboratory(rng, needs):
    while True:
        span = needs.get("span") or int(rng.choice([180, 90, 60]))
        if needs.get("fives"):
            step = {180: 10, 90: int(rng.choice([5, 10])), 60: int(rng.choice([5, 10]))}[span]
            pitches = np.arange(-span, span + 1, step).astype(float)
        else:
            pitches = np.linspace(-span, span, 2 * int(rng.integers(needs.get("half", 6), 19)) + 1)
        nr = int(rng.choice([1, 3, 5, 9, 13]))
        rolls = np.zeros(1) if nr == 1 else np.linspace(-1, 1, nr) * int(rng.choice([90, 180] if nr > 3 else [90]))
        reps = int(rng.integers(3, 7))
        n = len(pitches) * nr * reps
        base = rng.uniform(25, 50)
        if 150 <= n <= 1500 and n * base / 3600 > needs.get("hours", 0):
            break
    serpentine = not needs.get("random") and rng.random() < 0.25
    free = bool(needs.get("free")) or (span == 180 and rng.random() < 0.4)  # goes the shorter way through 180
    a, R, rep = [], [], []
    for r in range(reps):
        if serpentine:
            p = [(x, y) for j, y in enumerate(rolls) for x in (pitches if (j + r) % 2 == 0 else pitches[::-1])]
        else:
            p = [(x, y) for x in pitches for y in rolls]
            p = [p[i] for i in rng.permutation(len(p))]
        a += [x for x, _ in p]
        R += [y for _, y in p]
        rep += [r] * len(p)
    a, R, rep = np.round(a, 4), np.round(R, 4), np.array(rep)
    move = np.diff(a, prepend=0.0)
    if free:
        move = (move + 180) % 360 - 180
    speed = rng.uniform(4, 15)
    dt = np.minimum(base + np.maximum(np.abs(move), np.abs(np.diff(R, prepend=0.0))) / speed, base + 30)
    dt = dt * rng.uniform(0.97, 1.06, n)
    if rng.random() < 0.5:
        dt[np.flatnonzero(np.diff(rep)) + 1] += np.exp(rng.uniform(np.log(300), np.log(18000), reps - 1))
    t = np.round(np.cumsum(dt), 1)
    ns = int(rng.integers(1, 4))
    u = np.eye(3)[:ns] + np.deg2rad(rng.uniform(0.1, 1, (ns, 3)) * rng.choice([-1, 1], (ns, 3))) * (1 - np.eye(3)[:ns])
    u /= np.linalg.norm(u, axis=1)[:, None]
    lab = SimpleNamespace(n=n, rep=rep, t=t, dt=dt, a=np.deg2rad(a), R=np.deg2rad(R), deg=a, step=pitches[1] - pitches[0],
                          move=move, speed=speed, span=span, ns=ns, u=u, S=5 * rng.uniform(0.97, 1.03, ns),
                          b=rng.normal(0, 4e-3, ns), sd=np.exp(rng.uniform(np.log(1e-5), np.log(1e-4))) * rng.uniform(0.8, 1.25, ns),
                          clock=rng.uniform(*needs.get("start", (0, 24))), decimals=7, options=[])
    lab.g = gravity(lab.a, lab.R)
    lab.V = lab.b + lab.S * (lab.g @ u.T)
    lab.truth = lab.V.copy()
    if rng.random() < 1 / 3:   # an offset and a sensitivity of its own in each replication
        lab.truth += lab.sd * rng.normal(0, 1, (reps, ns))[rep] + lab.sd * rng.normal(0, 1, (reps, ns))[rep] * (lab.V - lab.b) / lab.S
    T = rng.uniform(19, 27) + wander(rng, t, rng.uniform(0.1, 0.8), rng.uniform(1, 8)) + rng.normal(0, 0.005, n)
    lab.columns = dict(replicate=rep + 1, order=np.arange(1, n + 1), elapsed_s=t, pitch_deg=a, roll_deg=R, sensor_temperature_degC=np.round(T, 3))
    lab.responses = ["x_V", "y_V", "z_V"][:ns]
    lab.X = np.c_[np.ones(n), lab.g] if nr > 1 else np.c_[np.ones(n), np.sin(lab.a), np.cos(lab.a)]
    return lab


def ruler(lab, h, sd=False):
    if sd:
        return lab.sd[0]
    r = residual(h, lab.X, lab.rep)
    return r, rms(r) / lab.sd[0]


def errors(lab, noise, rng):
    setting = np.abs(lab.g[:, 0])
    return np.stack([noise(rng, setting, lab.rep) for _ in range(lab.ns)], 1) * lab.sd


def tilt(lab, da, dR=0.0):
    """Volts from the package standing at (a + da, R + dR) instead of (a, R); radians."""
    return lab.S * ((gravity(lab.a + da, lab.R + dR) - lab.g) @ lab.u.T)


@effect("""The head has a 24-notch plate: multiples of 15 deg are set by the pin in its notch, all other angles with the hand drum.
The drum's zero is off by some arc seconds and its scale too long. Depends on whether pitch_deg is a multiple of 15 (and on its remainder).""",
        fives=True)
def notch_or_drum(lab, rng, k):
    rest = lab.deg % 15
    d = rng.uniform(4, 12) * rng.choice([-1, 1]) + rng.uniform(-0.6, 0.6) * (rest - 7.5)
    return tilt(lab, np.where(rest == 0, 0.0, k * d * ARCSEC))


@effect("""For thirty years the workshop milled only one quarter on this head, so that the worm wheel's flanks are worn over a sector of some
tens of degrees; the package hangs behind by the missing metal there. Pitch error is local in pitch_deg, the same in all replications.""", half=9)
def worn_sector(lab, rng, k):
    w = max(rng.uniform(14, 32), 2.3 * lab.step)
    x = (lab.deg - rng.uniform(-35, 35)) / w
    depth = np.where(np.abs(x) < 1, np.cos(np.pi / 2 * x) ** 2, 0.0)
    return tilt(lab, -k * rng.uniform(5, 20) * ARCSEC * depth * (1 + 0.2 * np.cos(lab.R - 1)))


@effect("""A forklift or lorry stands at the dock on the other side of the wall for ten minutes to an hour and leaves; the slab tilts at once by
part and the rest creeps in the subsoil. Depends on elapsed_s through visits nobody wrote down; acts on pitch, so as cos pitch on x.""", hours=2)
def forklift_parks(lab, rng, k):
    on, now = np.zeros(lab.n), rng.uniform(0, 2000)
    while now < lab.t[-1]:
        stay = rng.uniform(600, 3600)
        on[(lab.t > now) & (lab.t < now + stay)] = rng.uniform(0.5, 1.3)
        now += stay + rng.exponential(3000)
    sink = 0.7 * on + 0.3 * relax(lab.t, on, 900.0, 0.0)
    return tilt(lab, k * 6 * ARCSEC * sink, k * rng.uniform(-3, 3) * ARCSEC * sink)


@effect("""The sun reaches one facade for some hours, the wall warms with a lag of two hours and the building leans away from it; clouds pass.
Tilt of the pier depends on the time of day (elapsed_s from an early start) and acts as cos pitch on x, within replications also.""",
        start=(5, 10), hours=4)
def sun_on_facade(lab, rng, k):
    hour = (lab.clock + lab.t / 3600) % 24
    noon = rng.choice([9.5, 12.0, 15.5])
    sun = np.maximum(0, np.cos((hour - noon) / 24 * 2 * np.pi * 1.6)) * (np.abs(hour - noon) < 5)
    cloud = 1 / (1 + np.exp(4 * wander(rng, lab.t, 1, 1.0) - 1))
    lean = relax(lab.t, sun * cloud, rng.uniform(3600, 9000), 0.0)
    return tilt(lab, k * 25 * ARCSEC * lean, k * rng.uniform(-10, 10) * ARCSEC * lean)


@effect("""The pitch motor holds an unbalanced package. As long as the moment is below the gear's friction its current is nothing, above it grows.
Its stray field changes the flux in the gap of the torquer's magnet and so scale and bias. Depends on pitch (and a little roll), product
of signal and a moment with a dead band.""")
def holding_current_field(lab, rng, k):
    M = np.cos(lab.a + rng.uniform(-0.9, 0.9)) + rng.uniform(-0.3, 0.3) * np.sin(lab.R)
    I = np.sign(M) * np.maximum(np.abs(M) - rng.uniform(0.2, 0.5), 0)
    kappa, beta = rng.uniform(10e-6, 40e-6, lab.ns) * rng.choice([-1, 1], lab.ns), rng.normal(0, 8e-6, lab.ns)
    return k * lab.S * I[:, None] * (kappa * (lab.g @ lab.u.T) + beta)


@effect("""The head turns freely and goes the shorter way through 180 deg, so in random order the cable winds round the trunnion until the
operator unwinds it before the next replication. Beyond its slack the cable twists the arm. Depends on the turns accumulated
along the order of execution, not on where the head stands.""", span=180, free=True, random=True)
def cable_winds_up(lab, rng, k):
    wound = np.zeros(lab.n)
    for r in np.unique(lab.rep):
        m = lab.rep == r
        wound[m] = np.cumsum(np.where(np.arange(m.sum()) == 0, 0, lab.move[m])) / 360
    taut = np.sign(wound) * np.maximum(np.abs(wound) - rng.uniform(0.2, 0.6), 0)
    return tilt(lab, k * rng.uniform(1, 4) * ARCSEC * taut)


@effect("""The electronics board inside the package gives off warmth; when the attitude puts it below the sensor, the plume warms the sensor, when above,
nothing. The sensor follows with ten to thirty minutes, the recorded thermistor sits elsewhere. Depends on the attitudes of
the last half hour through a lag, on bias and on scale.""")
def warm_board_below(lab, rng, k):
    d = rng.normal(0, 1, 3) + np.array([1.5, 0, 0]) * rng.choice([-1, 1])
    plume = np.maximum(0, -(lab.g @ (d / np.linalg.norm(d)))) ** 1.25
    theta = k * rng.uniform(0.8, 2.5) * relax(lab.t, plume, rng.uniform(500, 1800), plume.mean())
    bias, scale = rng.uniform(60e-6, 200e-6, lab.ns) * rng.choice([-1, 1], lab.ns), rng.uniform(30e-6, 120e-6, lab.ns)
    return theta[:, None] * (bias + scale * lab.S * (lab.g @ lab.u.T))


@effect("""The voltmeter calibrates itself by a timer every half hour to two hours and creeps away in between as its inside warms
the divider: a sawtooth of gain (and little offset) in elapsed_s that no replication keeps step with. Error proportional to the
voltage.""", hours=2)
def selfcal_sawtooth(lab, rng, k):
    period = rng.uniform(1800, 7200)
    since = (lab.t + rng.uniform(0, period)) % period
    creep = 1 - np.exp(-since / (period * rng.uniform(0.3, 1.5)))
    return k * creep[:, None] * (rng.uniform(8e-6, 25e-6) * rng.choice([-1, 1]) * lab.V + rng.normal(0, 10e-6))


@effect("""The scanner ends each point on the last sensor; the input capacitor's dielectric keeps some millionths of that voltage through the move and
gives it back into the first sensor's reading of the NEXT point, less the longer the move lasts. Depends on the voltage of the previous row's last
channel and on the time between the rows.""", random=True)
def scanner_memory(lab, rng, k):
    last = np.r_[0.0, lab.V[:-1, -1]]
    left = rng.uniform(5e-6, 30e-6) * (lab.dt / 40) ** -rng.uniform(0.8, 1.3)
    out = np.zeros((lab.n, lab.ns))
    out[:, 0] = k * left * (last - lab.V[:, 0])
    for j in range(1, lab.ns):
        out[:, j] = k * 15e-6 * (lab.V[:, j - 1] - lab.V[:, j])
    return out


@effect("""The air compressor in the cellar starts and stops with the tank's pressure. Its vibration, near vertical but rocking the bench, is rectified by the
servo loop (K2 times vibration squared along the sensor). Depends on unrecorded on/off intervals of minutes in elapsed_s, times the square of the
cosine between sensor axis and direction of vibration.""")
def compressor_rectified(lab, rng, k):
    on, now = np.zeros(lab.n), -rng.uniform(0, 600)
    run, rest = rng.uniform(180, 700), rng.uniform(300, 1200)
    while now < lab.t[-1]:
        a, b = run * rng.uniform(0.8, 1.2), rest * rng.uniform(0.6, 1.5)
        on[(lab.t >= now) & (lab.t < now + a)] = 1
        now += a + b
    psi = rng.uniform(-0.7, 0.7)
    dg = np.stack([np.cos(lab.a), np.sin(lab.R) * np.sin(lab.a), np.cos(lab.R) * np.sin(lab.a)], 1)
    v = np.cos(psi) * lab.g + np.sin(psi) * dg
    return k * lab.S * 30e-6 * rng.uniform(0.5, 2, lab.ns) * on[:, None] * (v @ lab.u.T) ** 2


@effect("""The program waits a fixed time from the COMMAND, not from the arrival. After a long move the head's servo is still creeping the last seconds of arc when the
meter begins to average. Depends on length and sense of the move just made (pitch_deg minus that of the previous row), sharply
on the length.""", random=True)
def fixed_wait_after_command(lab, rng, k):
    L = np.abs(lab.move)
    late = (L - L.max()) / lab.speed / rng.uniform(5, 12)
    return tilt(lab, -k * rng.uniform(10, 40) * ARCSEC * np.sign(lab.move) * L / 180 * np.exp(late))


@effect("""At the change of shift a second operator takes over, who sits where the first one stood, and reads the circle past the index with parallax. The window rides on
the trunnion, so the angle of view goes with pitch. Depends on elapsed_s by the shifts (two or three changes) and inside a shift
on pitch.""", hours=3)
def second_operator_parallax(lab, rng, k):
    cuts = np.sort(rng.uniform(0.2, 0.85, rng.integers(1, 3))) * lab.t[-1]
    second = np.searchsorted(cuts, lab.t) % 2
    view = (rng.uniform(0.5, 0.9) * np.sin(lab.a + rng.uniform(-0.8, 0.8)) + rng.uniform(-0.5, 0.5)) / rng.uniform(0.9, 1.4)
    return tilt(lab, k * 12 * ARCSEC * second * np.tan(view))


PAIRS = [["forklift_parks", "cable_winds_up"], ["warm_board_below", "selfcal_sawtooth"], ["sun_on_facade", "worn_sector"],
         ["holding_current_field", "scanner_memory"], ["notch_or_drum", "compressor_rectified"],
         ["sun_on_facade", "fixed_wait_after_command"], ["second_operator_parallax", "selfcal_sawtooth"],
         ["warm_board_below", "forklift_parks"]]
