"""Pendulous accelerometers in one package on a dividing head with two axes, in the gravity of the Earth."""

from types import SimpleNamespace as World

import numpy as np

from .common import NOISES, Array, Causes, Lab, Output, Random, chance, last_side, memory, walk

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


def turned(w: World, o: Output, pitch: Array | float = 0.0, roll: Array | float = 0.0) -> Array:
    """The change of an output when the package stands otherwise than it is thought to stand."""
    return o.gain * (feel(w.pitch + SMALL * pitch, w.roll + SMALL * roll) - w.feel) @ o.axis


def angles(g: Random, style: str, many: int, reach: float) -> tuple[Array, Array]:
    """Pitches and rolls of one replication, in their order."""
    if style == "scattered":
        return g.uniform(-reach, reach, many), g.uniform(0, 360, many)
    turns = int(g.integers(8, 13))
    rungs = -(-many // turns)
    pitch, roll = np.meshgrid(np.linspace(-reach, reach, rungs), np.arange(turns) * 360 / turns + g.uniform(0, 20))
    pitch[1::2] = pitch[1::2, ::-1]  # sweeps, there and back
    order = g.permutation(turns * rungs) if style == "grid, mixed" else np.arange(turns * rungs)
    return pitch.ravel()[order[:many]], roll.ravel()[order[:many]]


def laboratory(seed: int) -> Lab:
    """A laboratory and all that its causes need to know of it."""
    g = chance("attitude", seed, "laboratory")
    times = int(g.integers(3, 6))
    many = int(g.integers(115, 235))
    n = times * many
    rep = np.arange(n) // many
    reach = float(g.choice([45, 55, 65, 80]))
    style = str(g.choice(["scattered", "grid, mixed", "sweeps"]))
    digits = int(g.integers(2, 5))
    parts = [angles(g, style, many, reach) for _ in range(times)]
    pitch = np.round(np.concatenate([p for p, _ in parts]), digits)
    roll = np.round(np.concatenate([r for _, r in parts]), digits) % 360
    gaps = g.uniform(30, 80) * g.uniform(0.85, 1.35, n) + 0.2 * np.abs(np.diff(pitch, prepend=0.0))
    gaps[::many] += 3600 * g.uniform(1, 12, times)
    t = np.round(np.cumsum(gaps), 1)
    usual = float(np.median(gaps))
    celsius = g.uniform(19, 26) + g.uniform(0.3, 1) * walk(g, t, 3600 * g.uniform(1, 3))
    celsius = celsius + g.uniform(0.4, 1.4) * np.sin(2 * np.pi * (t / 86400 + g.random()))
    axes = np.linalg.qr(g.standard_normal((3, 3)))[0]
    if g.random() < 0.5:  # along the package but for its machining; the first is across the roll axis
        axes = np.eye(3)[[*g.permutation([1, 2]), 0]] + g.normal(0, 0.01, (3, 3))
    while np.abs(axes[0, 1:]).max() < 0.3:
        axes = np.roll(axes, 1, axis=0)
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    volts = float(g.choice([0.5, 1, 2.5, 5]))
    sd = volts * float(g.choice([5e-5, 1.5e-4, 4e-4]))
    up = feel(pitch, roll)
    wandering = float(g.choice([0, 1]))  # parameters of its own for each replication?
    outputs = []
    for j in range(int(g.choice([1, 2, 3], p=[0.4, 0.25, 0.35]))):
        own = sd * (g.uniform(0.75, 1.35) if j else 1.0)
        gain = volts * g.uniform(0.93, 1.07) * g.choice([-1, 1])
        new = wandering * g.normal(0, own, (times, 4))[rep]
        shift = new[:, 0] + (new[:, 1:] * up).sum(axis=1)
        outputs.append(
            Output("xyz"[j] + "_V", volts * g.normal(0, 0.01) + gain * up @ axes[j], own, gain, shift, axes[j])
        )
    columns = {
        "replicate": [str(k + 1) for k in rep],
        "order": [str(k + 1) for k in range(n)],
        "elapsed_s": [f"{v:.1f}" for v in t],
        "pitch_deg": [f"{v:.{digits}f}" for v in pitch],
        "roll_deg": [f"{v:.{digits}f}" for v in roll],
        "sensor_temperature_degC": [f"{v:.3f}" for v in celsius + g.normal(0, 0.004, n)],
    }
    world = World(t=t, pitch=pitch, roll=roll, feel=up, reach=reach, usual=usual)
    return Lab(columns, outputs, np.column_stack([np.ones(n), up]), rep, t, world)


EFFECTS = Causes()


@EFFECTS(bench=True)
def cable_winds(w: World, o: Output, g: Random, own: Random) -> Array:
    """Everyday. The package's cable is wound up by roll, and turns the package back against the play of its mount.
    Roll is wrong in proportion to how far the cable is wound from its rest, up to a stop where the head must turn
    back. Depends on roll (straight, with a jump at the stop), as sensors see roll: less at large pitch. Matters near
    the stop.
    """
    stop = g.uniform(0, 360)
    return turned(w, o, roll=1 - (w.roll - stop) % 360 / 180)


@EFFECTS(bench=True, both=True)
def tape_stretched(w: World, o: Output, g: Random, own: Random) -> Array:
    """Everyday. The graduated tape on the pitch sector was glued on stretched, or has slackened: pitch is wrong in
    proportion to its distance from the tape's fixed end. Depends on pitch; roll says how a sensor sees it. Matters at
    large pitch.
    """
    return turned(w, o, pitch=w.pitch / w.reach + g.choice([-1, 1]))


@EFFECTS(bench=True)
def heavy_side(w: World, o: Output, g: Random, own: Random) -> Array:
    """Everyday. The package's centre of mass is beside the roll axis, whose gear has play. Gravity lays the gear
    against one flank or the other, and near balance it stays where it was. Depends on roll (one sign in each half of
    a turn), as sensors see roll; near the change on the row before (move). Matters always.
    """
    moment = np.sin(np.radians(w.roll + g.uniform(0, 360))) * np.cos(np.radians(w.pitch))
    return turned(w, o, roll=-last_side(moment, g.uniform(0.05, 0.15), 1.0))


@EFFECTS()
def coil_warms(w: World, o: Output, g: Random, own: Random) -> Array:
    """Everyday. The current that holds the pendulum warms coil and magnet by its square; a weaker magnet needs more
    current. Depends on gravity along the sensor (pitch and roll) times its square over the last rows (time): a cube
    if fast. Matters at large input, and after it.
    """
    along = w.feel @ o.axis
    return o.gain * along * memory(along**2, w.t, w.usual * own.uniform(0.7, 4), 0.0)


@EFFECTS(bench=True)
def chiller_cycles(w: World, o: Output, g: Random, own: Random) -> Array:
    """Everyday. The air conditioner goes on and off by its thermostat and blows at one side of the arm, which bends:
    pitch is wrong by a triangle in time with a period of 12 to 35 rows. The slow thermometer does not show it.
    Depends on time, as sensors see pitch. Matters always.
    """
    phase = (w.t / (w.usual * g.uniform(12, 35)) + g.random()) % 1
    on = g.uniform(0.25, 0.75)
    return turned(w, o, pitch=np.minimum(phase / on, (1 - phase) / (1 - on)) * g.choice([-1, 1]))


@EFFECTS()
def magnet_on_the_wall(w: World, o: Output, g: Random, own: Random) -> Array:
    """Unlisted. A magnet (of a door, of a dial gauge's foot) is fixed near the arc on which the arm carries the
    package. Its dipole field pulls at the sensor's own magnet. Depends on pitch (a hump where the package comes near)
    times roll (the direction of the pull in the package). Matters near one pitch.
    """
    place, far = np.radians(g.uniform(-0.7, 0.7) * w.reach), g.uniform(1.25, 1.6)
    p = np.radians(w.pitch)
    r = np.stack([np.cos(p) - far * np.cos(place), np.zeros_like(p), far * np.sin(place) - np.sin(p)])
    r += np.array([[0], [g.uniform(-0.2, 0.2)], [0]])
    dipole, own_moment = g.standard_normal((3, 1)), own.standard_normal(3)
    d = np.linalg.norm(r, axis=0)
    ahead, right, down = 3 * (dipole * r).sum(axis=0) * r / d**5 - dipole / d**3
    return in_package(ahead, right, down, w.pitch, w.roll) @ own_moment


@EFFECTS(bench=True)
def table_relevels(w: World, o: Output, g: Random, own: Random) -> Array:
    """Unlisted. The table stands on air springs. When the arm's weight moves, it tilts, until the levelling valve
    acts outside its dead band and brings it back to the band's edge. Depends on pitch by its history: the tilt
    follows a move, but never beyond the band. Seen as pitch is seen. Matters always; the same pitch has different
    errors.
    """
    moment = np.sin(np.radians(w.pitch + g.uniform(-30, 30))) * g.choice([-1, 1])
    band = g.uniform(0.15, 0.35) * np.ptp(moment)
    tilt = np.zeros_like(moment)
    for i, step in enumerate(np.diff(moment), 1):
        tilt[i] = min(max(tilt[i - 1] + step, -band), band)
    return turned(w, o, pitch=tilt)


@EFFECTS(bench=True, both=True)
def dented_bearing(w: World, o: Output, g: Random, own: Random) -> Array:
    """Unlisted. The roll bearing's race has a dent. When it comes into the loaded zone, the axis drops (front
    bearing) or rises (rear): pitch is wrong in a range of roll of some tens of degrees. Depends on roll (a hump), as
    sensors see pitch. Matters near one roll.
    """
    place = g.choice(w.roll) + g.uniform(-4, 4)
    return turned(w, o, pitch=np.exp(-0.5 * (((w.roll - place + 180) % 360 - 180) / g.uniform(9, 18)) ** 2))


ABOUT = EFFECTS.about()
PAIRS = [("heavy_side", "coil_warms"), ("cable_winds", "magnet_on_the_wall"), ("tape_stretched", "chiller_cycles")]
