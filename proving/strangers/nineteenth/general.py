"""Tables of any laboratory: resistance thermometers, balances, flow meters, torque, length, humidity, multimeters and
photodiodes, each with what its people write down beside the readings.
"""

from dataclasses import dataclass

import numpy as np

from .common import NOISES, Array, Causes, Lab, Output, Random, World, brown, chance, lagged, play, previous, texts

__all__ = ["ABOUT", "EFFECTS", "NOISES", "PAIRS", "laboratory"]
EFFECTS = Causes()
enter = EFFECTS.enter


@dataclass(frozen=True)
class Bench:
    """What is calibrated: column of the stimulus, its ends, response, its zero and slope, error relative to its span."""

    stimulus: str
    low: float
    high: float
    response: str
    zero: float
    slope: float
    error: tuple[float, float]


BENCHES = {
    "bridge": Bench("bath_degC", -40, 230, "thermometer_ohm", 100, 0.38, (1e-5, 1e-4)),
    "balance": Bench("mass_g", 1, 200, "indication_g", 0, 1, (2e-6, 2e-5)),
    "flow": Bench("flow_L_min", 0.8, 40, "meter_Hz", 0, 12.5, (2e-4, 1e-3)),
    "torque": Bench("torque_Nm", 2, 100, "bridge_mV_V", 0, 0.0199, (3e-5, 2e-4)),
    "length": Bench("length_mm", 0.5, 100, "comparator_um", 0.05, 0.021, (3e-3, 2e-2)),
    "humidity": Bench("generator_rh_pct", 8, 95, "probe_V", 0.02, 0.0101, (5e-4, 3e-3)),
    "dmm": Bench("source_V", 0.02, 10, "meter_V", 0, 1, (1e-6, 1e-5)),
    "light": Bench("power_mW", 0.05, 10, "photocurrent_mA", 0, 0.48, (5e-5, 4e-4)),
}


def laboratory(seed: int, names: tuple[str, ...] = ()) -> Lab:
    """A bench on which all the named causes can happen; any, if nothing is hidden."""
    g = chance("general", seed, "laboratory")
    usable = [one for one in BENCHES if all(one in EFFECTS[name].fields or not EFFECTS[name].fields for name in names)]
    chosen = usable[int(g.random() * len(usable))]
    bench = BENCHES[chosen]
    n = int(g.integers(90, 241))
    # the stimulus: levels in random order, at random, or up and down
    style = str(g.choice(["levels", "anywhere", "up and down"], p=[0.45, 0.3, 0.25]))
    many = int(g.integers(8, 16))
    levels = np.linspace(bench.low, bench.high, many)
    if style == "levels":
        x = np.concatenate([g.permutation(levels) for _ in range(n // many + 1)])[:n]
    elif style == "anywhere":
        x = g.uniform(bench.low, bench.high, n)
    else:
        x = np.resize(np.concatenate([levels, levels[::-1]]), n)
    x = np.round(x + g.normal(0, 0.002, n) * (bench.high - bench.low), 3)
    x = np.maximum(x, bench.low) if bench.low > 0 else x
    gaps = g.uniform(60, 260) * g.uniform(0.7, 1.4, n)
    # blocks: none, replications, or whole plots
    blocks = str(g.choice(["none", "replicate", "whole-plot"], p=[0.45, 0.35, 0.2]))
    count = int(g.integers(3, 7)) if blocks == "replicate" else int(g.integers(7, 13))
    block = np.arange(n) * count // n
    begins = np.diff(block, prepend=0) > 0
    if blocks != "none":
        gaps[begins] += g.uniform(1800, 9000, int(begins.sum()))
    t = 3600 * g.uniform(6, 10) + np.cumsum(gaps)
    room = g.choice([20.0, 21.5, 23.0]) + g.uniform(0.3, 0.9) * brown(g, t, 3600 * g.uniform(1, 3))
    room = np.round(room + g.uniform(0.2, 0.8) * np.sin(2 * np.pi * (t / 86400 + g.random())), 2)
    rh = np.round((g.uniform(35, 62) + g.uniform(5, 11) * brown(g, t, 3600 * g.uniform(1, 3))).clip(12, 92), 1)
    hpa = np.round(g.uniform(960, 1018) + g.uniform(3, 8) * brown(g, t, 3600 * g.uniform(3, 10)), 2)
    mains = np.round(float(g.choice([117, 231])) * (1 + 0.012 * brown(g, t, 1200) + g.normal(0, 0.004, n)), 2)
    dwell = np.round(g.uniform(30, 60) * g.choice([0.6, 1.0, 1.0, 1.6, 2.5], n) * g.uniform(0.9, 1.1, n))
    angle = g.choice(np.arange(0, 360, float(g.choice([30, 45, 60]))), n)
    people = g.permutation(["Ines", "Otto", "Ravi", "Maud"])[: int(g.integers(2, 5))]
    hand = np.resize(np.repeat(g.permutation(np.resize(np.arange(len(people)), 24)), int(g.integers(4, 12))), n)
    units = np.array(["P", "Q", "R", "S"])[: int(g.integers(2, 5))]
    unit = g.integers(0, len(units), n)
    current = g.choice([0.5, 1.0, 1.41, 2.0], n) if chosen == "bridge" else np.ones(n)
    span = bench.slope * (bench.high - bench.low)
    sd = span * float(np.exp(g.uniform(*np.log(bench.error))))
    declared = bench.zero + sd * g.normal(0, 5) + bench.slope * (1 + g.normal(0, 0.004)) * x
    terms, model = ["1", bench.stimulus], [np.ones(n), x]
    if g.random() < 0.2:
        terms, model = [*terms, "air_hPa"], [*model, hpa - hpa.mean()]
        declared = declared + sd * g.normal(0, 0.2) * (hpa - hpa.mean())
    clock, unit_s, digits = [("elapsed_s", 1.0, 0), ("t_min", 60.0, 2), ("time_h", 3600.0, 4)][int(g.integers(3))]
    t = unit_s * np.round(t / unit_s, digits)
    options = ["--response", bench.response, "--formula", " + ".join(terms), "--time", clock]
    columns, extra = {}, np.zeros((1, n))
    if blocks != "none":
        label = str(g.choice(["run", "session", "setup"]))
        columns[label] = [str(k + 1) for k in block]
        options += [f"--{blocks}", label]
        extra[0] = sd * float(g.choice([0, 0.5]) if blocks == "replicate" else 0.3) * g.standard_normal(count)[block]
    columns |= {clock: texts(t / unit_s, digits), bench.stimulus: texts(x, 3)}
    beside = {
        "room_degC": texts(room, 2),
        "room_rh_pct": texts(rh, 1),
        "air_hPa": texts(hpa, 2),
        "mains_V": texts(mains, 2),
        "dwell_s": texts(dwell, 0),
        "mounted_deg": texts(angle, 0),
        "operator": [str(people[k]) for k in hand],
        "unit": [str(units[k]) for k in unit],
    }
    if chosen == "bridge":
        beside["current_mA"] = texts(current, 2)
    columns |= {name: beside[name] for name in g.permutation(list(beside))}
    low, high = bench.low, bench.high
    world = World(
        t=t, x=x, high=high, u=(x - min(low, 0.0)) / (high - min(low, 0.0)), room=room, rh=rh, hpa=hpa, mains=mains,
        dwell=dwell, angle=np.radians(angle), hand=hand, unit=unit, current=current, low=low, bench=chosen,
    )  # fmt: skip
    outputs = [Output(bench.response, declared, sd)]
    return Lab(columns, outputs, np.column_stack(model), np.zeros(n), world, extra, options)


@enter()
def zero_with_room(w: World, g: Random, j: int) -> Array:
    """Common. Offset voltages, thermal EMFs and elastic zeros follow the temperature of the room, which was not
    controlled as well as thought. Every amplifier, balance and load cell (data sheets: temperature effect on zero).
    Depends on the room's temperature alone; matters when it moves by a kelvin and more.
    """
    return w.room - 20.0


@enter()
def gain_with_room(w: World, g: Random, j: int) -> Array:
    """Common. Sense resistors, springs and reference voltages follow the room's temperature in proportion, so that
    sensitivity changes. Every instrument has a temperature coefficient of gain (DMM specifications outside 23 +- 5
    degC). Depends on the stimulus times room temperature; matters at large stimuli.
    """
    return w.u * (w.room - 20.0)


@enter("bridge", both=False)
def heats_itself(w: World, g: Random, j: int) -> Array:
    """Common. The measuring current heats the thermometer's element above the bath by I squared R over the coupling:
    millikelvins at 1 mA, four times that at 2 mA. All resistance thermometers; hence extrapolation to zero current
    (Nicholas and White, Traceable Temperatures; CCT Guide on SPRTs). Depends on the square of the current, a little on
    bath temperature by the resistance; matters where the current was varied.
    """
    return w.current**2 * (1 + 0.0039 * w.x)


@enter("balance", both=False)
def air_buoys(w: World, g: Random, j: int) -> Array:
    """Common. Weights of another density than the balance's adjustment float differently in the air, whose density
    follows pressure, temperature and humidity; the correction was made for a constant 1.2 kg/m3. Every balance of high
    resolution (OIML R 111; CIPM-2007, Picard et al., Metrologia 2008). Depends on mass times the density of air, mostly
    barometric pressure; matters for large masses of low density.
    """
    density = (0.34848 * w.hpa - 0.009 * w.rh * np.exp(0.061 * w.room)) / (273.15 + w.room)
    return -w.x * (density - 1.2)


@enter("flow", both=False)
def bearing_drags(w: World, g: Random, j: int) -> Array:
    """Common. At low flow the friction of a turbine's bearing is no longer small against the torque of the fluid, and
    the rotor slips: pulses are lacking towards the lower end. All turbine and vane meters (Baker, Flow Measurement
    Handbook, ch. on turbine meters). Depends on flow, lost rate falls as 1/(1 + q/q0); matters in the lowest tenth.
    """
    return -1 / (1 + w.x / (w.high * g.uniform(0.03, 0.12)))


@enter()
def ages_towards_rest(w: World, g: Random, j: int) -> Array:
    """Common. After transport, switching on or mounting, the zero creeps to a new equilibrium over hours: heat, stress
    or charge. Any instrument without a proper warm-up, gauge factor to Zener. Depends on time alone, exponentially with
    a tenth to the whole of the campaign; matters early.
    """
    since = w.t - w.t[0]
    return np.exp(-since / (since[-1] * g.uniform(0.1, 0.8)))


@enter()
def each_one_reads_otherwise(w: World, g: Random, j: int) -> Array:
    """Common. Aligning a scale, judging a meniscus or closing a clamp has a personal equation: each operator has a
    constant of his or her own. Known since Bessel's transit timings, and as reproducibility in gauge studies (AIAG,
    Measurement Systems Analysis; ISO 5725). Depends on the operator; matters where several share the work.
    """
    own = g.permutation([-1.0, 0.9, 0.3, -0.4] * g.uniform(0.6, 1.4, 4))
    return own[w.hand]


@enter("balance", both=False)
def off_the_centre(w: World, g: Random, j: int) -> Array:
    """Common. The load does not sit in the centre of the pan, and the parallel guide is not quite parallel: indication
    changes with the direction in which the eccentric load lies. All top-loaders (corner-load test, OIML R 76). Depends
    on mass times the cosine of the mounting angle from the guide's worst direction; matters for large masses.
    """
    return w.u * np.cos(w.angle - g.uniform(0, 2 * np.pi))


@enter("dmm")
def meter_changes_range(w: World, g: Random, j: int) -> Array:
    """Common. Above a voltage the meter ranges up, and offset and gain there were adjusted by themselves: a step and
    another slope from the limit on. All autoranging multimeters (Fluke, Calibration: Philosophy in Practice). Depends
    on the stimulus with a step at the range limit; matters for linearity over several ranges.
    """
    limit = float(g.choice([2.0, 3.0, 5.0, 6.0]))
    return (w.x > limit) * (1.0 + g.uniform(-0.5, 0.5) * w.x / w.high)


@enter("humidity", "bridge", both=False)
def not_yet_soaked(w: World, g: Random, j: int) -> Array:
    """Common. The reading is taken a set dwell after the step, but the probe (polymer film, long sheath) is still on
    its way: a part of the last step is missing, less the longer the dwell was. Capacitive humidity sensors and sheathed
    thermometers in a bath (Nicholas and White, response time). Depends on the step from the row before and on the
    dwell, exponentially; matters after large steps and short dwells.
    """
    step = previous(w.x, float(w.x[0])) - w.x
    return step * np.exp(-w.dwell / (np.median(w.dwell) * g.uniform(0.35, 0.8)))


@enter(bench=True)
def air_conditioner_cycles(w: World, g: Random, j: int) -> Array:
    """Common. The air conditioner switches in a steady rhythm of 12 to 50 minutes; the draught reaches the instrument,
    not the slow recorded thermometer. Known in every laboratory with on-off control, from balances to DMMs. Depends on
    time, a sinusoid of one period; matters when rows are quicker than half of it.
    """
    period = 60 * g.uniform(12, 50)
    return np.sin(2 * np.pi * w.t / period + g.uniform(0, 2 * np.pi))


@enter("torque", "humidity", both=False)
def loop_of_loading(w: World, g: Random, j: int) -> Array:
    """Common. Metal under load, or a polymer that took up water, comes back late: the reading on the way up differs from
    that on the way down, most at midscale. Torque and force transducers (reversibility in DIN 51309, ISO 376) and
    capacitive humidity sensors. Depends on the order of stimuli as a play of a tenth to a third of the range; matters
    where both directions occur.
    """
    return play(w.u, g.uniform(0.06, 0.25)) - w.u


@enter("torque", bench=True)
def lever_bends_the_shaft(w: World, g: Random, j: int) -> Array:
    """Uncommon. Lever and couplings hang on the transducer and bend it; its bridge is not quite insensitive to bending,
    and what comes through turns with the mounting position. Reference torque transducers: hence mounting positions at
    120 degrees (DIN 51309, EURAMET cg-14). Depends on the sine of the mounting angle, not on torque; matters when the
    transducer is turned.
    """
    return np.cos(w.angle - g.uniform(0, 2 * np.pi))


@enter("torque", "light", "flow", "dmm", both=False)
def regulator_drops_out(w: World, g: Random, j: int) -> Array:
    """Uncommon. The linear regulator of the supply needs some volts above its output; when the mains sags below a limit,
    it follows the mains, and the reference or excitation with it. Old rack instruments (Horowitz and Hill, The Art of
    Electronics, drop-out). Depends on mains voltage below a limit only, times the stimulus; matters at low line.
    """
    limit = np.quantile(w.mains, g.uniform(0.3, 0.55))
    return -(0.15 + w.u) * np.maximum(0.0, limit - w.mains)


@enter("dmm", "light", "bridge", "humidity")
def damp_insulators(w: World, g: Random, j: int) -> Array:
    """Uncommon. Above about 60 % relative humidity a film of water grows on insulators, and surface resistance falls by
    a decade for some ten percent; a leakage current from guard or supply adds to the reading. Electrometers, photodiode
    amplifiers, old connectors (Keithley, Low Level Measurements Handbook). Depends exponentially on the room's relative
    humidity; matters on damp days.
    """
    return np.exp((w.rh - 60.0) / g.uniform(5, 11))


@enter("length", both=False)
def air_slows_light(w: World, g: Random, j: int) -> Array:
    """Uncommon. The interferometer counts wavelengths in air, and its refractive index was entered once in the morning:
    0.27 ppm/hPa and -0.95 ppm/K are left. Gauge-block and laser interferometers (Edlen, Metrologia 1966; Ciddor, Appl.
    Opt. 1996). Depends on length times the density of air from pressure and temperature; matters for long gauges when
    weather changes.
    """
    return w.x * (w.hpa / 1013.25 * 293.15 / (273.15 + w.room) - 1.0)


@enter("length")
def pitch_of_the_scale(w: World, g: Random, j: int) -> Array:
    """Uncommon. Inside each pitch of an inductive or grating scale the two signals are not equal or not in quadrature,
    and position is wrong by a sine with the pitch as its period. Inductosyn and encoder scales, also polarisation mixing
    in interferometers (Heydemann, Appl. Opt. 1981). Depends on length, periodic in it; matters at all lengths alike.
    """
    pitch = w.high / g.uniform(2.6, 7.5)
    return np.sin(2 * np.pi * w.x / pitch + g.uniform(0, 2 * np.pi))


@enter("length", both=False)
def alloys_expand_otherwise(w: World, g: Random, j: int) -> Array:
    """Uncommon. Gauges of steel, tungsten carbide, ceramic and chromium carbide expand by 11.5, 4.3, 9.5 and 8.4 ppm/K,
    and all were corrected as if of the standard's steel. The error is length times the excess over 20 degC times what
    the unit's material lacks. Gauge-block comparison (ISO 3650; Doiron and Beers, The Gauge Block Handbook, NIST).
    Depends on length, room temperature and unit together; matters for long gauges away from 20 degC.
    """
    ppm = np.array([4.3, 11.5, 9.5, 8.4])
    lacking = np.concatenate([ppm[:2], g.permutation(ppm[2:])]) - 11.5
    return lacking[w.unit] * w.x * (w.room - 20.0)


@enter("light", both=False)
def photodiode_saturates(w: World, g: Random, j: int) -> Array:
    """Uncommon. Photocurrent through the diode's series resistance biases it forward, and a part recombines instead of
    reaching the amplifier: responsivity falls towards high power. Silicon and germanium photodiodes at milliwatts in
    small beams (Schaefer, Zalewski and Geist, Appl. Opt. 1983). Depends on optical power, a loss growing faster than
    its square at first; matters in the upper half.
    """
    return -(w.u ** g.uniform(2.0, 3.5))


PAIRS = [("air_buoys", "off_the_centre"), ("not_yet_soaked", "each_one_reads_otherwise"),
         ("gain_with_room", "air_conditioner_cycles")]  # fmt: skip
ABOUT = EFFECTS.about()
