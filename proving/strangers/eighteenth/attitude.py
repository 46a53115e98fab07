"""Pendulous accelerometers in one package on a dividing head with two axes, in the gravity of the Earth."""

from types import SimpleNamespace as World

import numpy as np

from .common import NOISES, Array, Causes, Lab, Output, Random, chance, last_side, walk

__all__ = ["ABOUT", "EFFECTS", "NOISES", "PAIRS", "laboratory"]
SMALL = 0.01  # deg: an angle so small that its effect is in proportion


def in_package(ahead: Array, right: Array, down: Array, pitch: Array, roll: Array) -> Array:
    """A vector of the room in the axes of a package that is pitched up, then rolled about its own long axis."""
    p, r = np.radians(pitch), np.radians(roll)
    below = np.sin(p) * ahead + np.cos(p) * down
    rolled = [np.cos(r) * right + np.sin(r) * below, np.cos(r) * below - np.sin(r) * right]
    return np.stack([np.cos(p) * ahead - np.sin(p) * down, *rolled], axis=1)


def feel(pitch: Array, roll: Array) -> Array:
    """What accelerometers at rest feel: one g upwards."""
    return in_package(0.0, 0.0, -1.0, pitch, roll)


def turned(w: World, o: Output, pitch: Array = 0.0, roll: Array = 0.0) -> Array:
    """The change of an output when the package stands otherwise than it is thought to stand."""
    return o.gain * (feel(w.pitch + SMALL * pitch, w.roll + SMALL * roll) - w.feel) @ o.axis


def angles(g: Random, style: str, many: int, reach: float) -> tuple[Array, Array]:
    """Pitches and rolls of one replication, in their order."""
    if style == "scattered":
        return g.uniform(-reach, reach, many), g.uniform(-180, 180, many)
    turns = int(g.integers(8, 14))
    rungs = -(-many // turns)
    pitches, rolls = np.linspace(-reach, reach, rungs), np.arange(turns) * 360 / turns - 180 + g.uniform(0, 15)
    if style == "roll sweeps":
        roll, pitch = np.meshgrid(rolls, pitches)
        roll[1::2] = roll[1::2, ::-1]  # there and back
    else:
        pitch, roll = np.meshgrid(pitches, rolls)
        pitch[1::2] = pitch[1::2, ::-1]
    order = g.permutation(turns * rungs) if style == "mixed" else np.arange(turns * rungs)
    return pitch.ravel()[order[:many]], roll.ravel()[order[:many]]


def laboratory(seed: int) -> Lab:
    """A laboratory and all that its causes need to know of it."""
    g = chance("attitude", seed, "laboratory")
    times = int(g.integers(3, 7))
    many = int(g.integers(100, 200))
    n = times * many
    rep = np.arange(n) // many
    reach = float(g.choice([40, 50, 60, 75, 85]))
    style = str(g.choice(["scattered", "mixed", "pitch sweeps", "roll sweeps"], p=[0.35, 0.3, 0.2, 0.15]))
    digits = int(g.integers(2, 5))
    parts = [angles(g, style, many, reach) for _ in range(times)]
    pitch = np.round(np.concatenate([p for p, _ in parts]), digits)
    roll = np.round(np.concatenate([r for _, r in parts]), digits)
    gaps = g.uniform(25, 90) * g.uniform(0.85, 1.3, n) + 0.15 * np.abs(np.diff(pitch, prepend=0.0))
    gaps[::many] += 3600 * g.uniform(1, 14, times)
    t = np.round(np.cumsum(gaps), 1)
    usual = float(np.median(gaps))
    celsius = g.uniform(18, 30) + g.uniform(0.2, 0.9) * walk(g, t, 3600 * g.uniform(1, 4))
    celsius = celsius + g.uniform(0.3, 1.2) * np.sin(2 * np.pi * (t / 86400 + g.random()))
    axes = np.linalg.qr(g.standard_normal((3, 3)))[0]
    if g.random() < 0.6:  # along the package but for its machining; the first is across the roll axis
        axes = np.eye(3)[[*g.permutation([1, 2]), 0]] + g.normal(0, 0.008, (3, 3))
    while np.abs(axes[0, 1:]).max() < 0.3:
        axes = np.roll(axes, 1, axis=0)
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    volts = float(g.choice([0.4, 1, 2, 5, 10]))
    sd = volts * float(g.choice([4e-5, 1e-4, 3e-4]))
    up = feel(pitch, roll)
    wandering = float(g.choice([0, 0.7]))  # parameters of its own for each replication?
    outputs = []
    for j in range(int(g.choice([1, 2, 3], p=[0.35, 0.25, 0.4]))):
        own = sd * (g.uniform(0.75, 1.35) if j else 1.0)
        gain = volts * g.uniform(0.92, 1.08) * float(g.choice([-1, 1]))
        new = wandering * g.normal(0, own, (times, 4))[rep]
        shift = new[:, 0] + (new[:, 1:] * up).sum(axis=1)
        declared = volts * g.normal(0, 0.01) + gain * up @ axes[j]
        outputs.append(Output("xyz"[j] + "_V", declared, own, gain, shift, axes[j]))
    columns = {
        "replicate": [str(k + 1) for k in rep],
        "order": [str(k + 1) for k in range(n)],
        "elapsed_s": [f"{v:.1f}" for v in t],
        "pitch_deg": [f"{v:.{digits}f}" for v in pitch],
        "roll_deg": [f"{v:.{digits}f}" for v in roll],
        "sensor_temperature_degC": [f"{v:.3f}" for v in celsius + g.normal(0, 0.004, n)],
    }
    world = World(t=t, pitch=pitch, roll=roll, feel=up, rep=rep, many=many, usual=usual)
    return Lab(columns, outputs, np.column_stack([np.ones(n), up]), rep, t, world)


EFFECTS = Causes()


@EFFECTS(both=True)
def one_side_softer(w: World, o: Output, g: Random, own: Random) -> Array:
    """Everyday. The two halves of the force coil are not alike, or the amplifier has another gain for each sign: the
    sensitivity differs for the two directions of gravity. Depends on gravity along the sensor (pitch and roll): its
    amount, a kink near zero. Matters at large input.
    """
    return o.gain * np.abs(w.feel @ o.axis - own.uniform(-0.05, 0.05))


@EFFECTS(bench=True)
def play_in_the_pitch(w: World, o: Output, g: Random, own: Random) -> Array:
    """Everyday. The encoder is on the motor's side of a gear with play, and friction holds the package behind. Depends
    on the direction of the last move in pitch (not its size), as sensors see pitch. Matters always.
    """
    return turned(w, o, pitch=-last_side(np.diff(w.pitch, prepend=-90.0), 0.001, 1.0))


@EFFECTS(bench=True)
def circle_off_centre(w: World, o: Output, g: Random, own: Random) -> Array:
    """Everyday. The divided circle of the pitch axis is not centred on the axis: pitch is wrong by a sine with one
    period in a turn. Depends on pitch, as sensors see pitch. Matters always.
    """
    return turned(w, o, pitch=np.sin(np.radians(w.pitch + g.uniform(0, 360))))


@EFFECTS(bench=True, both=True)
def package_slips(w: World, o: Output, g: Random, own: Random) -> Array:
    """Everyday. The package slips in its clamp once, about the roll axis, and remains so. Depends on time: a step in
    the middle of one replication, as sensors see roll. The parameters of other replications take it up. Matters in
    that replication.
    """
    row = int((g.integers(w.rep[-1] + 1) + g.uniform(0.25, 0.75)) * w.many)
    return turned(w, o, roll=(np.arange(len(w.t)) >= row) * 1.0)


@EFFECTS(both=True)
def warms_after_start(w: World, o: Output, g: Random, own: Random) -> Array:
    """Everyday. The electronics is switched on at the beginning of each replication and warms up; the thermometer is
    elsewhere. Depends on the time in the replication: zero and some sensitivity, a decay over a tenth to a third of
    it. Matters at the beginning of each replication.
    """
    since = w.t - w.t[w.rep * w.many]
    fade = np.exp(-since / (w.usual * w.many * own.uniform(0.1, 0.33)))
    return o.gain * fade * (1 + own.uniform(-0.6, 0.6) * w.feel @ o.axis)


@EFFECTS(bench=True, both=True)
def dirt_on_the_scale(w: World, o: Output, g: Random, own: Random) -> Array:
    """Unlisted. At a dirty place of the pitch scale the counter loses a line on the way up, and finds it again on the
    way down: above that place pitch is wrong by one line. Depends on pitch (a step), as sensors see pitch. Matters
    always.
    """
    return turned(w, o, pitch=(w.pitch > np.quantile(w.pitch, g.uniform(0.25, 0.75))) * 1.0)


@EFFECTS(both=True)
def bubble_in_the_oil(w: World, o: Output, g: Random, own: Random) -> Array:
    """Unlisted. The damping oil has a bubble, which rises to the highest place of the case. Where it touches the
    pendulum, a part of the buoyancy is lost. Depends on pitch and roll together: a hump around one direction of
    gravity in the case, some tens of degrees wide. Matters near that attitude.
    """
    top = own.choice(w.feel)
    return o.gain * np.exp(own.uniform(4, 15) * (w.feel @ top - 1))


@EFFECTS(bench=True)
def crane_comes_and_goes(w: World, o: Output, g: Random, own: Random) -> Array:
    """Unlisted. The crane of the hall parks above, goes, and comes again; under its weight the floor tilts in one
    direction of the room. Depends on time: two states, 10 to 30 rows each on the average. Seen as a tilt of the room
    by pitch and roll. Matters while the crane is there.
    """
    changes = np.cumsum(g.exponential(w.usual * g.uniform(10, 30), len(w.t)))
    there = np.searchsorted(changes, w.t - w.t[0]) % 2
    where = np.radians(g.uniform(0, 360))
    tilt = np.radians(SMALL) * there
    return o.gain * in_package(np.cos(where) * tilt, np.sin(where) * tilt, 0.0, w.pitch, w.roll) @ o.axis


ABOUT = EFFECTS.about()
PAIRS = [
    ("one_side_softer", "play_in_the_pitch"),
    ("circle_off_centre", "crane_comes_and_goes"),
    ("warms_after_start", "bubble_in_the_oil"),
]
