"""A pressure bench written from its physics, for tests of the fitter: nothing here comes from `fitter` but the table.

Twenty whole plots of eleven pressures, as the paper's: nine pairs of temperatures on a circle, in coded units of the
two ranges, the corners and both sensor-temperature extremes twice, the centre six times; pressures in random order.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from fitter.whole_plot_data import WholePlotData

PRESSURES = (0.01, 0.01, 0.12, 0.5, 0.79, 1.0, 2.5, 2.5, 4.0, 5.0, 5.0)
CORNER = 0.5**0.5
PAIRS = (
    2 * [(-CORNER, -CORNER), (-CORNER, CORNER), (CORNER, -CORNER), (CORNER, CORNER)]
    + 2 * [(-1.0, 0.0), (1.0, 0.0)]
    + [(0.0, -1.0), (0.0, 1.0)]
    + 6 * [(0.0, 0.0)]
)
SENSOR_DEGC, SSE_DEGC, HALF_RANGE_DEGC = -90.0, 0.0, 40.0
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
    lag: tuple[float, float] = (0.0, 0.0)  # mV per degC of the last step of each temperature
    lag_h: float = 1.0
    drift: float = 0.0  # mV/h from whole plot to whole plot
    settling: float = 0.0  # mV/h within each
    sensitivity_drift: float = 0.0  # mV/psi/h
    step: float = 0.0  # mV from the interruption on


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
    sensitivity_sd: float = 0.0  # drawn anew in every whole plot, of one
    shared_sd: float = 0.0  # psi, error of the pressure in each reading that all transducers see
    long_tails: bool = False


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


def simulate(bench: Bench = Bench(), run: Run = Run(), seed: int = 0) -> WholePlotData:
    """One run: shuffled whole plots, shuffled pressures, temperatures that hold to 0.05 degC."""
    rng = np.random.default_rng([20261121, seed])
    order = rng.permutation(len(run.pairs))
    plots = []
    for position, which in enumerate(order):
        if position in run.broken:
            plots.append((which, run.broken[position]))
        plots.append((which, len(PRESSURES)))
    pair = np.repeat([run.pairs[which] for which, _ in plots], [count for _, count in plots], axis=0)
    plot = np.repeat(np.arange(len(plots)), [count for _, count in plots])
    p = np.concatenate([rng.permutation(PRESSURES)[:count] for _, count in plots])
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

    applied = p + bench.carry_over * (before - p) + bench.leak_per_h * (14.7 - p) * waits
    applied = applied * (1.0 + bench.reference_per_h * (hours - hours.mean()))
    applied = applied + bench.reference_zero_per_h * hours
    if bench.transpiration_psia:
        x = p / bench.transpiration_psia
        cold = np.sqrt((at[:, 0] + 273.15) / 295.0)
        applied = applied * (x**2 + x + cold) / (x**2 + x + 1.0)
    applied = applied + bench.shared_sd * rng.standard_normal(n)

    outputs = {}
    for k, truth in enumerate(bench.transducers):
        a, b = at[:, 0] - SENSOR_DEGC, at[:, 1] - SSE_DEGC
        gain = truth.sensitivity + truth.sensitivity_warm[0] * a + truth.sensitivity_warm[1] * b
        gain = gain + np.column_stack([a * a, a * b, b * b]) @ truth.sensitivity_warm2
        gain = gain + truth.sensitivity_drift * (hours - hours.mean())
        gain = gain * (1.0 + bench.sensitivity_sd * rng.standard_normal(len(plots))[plot])
        zero = truth.offset + np.column_stack([a, b]) @ truth.offset_warm
        zero = zero + np.column_stack([a * a, a * b, b * b]) @ truth.offset_warm2
        zero = zero + np.column_stack([a**3, b**3]) @ truth.offset_warm3
        zero = zero + np.column_stack([a * b**2, b * a**2]) @ truth.offset_mixed
        bend = truth.bend + np.column_stack([a, b]) @ truth.bend_warm
        mV = zero + gain * applied + bend * applied**2 + truth.cubic * applied**3
        mV = mV + truth.hysteresis * side * 4 * (p - 0.01) * (5.0 - p) / 4.99**2 + truth.creep * (before - p)
        mV = mV + stepped @ truth.lag * np.exp(-since / truth.lag_h)
        mV = mV + truth.drift * hours + truth.settling * since + truth.step * block
        noise = rng.standard_t(5, n) / np.sqrt(5 / 3) if bench.long_tails else rng.standard_normal(n)
        mV = mV + (bench.subplot[0] + bench.subplot[1] * p) * noise
        mV = mV + bench.whole_plot * rng.standard_normal(len(plots))[plot]
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


# every effect of the catalogue at the size it must be found at: bench, run, and what it is to be called
EFFECTS: dict[str, tuple[Bench, Run, str]] = {
    "cubic": (Bench((Transducer(cubic=1e-3),)), Run(), "pressure-third-order"),
    "bend and sensor temperature": (
        Bench((Transducer(bend_warm=(4e-5, 0.0)),)),
        Run(),
        "pressure-squared-temperature",
    ),
    "bend and electronics' temperature": (
        Bench((Transducer(bend_warm=(0.0, 5e-5)),)),
        Run(),
        "pressure-squared-temperature",
    ),
    "sensitivity and temperature squared": (
        Bench((Transducer(sensitivity_warm2=(2e-6, 0.0, 0.0)),)),
        Run(),
        "pressure-temperature-squared",
    ),
    "sensor temperature cubed": (
        Bench((Transducer(offset_warm3=(3e-6, 0.0)),)),
        Run(),
        "sensor-temperature-third-order",
    ),
    "electronics' temperature cubed": (
        Bench((Transducer(offset_warm3=(0.0, 5e-6)),)),
        Run(),
        "sse-temperature-third-order",
    ),
    "sensor by electronics squared": (
        Bench((Transducer(offset_mixed=(5e-6, 0.0)),)),
        Run(),
        "sensor-temperature-third-order",  # on this design the same: the first in the catalogue leads
    ),
    "electronics by sensor squared": (
        Bench((Transducer(offset_mixed=(0.0, 5e-6)),)),
        Run(),
        "sse-temperature-third-order",
    ),
    "hysteresis": (Bench((Transducer(hysteresis=5e-3),)), Run(), "hysteresis"),
    "creep, one transducer": (Bench((Transducer(creep=1.2e-3),)), Run(), "carry-over"),
    "creep of one of three": (
        Bench((Transducer(creep=1.2e-3), Transducer(), Transducer())),
        Run(),
        "creep",
    ),
    "carry-over, three transducers": (Bench(3 * (Transducer(),), carry_over=4e-4), Run(), "carry-over"),
    "sensor lags": (Bench((Transducer(lag=(3e-4, 0.0)),)), Run(), "thermal-lag"),
    "electronics lag": (Bench((Transducer(lag=(0.0, 4e-4)),)), Run(), "sse-thermal-lag"),
    "transpiration": (Bench(3 * (Transducer(),), transpiration_psia=0.15), Run(), "thermal-transpiration"),
    "interruption": (Bench((Transducer(step=0.08),)), Run(interrupted=True), "offset-step"),
    "drift of whole plots": (Bench((Transducer(drift=4e-3),)), Run(), "whole-plot-drift"),
    "drift within": (Bench((Transducer(settling=8e-3),)), Run(), "subplot-drift"),
    "sensitivity of one drifts": (
        Bench((Transducer(sensitivity_drift=1e-4), Transducer(), Transducer())),
        Run(),
        "sensitivity-drift",
    ),
    "reference drifts, three": (Bench(3 * (Transducer(),), reference_per_h=4e-5), Run(), "reference-drift"),
    "reference zero drifts, three": (
        Bench(3 * (Transducer(),), reference_zero_per_h=1.5e-3),
        Run(),
        "reference-zero-drift",
    ),
    "leak, three": (Bench(3 * (Transducer(),), leak_per_h=8e-3), Run(uneven=0.6), "line-leak"),
}
