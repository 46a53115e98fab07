"""A pressure bench written from its physics, which shares no code with the fitter but the table.

Twenty whole plots of eleven pressures, as the paper's: nine pairs of temperatures on a circle, in coded units of the
two ranges, the corners and both sensor-temperature extremes twice, the centre six times; pressures in random order.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from rig.procedures.pressure.data import WholePlotData

PRESSURES = (0.01, 0.01, 0.12, 0.5, 0.79, 1.0, 2.5, 2.5, 4.0, 5.0, 5.0)
CORNER = 0.5**0.5
PAIRS = (
    2 * [(-CORNER, -CORNER), (-CORNER, CORNER), (CORNER, -CORNER), (CORNER, CORNER)]
    + 2 * [(-1.0, 0.0), (1.0, 0.0)]
    + [(0.0, -1.0), (0.0, 1.0)]
    + 6 * [(0.0, 0.0)]
)
SENSOR_DEGC, SSE_DEGC, HALF_RANGE_DEGC = -90.0, 0.0, 40.0
SETTLES_H = 0.35
SILENT_PSIA, BOSS_PSIA, STOP_PSIA, GLASS_DEGC, RECOVERS_H, WARMS_H = 0.4, 0.7, 3.7, -112.0, 9.0, 2.5
CARRIES_PSIA, COOLS_H, BRISTLES_PSIA, SOFTLY_PSIA, BACKLASH_DEGC, DOUBLED_DEGC, AGES_H = (
    0.8,
    0.05,
    0.7,
    0.3,
    15.0,
    15.0,
    6.0,
)
# sd of a reading and of a whole plot, mV: ten times in variance, together 12 % of reading at 0.12 psia and 2 mV/psi
SUBPLOT, WHOLE_PLOT = 0.0049, 0.0155
# undeclared cubic that with a sd growing as 0.4 + 0.3 P gives the paper's 12, 11.5, 3.1 and 2.2 % with its four methods
GROWING, CUBIC = (0.0018, 0.00135), 2.6e-3


@dataclass(frozen=True)
class Transducer:
    """One transducer: its second-order response, and what nobody declared; mV, psi, degC and h."""

    offset: float = 0.3
    sensitivity: float = 2.0
    bend: float = -1e-3
    offset_warm: tuple[float, float] = (1.2e-3, -5e-4)
    offset_warm2: tuple[float, float, float] = (6e-6, -3e-6, 2e-6)
    sensitivity_warm: tuple[float, float] = (-4e-4, 1.5e-4)
    # what nobody declared
    cubic: float = 0.0
    bend_warm: tuple[float, float] = (0.0, 0.0)
    sensitivity_warm2: tuple[float, float, float] = (0.0, 0.0, 0.0)
    offset_warm3: tuple[float, float] = (0.0, 0.0)
    offset_mixed: tuple[float, float] = (0.0, 0.0)  # by sensor x SSE^2, SSE x sensor^2
    hysteresis: float = 0.0  # half the loop's width in its middle
    creep: float = 0.0  # mV per psi of the last step that is still to come
    creep_h: float = 0.0  # time constant of that; zero: none of the steps before the last is remembered
    lag: tuple[float, float] = (0.0, 0.0)  # mV per degC of the last step of each temperature
    lag_h: float = 1.0
    trails: float = 0.0  # part of the sensor's last step that the bridge itself, not its thermometer, is still behind
    drift: float = 0.0  # mV/h from whole plot to whole plot
    settling: float = 0.0  # mV/h within each
    sensitivity_drift: float = 0.0  # mV/psi/h
    step: float = 0.0  # mV from the interruption on
    sensitivity_step: float = 0.0  # mV/psi from the interruption on
    shift: float = 0.0  # mV from `Run.shifted_at` on, which nobody noted
    gain_shift: float = 0.0  # mV/psi from then on
    gradient: float = 0.0  # mV per degC/h at which the transducer's temperature changes
    sticks_cold: float = 0.0  # mV to each side at the coldest, none at the warmest
    silent: float = 0.0  # mV that are missing once pressure has passed `SILENT_PSIA`
    boss: float = 0.0  # mV that a boss adds once it has touched down
    stop: float = 0.0  # mV/psi that are missing beyond `STOP_PSIA`
    glass: float = 0.0  # mV/degC of slope that is gone above `GLASS_DEGC`
    softens: float = 0.0  # of the sensitivity, for each degC above `GLASS_DEGC`
    remembers_cold: float = 0.0  # mV right after cold whole plots
    stale: float = 0.0  # mV/psi per degC of the electronics' step from the whole plot before
    yields: float = 0.0  # mV per degC by which it was ever colder than at the beginning
    day: float = 0.0  # mV up and down
    warming: float = 0.0  # mV at the beginning of the run
    thin: float = 0.0  # mV in vacuum, by the bridge's own heat that gas at `CARRIES_PSIA` carries off by half
    squeezed: float = 0.0  # mV for a step to e times the pressure, from the heat of compression
    rubs: float = 0.0  # mV to each side, by bristles that bend over `BRISTLES_PSIA` before they slide
    rail: float = 0.0  # mV/psi that are missing far beyond `STOP_PSIA`, softly
    backlash: float = 0.0  # mV to each side of the transducer's temperature, turned after `BACKLASH_DEGC`
    seeps: float = 0.0  # mV/h of gas through glass, and doubled by every `DOUBLED_DEGC`


@dataclass(frozen=True)
class Bench:
    """Transducers on one line, and what is wrong with the line."""

    transducers: tuple[Transducer, ...] = (Transducer(),)
    subplot: tuple[float, float] = (SUBPLOT, 0.0)  # sd of a reading at zero, and its growth per psi
    whole_plot: float = WHOLE_PLOT
    carry_over: float = 0.0  # share of the last step of pressure that the line still lacks
    leak_per_h: float = 0.0  # psi per hour and psi below ambient
    reference_per_h: float = 0.0
    reference_zero_per_h: float = 0.0  # psi
    transpiration_psia: float = 0.0  # scale of the line's bore; zero for a line as wide as can be
    sensitivity_sd: float = 0.0  # drawn again in every whole plot, of one
    shared_sd: float = 0.0  # psi, error of the pressure in each reading that all transducers see
    long_tails: bool = False
    reference_cubic: float = 0.0  # psi per psi^3, of the gauge that all transducers are compared with
    head_m: float = 0.0  # transducers below the reference level, in air as cold as they are
    supply_per_h: float = 0.0  # of all bridges' excitation, a part of itself per hour
    supply_settles: float = 0.0  # the same at the beginning, gone with `AGES_H`
    tube_h: float = 0.0  # time constant of a thin tube at its lowest pressure
    supply_per_degC: float = 0.0  # the same, with the electronics' temperature
    remembered: float = 0.0  # correlation of a reading's error with the one before, in its whole plot
    wanders: float = 0.0  # correlation of a whole plot's error with that of the one before
    outliers: int = 0  # readings of the first transducer that are off
    outliers_sd: float = 12.0
    apart_mV: float = 0.0  # one whole plot's error beside the others', in the first transducer


@dataclass(frozen=True)
class Run:
    """How the night went."""

    pairs: tuple[tuple[float, float], ...] = tuple(PAIRS)
    broken: dict[int, int] = field(
        default_factory=dict
    )  # executed whole plots left after so many readings, then redone
    soak_h: float = 1.0
    reading_h: float = 0.08
    uneven: float = 0.3  # of the time a reading takes
    interrupted: bool = False  # a new block half way
    shifted_at: float = 0.6  # part of the whole plots before something happens that nobody notes
    unsettled: float = (
        0.0  # part of the temperatures' step that is left when a whole plot begins, gone with `SETTLES_H`
    )
    plots: str = "random"  # or "ascending" in temperature, or "fixed": as the design lists them
    pressures: str = "random"  # or "ascending", "up and down", or "fixed": the same shuffle in every whole plot


def simulate(bench: Bench = Bench(), run: Run = Run(), seed: int = 0) -> WholePlotData:  # noqa: PLR0915 - a night in its order
    """One run: shuffled whole plots, shuffled pressures, temperatures that hold to 0.05 degC."""
    rng = np.random.default_rng([20261121, seed])
    order = rng.permutation(len(run.pairs))
    if run.plots == "ascending":
        order = np.array(sorted(range(len(run.pairs)), key=lambda which: run.pairs[which]))
    elif run.plots == "fixed":
        order = np.arange(len(run.pairs))
    once = rng.permutation(PRESSURES) if run.pressures == "fixed" else np.array(PRESSURES)
    climbing = {"ascending": once, "up and down": np.concatenate([once[::2], once[::-1][len(once) % 2 :: 2]])}
    plots = []
    for position, which in enumerate(order):
        if position in run.broken:
            plots.append((which, run.broken[position]))
        plots.append((which, len(PRESSURES)))
    pair = np.repeat([run.pairs[which] for which, _ in plots], [count for _, count in plots], axis=0)
    plot = np.repeat(np.arange(len(plots)), [count for _, count in plots])
    visits = climbing.get(run.pressures, once)
    p = np.concatenate(
        [(rng.permutation(PRESSURES) if run.pressures == "random" else visits)[:count] for _, count in plots]
    )
    n = p.size
    first = np.diff(plot, prepend=-1) != 0
    waits = run.reading_h * (1.0 + run.uneven * rng.uniform(-1, 1, n))
    hours = np.cumsum(waits + run.soak_h * first)
    block = (plot >= len(plots) // 2).astype(int) if run.interrupted else np.zeros(n, int)
    nominal = np.array([SENSOR_DEGC, SSE_DEGC]) + HALF_RANGE_DEGC * pair
    at = nominal + 0.05 * rng.standard_normal((n, 2))

    before = np.where(first, p, np.roll(p, 1))
    start = np.maximum.accumulate(np.where(first, np.arange(n), 0))
    since = hours - hours[start]
    of_plot = nominal[np.flatnonzero(first)]
    stepped = np.diff(of_plot, axis=0, prepend=of_plot[:1])[plot]
    side = np.zeros(n)
    for i in range(n):
        side[i] = 0.0 if first[i] else (np.sign(p[i] - p[i - 1]) if p[i] != p[i - 1] else side[i - 1])

    left = run.unsettled * stepped * np.exp(-since / SETTLES_H)[:, None]
    at = at - left
    rate = left[:, 0] / SETTLES_H

    applied = p + bench.carry_over * (before - p) + bench.leak_per_h * (14.7 - p) * waits
    applied = applied * (1.0 + bench.reference_per_h * (hours - hours.mean()))
    applied = applied + bench.reference_zero_per_h * hours
    if bench.transpiration_psia:
        x = p / bench.transpiration_psia
        cold = np.sqrt((at[:, 0] + 273.15) / 295.0)
        applied = applied * (x**2 + x + cold) / (x**2 + x + 1.0)
    # molar mass 28.96 g/mol, g = 9.81 m/s^2, R = 8.314 J/mol/K
    applied = applied * np.exp(0.02896 * 9.81 * bench.head_m / 8.314 / (at[:, 0] + 273.15))
    applied = applied + bench.reference_cubic * p**3
    applied = applied + bench.shared_sd * rng.standard_normal(n)

    if bench.tube_h:
        inside = p[0]
        for i in range(n):
            inside = p[i] if first[i] else _flowed(inside, p[i], waits[i] / bench.tube_h / p.min())
            applied[i] += inside - p[i]

    outputs = {}
    for k, truth in enumerate(bench.transducers):
        a, b = at[:, 0] - SENSOR_DEGC, at[:, 1] - SSE_DEGC
        a = a - truth.trails * stepped[:, 0] * np.exp(-since / truth.lag_h)
        gain = truth.sensitivity + truth.sensitivity_warm[0] * a + truth.sensitivity_warm[1] * b
        gain = gain + np.column_stack([a * a, a * b, b * b]) @ truth.sensitivity_warm2
        gain = gain + truth.gain_shift * (plot >= run.shifted_at * len(plots))
        gain = gain + truth.sensitivity_drift * (hours - hours.mean()) + truth.sensitivity_step * block
        gain = gain + truth.stale * stepped[:, 1]
        gain = gain * (1.0 + bench.sensitivity_sd * rng.standard_normal(len(plots))[plot])
        zero = truth.offset + np.column_stack([a, b]) @ truth.offset_warm
        zero = zero + np.column_stack([a * a, a * b, b * b]) @ truth.offset_warm2
        zero = zero + np.column_stack([a**3, b**3]) @ truth.offset_warm3
        zero = zero + np.column_stack([a * b**2, b * a**2]) @ truth.offset_mixed
        bend = truth.bend + np.column_stack([a, b]) @ truth.bend_warm
        mV = zero + gain * applied + bend * applied**2 + truth.cubic * applied**3
        mV = (
            mV
            + truth.hysteresis * side * 4 * (p - 0.01) * (5.0 - p) / 4.99**2
            + truth.creep * (_behind(p, waits, first, truth.creep_h) if truth.creep_h else before - p)
        )
        mV = mV + stepped @ truth.lag * np.exp(-since / truth.lag_h)
        mV = mV + truth.drift * hours + truth.settling * since + truth.step * block
        mV = mV + truth.shift * (plot >= run.shifted_at * len(plots)) + truth.gradient * rate
        mV = mV + truth.sticks_cold * side * (0.5 - a / 80.0)
        mV = mV + truth.silent * (1.0 - np.minimum(p, SILENT_PSIA) / SILENT_PSIA)
        mV = mV + truth.boss * p**2 / (p**2 + BOSS_PSIA**2) - truth.stop * np.maximum(p - STOP_PSIA, 0.0)
        mV = mV + truth.glass * np.minimum(at[:, 0] - GLASS_DEGC, 0.0)
        mV = mV * (1.0 - truth.softens * np.maximum(at[:, 0] - GLASS_DEGC, 0.0))
        mV = mV + truth.remembers_cold * _cold_before(of_plot[:, 0], hours[first])[plot]
        deepest = [min(of_plot[: k + 1, 0]) for k in range(len(plots))]
        mV = mV + truth.yields * (of_plot[0, 0] - np.array(deepest))[plot]
        mV = mV + truth.day * np.sin(2 * np.pi * (hours + 5.0) / 24.0) + truth.warming * np.exp(-hours / WARMS_H)
        mV = mV + truth.thin / (1.0 + p / CARRIES_PSIA * 295.0 / (at[:, 0] + 273.15))
        mV = mV + truth.squeezed * _compressed(p, waits, first) * (at[:, 0] + 273.15) / 295.0
        mV = mV - truth.rubs * _bristles(p)
        mV = mV - truth.rail * SOFTLY_PSIA * np.log1p(np.exp((p - STOP_PSIA) / SOFTLY_PSIA))
        mV = mV + truth.backlash * _play(of_plot[:, 0])[plot]
        mV = mV + truth.seeps * np.cumsum(np.diff(hours, prepend=0.0) * 2.0 ** (a / DOUBLED_DEGC))
        mV = mV * (1.0 + bench.supply_settles * np.exp(-(hours - hours[0]) / AGES_H))
        mV = mV * (1.0 + bench.supply_per_h * (hours - hours.mean()) + bench.supply_per_degC * b)
        noise = rng.standard_t(5, n) / np.sqrt(5 / 3) if bench.long_tails else rng.standard_normal(n)
        if bench.remembered:
            noise = _remembering(noise, first, bench.remembered)
        if bench.outliers and k == 0:
            off = rng.choice(n, bench.outliers, replace=False)
            noise[off] += bench.outliers_sd * rng.choice([-1.0, 1.0], bench.outliers)
        if bench.apart_mV and k == 0:
            mV = mV + bench.apart_mV * (plot == rng.integers(len(plots)))
        mV = mV + (bench.subplot[0] + bench.subplot[1] * p) * noise
        own = rng.standard_normal(len(plots))
        mV = mV + bench.whole_plot * _remembering(own, np.arange(len(plots)) == 0, bench.wanders)[plot]
        outputs[f"bridge_{k + 1}_mV"] = mV
    return WholePlotData(
        whole_plot=plot,
        order=np.arange(n),
        elapsed_s=3600.0 * hours,
        pressure_psia=p + 2e-5 * rng.standard_normal(n),
        sensor_temperature_degC=at[:, 0],
        sse_temperature_degC=at[:, 1],
        outputs=outputs,
        block=block,
    )


def _behind(p: np.ndarray, waits: np.ndarray, first: np.ndarray, tau_h: float) -> np.ndarray:
    """What a first-order element still lacks of the pressure, having been at rest when each whole plot began."""
    state, out = p[0], np.zeros_like(p)
    for i in range(p.size):
        state = p[i] if first[i] else p[i] + (state - p[i]) * np.exp(-waits[i] / tau_h)
        out[i] = state - p[i]
    return out


def _flowed(inside: float, outside: float, wait: float, steps: int = 400) -> float:
    """Pressure in a tube after a wait, by small steps of the flow: dp/dt = (P^2 - p^2) / 2."""
    for _ in range(steps):
        rate = (outside**2 - inside**2) / 2.0
        inside = inside + rate * wait / steps / (1.0 + max(inside, outside) * wait / steps)
    return inside


def _compressed(p: np.ndarray, waits: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Logarithm of the compression that is still felt as heat."""
    heat, out = 0.0, np.zeros_like(p)
    for i in range(p.size):
        heat = 0.0 if first[i] else (heat + np.log(p[i] / p[i - 1])) * np.exp(-waits[i] / COOLS_H)
        out[i] = heat
    return out


def _bristles(p: np.ndarray) -> np.ndarray:
    """Friction, by small steps of the way: it grows as long as bristles bend, and then slides."""
    held, out = 0.0, np.zeros_like(p)
    for i in range(1, p.size):
        step = (p[i] - p[i - 1]) / 200.0
        for _ in range(200):
            held += (step - held * abs(step)) / BRISTLES_PSIA
        out[i] = held
    return out


def _play(degC: np.ndarray) -> np.ndarray:
    """What a joint with play is behind, -1 to 1."""
    at, out = degC[0], np.zeros_like(degC)
    for k, now in enumerate(degC):
        at = min(max(at, now - BACKLASH_DEGC), now + BACKLASH_DEGC)
        out[k] = (at - now) / BACKLASH_DEGC
    return out


def _cold_before(degC: np.ndarray, hours: np.ndarray) -> np.ndarray:
    """What is left of visits to the cold when each whole plot begins."""
    left, out = 0.0, np.zeros(degC.size)
    for k in range(1, degC.size):
        left = max(left, float(degC[k - 1] < SENSOR_DEGC - 0.4 * HALF_RANGE_DEGC))
        left *= np.exp(-(hours[k] - hours[k - 1]) / RECOVERS_H)
        out[k] = left
    return out


def _remembering(noise: np.ndarray, first: np.ndarray, rho: float) -> np.ndarray:
    """The same noise with a first-order memory that begins anew at each `first`, its variance unchanged."""
    out = noise.copy()
    for i in range(1, noise.size):
        if not first[i]:
            out[i] = rho * out[i - 1] + np.sqrt(1.0 - rho**2) * noise[i]
    return out
