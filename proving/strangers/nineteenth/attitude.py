"""Inertial attitude sensors (servo accelerometers and kin) on a dividing head that pitches, and rolls them about their
long axis. IEEE 1293 is IEEE Std 1293, specification and test of linear single-axis accelerometers.
"""

import math

import numpy as np

from .common import NOISES, Array, Causes, Lab, Output, Random, World, brown, chance, lagged, play, texts

__all__ = ["ABOUT", "EFFECTS", "NOISES", "PAIRS", "laboratory", "upward"]
EFFECTS = Causes()
enter = EFFECTS.enter


def in_package(north: float, east: float, up: float, pitch: Array, roll: Array) -> Array:
    """(n, 3) a vector fixed in the laboratory, along the package: long axis, across, normal to its lid."""
    p, r = np.radians(pitch), np.radians(roll)
    x, z = np.cos(p) * north + np.sin(p) * up, np.cos(p) * up - np.sin(p) * north
    return np.column_stack([x, np.cos(r) * east + np.sin(r) * z, np.cos(r) * z - np.sin(r) * east])


def upward(pitch: Array, roll: Array) -> Array:
    """(n, 3) what accelerometers at rest feel, g."""
    return in_package(0.0, 0.0, 1.0, pitch, roll)


def laboratory(seed: int, names: tuple[str, ...] = ()) -> Lab:
    """A head, one to three sensors, three to five replications with a fresh start each."""
    g = chance("attitude", seed, "laboratory")
    times, many = int(g.integers(3, 6)), int(g.integers(96, 181))
    n = times * many
    rep = np.arange(n) // many
    reach = float(g.choice([45, 60, 70, 80]))
    digits = int(g.integers(2, 5))
    grid = np.linspace(-reach, reach, int(g.choice([12, 14, 16, 17, 20])))
    rolls = float(g.uniform(-3, 3)) + np.arange(-180, 180, float(g.choice([30, 36, 45, 60])))
    style = str(g.choice(["design", "scattered", "sweeps"], p=[0.45, 0.3, 0.25]))
    pitch, roll = np.empty(n), np.empty(n)
    for k in range(times):
        rows = rep == k
        if style == "design":
            pairs = np.stack(np.meshgrid(grid, rolls), -1).reshape(-1, 2)
            chosen = g.permutation(np.resize(g.permutation(len(pairs)), many))
            pitch[rows], roll[rows] = pairs[chosen].T
        elif style == "scattered":
            pitch[rows], roll[rows] = g.uniform(-reach, reach, many), g.uniform(-180, 180, many)
        else:
            there = np.resize(np.concatenate([grid, grid[::-1]]), many)
            pitch[rows], roll[rows] = there, np.repeat(np.resize(g.permutation(rolls), many), len(grid))[:many]
    pitch, roll = np.round(pitch, digits), np.round((roll + 180) % 360 - 180, digits)
    gaps = g.uniform(30, 80) * g.uniform(0.85, 1.25, n) + 0.1 * np.abs(np.diff(roll, prepend=0.0))
    first = np.arange(n) % many == 0
    usual = float(np.median(gaps))
    gaps[first] += 3600 * g.uniform(2, 15, times)
    t = np.round(np.cumsum(gaps), 1)
    temp = g.uniform(19, 26) + g.uniform(0.3, 0.8) * brown(g, t, 3600 * g.uniform(1, 3))
    temp = temp + g.uniform(0.4, 1.5) * np.sin(2 * np.pi * (t / 86400 + g.random()))
    temp = np.round(temp + g.normal(0, 0.003, n), 3)
    axes = np.eye(3)[[1, 2, 0]] + g.normal(0, 0.01, (3, 3))  # the first lies across the long axis
    if g.random() < 0.35:  # a sensor with a skewed triad
        axes = np.array([[0.58, 0.82, 0], [0.58, -0.41, 0.71], [0.58, -0.41, -0.71]]) + g.normal(0, 0.02, (3, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    feel = upward(pitch, roll)
    volts = float(g.choice([0.5, 1, 2.5, 5]))
    sd = volts * float(g.choice([3e-5, 1e-4, 2e-4]))
    outputs, gains, extra = [], [], []
    restart = float(g.choice([0, 0.6]))  # does each start leave its own bias and scale?
    for j in range(int(g.integers(1, 4))):
        own = sd * (g.uniform(0.8, 1.3) if j else 1.0)
        gain = volts * g.uniform(0.93, 1.07) * float(g.choice([-1, 1]))
        outputs.append(Output("xyz"[j] + "_V", volts * g.normal(0, 0.008) + gain * feel @ axes[j], own))
        new = restart * own * g.standard_normal((times, 4))[rep]
        gains.append(gain)
        extra.append(new[:, 0] + (new[:, 1:] * feel).sum(axis=1))
    columns = {
        "replicate": [str(k + 1) for k in rep],
        "order": [str(k + 1) for k in range(n)],
        "elapsed_s": texts(t, 1),
        "pitch_deg": texts(pitch, digits),
        "roll_deg": texts(roll, digits),
        "sensor_temperature_degC": texts(temp, 3),
    }
    responses = [(out.name, out.declared, out.sd) for out in outputs]
    world = World(
        n=n, rep=rep, times=times, many=many, t=t, pitch=pitch, roll=roll, feel=feel, axes=axes, gains=gains,
        usual=usual, first=first, temp=temp, responses=responses,
    )  # fmt: skip
    return Lab(columns, outputs, np.column_stack([np.ones(n), feel]), rep, world, np.array(extra))


def felt(w: World, j: int) -> Array:
    """Input along the sensor, g."""
    return w.feel @ w.axes[j]


def across(w: World, j: int, turn: float) -> Array:
    """Input across the sensor, g: along the pendulum, where `turn` says where that is."""
    axis = w.axes[j]
    one = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    one /= np.linalg.norm(one)
    return w.feel @ (math.cos(turn) * one + math.sin(turn) * np.cross(axis, one))


def turned(w: World, j: int, pitch: Array = 0.0, roll: Array = 0.0) -> Array:
    """What an error of the head's angles does to a sensor."""
    p, r = np.radians(w.pitch), np.radians(w.roll)
    by_pitch = np.column_stack([np.cos(p), -np.sin(p) * np.sin(r), -np.sin(p) * np.cos(r)]) @ w.axes[j]
    by_roll = np.column_stack([0 * p, np.cos(p) * np.cos(r), -np.cos(p) * np.sin(r)]) @ w.axes[j]
    return w.gains[j] * (by_pitch * pitch + by_roll * roll)


def since_start(w: World) -> Array:
    """Time since the first row of the replication, s."""
    return w.t - w.t[np.maximum.accumulate(np.where(w.first, np.arange(len(w.t)), 0))]


@enter()
def square_of_input(w: World, g: Random, j: int) -> Array:
    """Common. The proof mass is held slightly off the pick-off's null, so that the torquer's force per ampere changes
    with where it is held and the output gets a part with the square of the input. Every pendulous servo accelerometer
    (Q-Flex, QA-2000) has it; K2 of the model equation of IEEE 1293. Depends on pitch and roll through gravity along
    the sensor; matters most towards one g of either sign.
    """
    return w.gains[j] * felt(w, j) ** 2


@enter()
def cube_of_input(w: World, g: Random, j: int) -> Array:
    """Common. The coil's own field weakens the magnet that it pushes against, and flexures stiffen when bent, both
    alike in the two directions. The output gets a part with the cube of the input, K3 of IEEE 1293, known of
    force-balance and of MEMS spring accelerometers. Depends on gravity along the sensor; matters near one g.
    """
    return w.gains[j] * felt(w, j) ** 3


@enter()
def bias_with_temperature(w: World, g: Random, j: int) -> Array:
    """Common. Unequal expansion strains the flexures, and the pick-off's null moves with temperature. All
    accelerometers and inclinometers: tens of microg/K (Titterton and Weston, Strapdown Inertial Navigation
    Technology, ch. 6). Depends on the sensor's temperature alone; matters when the room drifts within a replication.
    """
    return w.gains[j] * (w.temp - 22.0)


@enter()
def scale_with_temperature(w: World, g: Random, j: int) -> Array:
    """Common. The magnet's induction falls with temperature (about -0.02 %/K AlNiCo, -0.04 %/K SmCo) and the load
    resistor drifts, and what the maker's compensation leaves is a scale that follows temperature. All servo
    accelerometers (IEEE 1293, scale factor temperature sensitivity). Depends on temperature times gravity along the
    sensor; matters at large inputs.
    """
    return w.gains[j] * felt(w, j) * (w.temp - 22.0)


@enter()
def warm_up(w: World, g: Random, j: int) -> Array:
    """Common. The electronics are switched on when a replication begins and heat the sensor from within, where the
    recorded thermometer does not see it. Bias then dies away as exp(-t/tau) with tau of ten to forty minutes, as any
    data sheet's turn-on transient says. Depends on time since the start of the replication; matters in its first hour.
    """
    return w.gains[j] * np.exp(-since_start(w) / (60 * g.uniform(10, 40)))


@enter(bench=True)
def eccentric_circle(w: World, g: Random, j: int) -> Array:
    """Common. The graduated circle or encoder disc of the pitch axis sits off its centre, so that one reading head
    reads wrong by a sine of the angle, once a turn. Any dividing head or rotary encoder with a single head (Evans et
    al., Self-calibration: reversal, redundancy, error separation, CIRP Annals 1996). Depends on pitch, acts as a small
    wrong pitch on all sensors; matters with a wide span of pitch.
    """
    return turned(w, j, pitch=np.sin(np.radians(w.pitch) + g.uniform(0, 2 * np.pi)))


@enter(bench=True)
def worm_and_wheel(w: World, g: Random, j: int) -> Array:
    """Common. The worm of the pitch axis has run-out: once for each of its turns, which is one tooth of the wheel, the
    axis leads and lags. Classic dividing heads have 40 teeth, rotary tables 60, 72, 90 or 120 (Moore, Foundations of
    Mechanical Accuracy). Depends on pitch with a period of 360 degrees by the teeth, perhaps below the step of the
    angles; matters in all sensors across the axis.
    """
    teeth = float(g.choice([40, 60, 72, 90, 120]))
    return turned(w, j, pitch=np.sin(teeth * np.radians(w.pitch) + g.uniform(0, 2 * np.pi)))


@enter(bench=True)
def lost_motion(w: World, g: Random, j: int) -> Array:
    """Common. Gears need play: the pitch axis stops short by half of it on the side from which it comes, while the
    encoder sits on the worm. Every head with a worm that is not preloaded (ISO 230-2, reversal value). Depends on the
    sign of the last move in pitch, from the order of rows; matters where poses come from both sides.
    """
    step = np.diff(w.pitch, prepend=w.pitch[0] - 1.0)
    last = np.maximum.accumulate(np.where(step != 0, np.arange(len(step)), 0))
    return turned(w, j, pitch=np.sign(step[last]))


@enter(bench=True)
def pier_tilts_by_day(w: World, g: Random, j: int) -> Array:
    """Common. The pier and the building tilt as the sun heats one side: arc seconds between morning and evening, in a
    direction fixed in the laboratory. Well known at long-base tiltmeters and telescope piers (Agnew, Strainmeters and
    tiltmeters, Rev. Geophys. 1986). Depends on time of day, and on the pose by the horizontal along the sensor;
    matters over long replications.
    """
    way = g.uniform(0, 2 * np.pi)
    level = in_package(math.cos(way), math.sin(way), 0.0, w.pitch, w.roll) @ w.axes[j]
    return w.gains[j] * level * np.sin(2 * np.pi * w.t / 86400 + g.uniform(0, 2 * np.pi))


@enter(bench=True, both=False)
def fixture_sags(w: World, g: Random, j: int) -> Array:
    """Common. The sensor sits on an angle plate that bends under its weight, easily about one of the package's axes and
    little about the other. The package turns by an angle in proportion to the gravity across the plate, which gives
    products of two components of gravity. Any overhung fixture (cantilever, Slocum, Precision Machine Design).
    Depends on pitch and roll, the same angle for all sensors; matters for heavy sensors.
    """
    x, y, z = w.feel.T
    soft, stiff = 1.0, g.uniform(0.1, 0.5)
    moved = np.column_stack([-soft * z * z - stiff * y * y, stiff * x * y, soft * x * z])
    return w.gains[j] * moved @ w.axes[j]


@enter(both=False)
def read_too_early(w: World, g: Random, j: int) -> Array:
    """Common. Fluid damping or a heavy output filter has not settled when the reading begins: a few percent of the
    last change of input are still missing. Electrolytic and fluid-damped inclinometers (Fraden, Handbook of Modern
    Sensors) and servo sensors with a 1 Hz filter or slower. Depends on the change from the row before and on the time
    between; matters after large moves.
    """
    a = felt(w, j)
    return w.gains[j] * (lagged(a, w.t, w.usual * g.uniform(0.25, 0.6)) - a)


@enter()
def temperature_rate(w: World, g: Random, j: int) -> Array:
    """Uncommon. While the package warms there is a gradient across the pendulum, which bends or moves the null, so
    that bias follows how far the core is behind the case. Known of pendulous accelerometers and, as Shupe's effect, of
    fibre gyroscopes (Shupe, Appl. Opt. 1980). Depends on the history of temperature, a lag of 15 to 60 min; matters
    when temperature changes quickly.
    """
    return w.gains[j] * (w.temp - lagged(w.temp, w.t, 60 * g.uniform(15, 60)))


@enter(both=False)
def pivot_sticks(w: World, g: Random, j: int) -> Array:
    """Uncommon. A pivot with friction, or a flexure with slipping clamps, lets the pendulum rest anywhere within a
    small band: it lags on the side from which it came until the input has changed by more. Jewel-pivot accelerometers
    and pendulum clinometers; the play operator (Brokate and Sprekels, Hysteresis and Phase Transitions). Depends on
    the order of inputs along the sensor; matters when they come from both sides.
    """
    a = felt(w, j)
    return w.gains[j] * (play(a, g.uniform(0.01, 0.08)) - a)


@enter(bench=True)
def field_of_the_earth(w: World, g: Random, j: int) -> Array:
    """Uncommon. The torquer is a coil in a magnet with imperfect shields, so that a field along the sensor moves its
    zero: some microg per gauss. The Earth's field, or that of a motor nearby, has a horizontal part which turns in
    the package with pitch and roll in another way than gravity. Data sheets give magnetic sensitivity (IEEE 1293,
    magnetic field effects). Depends on pitch and roll by the field's component; matters with steel or motors nearby.
    """
    heading, dip = g.uniform(0, 2 * np.pi), np.radians(g.uniform(40, 70))
    level = math.cos(dip)
    field = in_package(level * math.cos(heading), level * math.sin(heading), -math.sin(dip), w.pitch, w.roll)
    return abs(w.gains[j]) * field @ w.axes[j]


@enter()
def cross_coupled(w: World, g: Random, j: int) -> Array:
    """Uncommon. Under load the pendulum hangs out of null, so its sensing direction turns, and gravity along the
    pendulum enters in proportion to the input. The product of two inputs, Kip of IEEE 1293, from finite loop
    stiffness; known of all pendulous accelerometers. Depends on pitch and roll by gravity along and across the sensor;
    matters when both are large.
    """
    return w.gains[j] * felt(w, j) * across(w, j, g.uniform(0, 2 * np.pi))


@enter()
def voltmeter_changes_range(w: World, g: Random, j: int) -> Array:
    """Uncommon. The multimeter autoranges: above a voltage it reads through a divider whose ratio is a little wrong,
    and below directly. Gain has a step at the limit of the range, the same for both signs. Any autoranging DMM (Fluke,
    Calibration: Philosophy in Practice). Depends on the size of the voltage itself; matters for a sensor whose span
    reaches beyond one range.
    """
    volts = w.responses[j][1]
    return volts * (np.abs(volts) > g.uniform(0.6, 0.68) * abs(w.gains[j]))


@enter(both=False)
def torquer_heats(w: World, g: Random, j: int) -> Array:
    """Uncommon. Holding one g needs the full torquer current, whose heat warms the magnet with a lag of minutes, and
    a warm magnet pushes less per ampere. Scale thus follows the mean square input of the last minutes. Known of servo
    accelerometers on centrifuges and of voice-coil (Kibble and mass comparator) balances. Depends on the history of
    gravity along the sensor, times what it is now; matters near one g.
    """
    a = felt(w, j)
    return w.gains[j] * a * lagged(a**2, w.t, 60 * g.uniform(2, 9))


@enter(bench=True)
def cable_winds(w: World, g: Random, j: int) -> Array:
    """Uncommon. No slip rings: cables wind up on the roll axis between its stops at 180 degrees, and twist the holder
    by their torsion, in proportion to the angle wound. The roll error is a ramp that jumps at the stops, not a sine.
    Two-axis test tables without slip rings. Depends on roll, acts as a small wrong roll; matters away from zero roll
    for sensors across the axis.
    """
    return turned(w, j, roll=w.roll / 180 + g.uniform(-0.2, 0.2) * (w.roll / 180) ** 2)


@enter()
def knocked_once(w: World, g: Random, j: int) -> Array:
    """Uncommon. Someone bumps the fixture or the head runs into its stop: the clamped pendulum slips by a few
    micrometres, and bias is another one from that row on. Common after shocks (IEEE 1293, shock residual bias).
    Depends on time, a single step within one replication; matters for the replication in which it happens.
    """
    which, when = g.random(), g.uniform(0.25, 0.75)
    k = int(which * w.times)
    return w.gains[j] * np.where((w.rep == k) & (np.arange(len(w.t)) >= (k + when) * w.many), 1.0, 0.0)


PAIRS = [("square_of_input", "warm_up"), ("worm_and_wheel", "bias_with_temperature"), ("lost_motion", "torquer_heats")]
ABOUT = EFFECTS.about()
