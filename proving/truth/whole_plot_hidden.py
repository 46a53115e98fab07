"""Effects to hide in runs of proving/truth/whole_plot.py, at any size: each by itself, or several at once.

A size is the root mean square of what the declared model cannot take up, in the stratum the effect is judged in, over
that stratum's own error: readings within whole plots, or whole plots' means. It is worked out here with least squares.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from proving.truth.whole_plot import SUBPLOT, WHOLE_PLOT, Bench, Run, Transducer, simulate
from rig.procedures.pressure.data import WholePlotData

# nine temperatures of the transducer: a knee is none of a cube
NINE = tuple((k / 4.0 - 1.0, (-1.0) ** k * e) for e in (0.3, 1.0) for k in range(9)) + 2 * ((0.0, 0.0),)
ORDINARY, NIGHT = Bench(), Run()
WARM, WARMED = ("P:T_sensor", "P:T_SSE"), Transducer().sensitivity_warm


@dataclass(frozen=True)
class Hidden:
    """One effect.

    Attributes:
        expected: name in the catalogue.
        own: fields of the first transducer.
        line: fields of the bench.
        run: fields of the run.
        between: whether it is one of whole plots.
        lacks: terms that the declared model lacks for it.

    """

    expected: str
    own: Mapping[str, Any] = field(default_factory=dict)
    line: Mapping[str, Any] = field(default_factory=dict)
    run: Mapping[str, Any] = field(default_factory=dict)
    between: bool = False
    lacks: tuple[str, ...] = ()


HIDDEN: Mapping[str, Hidden] = {
    "cubic": Hidden("pressure-third-order", {"cubic": 1e-3}),
    "bend, sensor": Hidden("pressure-squared-temperature", {"bend_warm": (4e-5, 0.0)}),
    "bend, electronics": Hidden("pressure-squared-temperature", {"bend_warm": (0.0, 5e-5)}),
    "gain, sensor squared": Hidden("pressure-temperature-squared", {"sensitivity_warm2": (2e-6, 0.0, 0.0)}),
    "gain, both": Hidden("pressure-temperature-squared", {"sensitivity_warm2": (0.0, 2e-6, 0.0)}),
    "gain, electronics squared": Hidden("pressure-temperature-squared", {"sensitivity_warm2": (0.0, 0.0, 2e-6)}),
    "sensor cubed": Hidden("sensor-temperature-third-order", {"offset_warm3": (3e-6, 0.0)}, between=True),
    "electronics cubed": Hidden("sse-temperature-third-order", {"offset_warm3": (0.0, 5e-6)}, between=True),
    "sensor by electronics squared": Hidden("sensor-by-sse-squared", {"offset_mixed": (5e-6, 0.0)}, between=True),
    "electronics by sensor squared": Hidden("sse-by-sensor-squared", {"offset_mixed": (0.0, 5e-6)}, between=True),
    "hysteresis": Hidden("hysteresis", {"hysteresis": 5e-3}),
    "creep": Hidden("creep", {"creep": 1.2e-3}),
    "creep that is remembered": Hidden("creep", {"creep": 1.2e-3, "creep_h": 0.3}),
    "carry-over": Hidden("carry-over", line={"carry_over": 4e-4}),
    "sensor lags": Hidden("thermal-lag", {"lag": (3e-4, 0.0)}),
    "electronics lag": Hidden("sse-thermal-lag", {"lag": (0.0, 4e-4)}),
    "sensor trails its thermometer": Hidden("thermal-lag", {"trails": 0.1}),
    "gradient": Hidden("thermal-gradient", {"gradient": 3e-3}, run={"unsettled": 0.05}),
    "transpiration": Hidden("thermal-transpiration", line={"transpiration_psia": 0.15}),
    "head": Hidden("head-correction", line={"head_m": 5.0}, lacks=("P:T_sensor",)),
    "interruption": Hidden("offset-step", {"step": 0.08}, run={"interrupted": True}, between=True),
    "interruption, gain": Hidden("sensitivity-step", {"sensitivity_step": 3e-3}, run={"interrupted": True}),
    "unrecorded step": Hidden("offset-step-unrecorded", {"shift": 0.08}, between=True),
    "unrecorded step, gain": Hidden("sensitivity-step-unrecorded", {"gain_shift": 3e-3}),
    "drift of whole plots": Hidden("whole-plot-drift", {"drift": 4e-3}, between=True),
    "reference zero drifts": Hidden("reference-zero-drift", line={"reference_zero_per_h": 1.5e-3}, between=True),
    "drift within": Hidden("subplot-drift", {"settling": 8e-3}),
    "gain drifts": Hidden("sensitivity-drift", {"sensitivity_drift": 1e-4}),
    "reference drifts": Hidden("reference-drift", line={"reference_per_h": 4e-5}),
    "supply, time": Hidden("excitation", line={"supply_per_h": 4e-5}),
    "supply, electronics": Hidden("excitation", line={"supply_per_degC": 2e-5}, lacks=("P:T_SSE",)),
    "reference bends": Hidden("reference-nonlinearity", line={"reference_cubic": 5e-4}),
    "sticks in the cold": Hidden("hysteresis-temperature", {"sticks_cold": 6e-3}),
    "silent below": Hidden("dead-band", {"silent": 2e-2}),
    "boss touches down": Hidden("touch-down", {"boss": 2e-2}),
    "stop is near": Hidden("saturation", {"stop": 2e-2}),
    "glass transition": Hidden("offset-knee", {"glass": 5e-3}, run={"pairs": NINE}, between=True),
    "adhesive softens": Hidden("sensitivity-knee", {"softens": 3e-5}, run={"pairs": NINE}),
    "remembers the cold": Hidden("thermal-hysteresis", {"remembers_cold": 0.1}, between=True),
    "corrected with an old temperature": Hidden("sse-thermal-lag", {"stale": 2e-5}),
    "glue yields in the cold": Hidden("thermal-ratchet", {"yields": 2e-3}, between=True),
    "follows the day": Hidden("daily-course", {"day": 0.05}, between=True),
    "warms up": Hidden("warm-up", {"warming": 0.1}, between=True),
    "gas cools the bridge": Hidden("gas-cooling", {"thin": 2e-2}),
    "gas is warmed by compression": Hidden("compression-heat", {"squeezed": 3e-3}),
    "friction that turns": Hidden("hysteresis", {"rubs": 5e-3}),
    "rail is soft": Hidden("saturation", {"rail": 2e-2}),
    "joint with play": Hidden("thermal-hysteresis", {"backlash": 0.1}, between=True),
    "gas through glass": Hidden("whole-plot-drift", {"seeps": 4e-3}, between=True),
    "supply settles": Hidden("excitation", line={"supply_settles": 1e-3}),
    "thin tube": Hidden("carry-over", line={"tube_h": 0.1}),
    "leak": Hidden("line-leak", line={"leak_per_h": 8e-3}, run={"uneven": 0.6}),
}


@dataclass(frozen=True, eq=False)
class Hiding:
    """A run with effects in it.

    Attributes:
        data: as measured.
        model: to declare.
        columns: of each effect, what it adds to each transducer's outputs at a size of one error, mV.
        scales: of each effect, what its amplitude in `HIDDEN` was multiplied by.
        truth: outputs without any error, mV.

    """

    data: WholePlotData
    model: str
    columns: tuple[Mapping[str, np.ndarray], ...]
    scales: tuple[float, ...]
    truth: Mapping[str, np.ndarray]


def hide(
    names: Sequence[str],
    sizes: Sequence[float],
    seed: int,
    transducers: int = 3,
) -> Hiding:
    """A run with some of `HIDDEN` in it, on a bench that has more `transducers` and whatever noise it has."""
    several = [HIDDEN[name] for name in names]
    plain = tuple(Transducer(offset=0.3 + 0.1 * k, sensitivity=2.0 - 0.03 * k) for k in range(transducers))
    lacks = [term for one in several for term in one.lacks]
    by_sensor, by_sse = (0.0 if term in lacks else own for term, own in zip(WARM, WARMED, strict=True))
    plain = tuple(replace(one, sensitivity_warm=(by_sensor, by_sse)) for one in plain)
    bench, run = replace(ORDINARY, transducers=plain), NIGHT
    for one in several:
        run = replace(run, **one.run)
    clean = simulate(bench, run, seed)
    truth = dict(simulate(replace(bench, subplot=(0.0, 0.0), whole_plot=0.0), run, seed).outputs)
    model = declared(lacks)
    outputs, columns, scales = dict(clean.outputs), [], []
    for one, size in zip(several, sizes, strict=True):
        own = (replace(plain[0], **one.own), *plain[1:])
        with_it = simulate(replace(bench, transducers=own, **one.line), run, seed)
        added = {s: v - clean.outputs[s] for s, v in with_it.outputs.items()}
        unit = max(left(clean, v, one) for v in added.values())
        scales.append(size / unit)
        columns.append({s: v / unit for s, v in added.items()})
        for s, v in columns[-1].items():
            outputs[s], truth[s] = outputs[s] + size * v, truth[s] + size * v
    return Hiding(replace(clean, outputs=outputs), model, tuple(columns), tuple(scales), truth)


def declared(lacks: Sequence[str]) -> str:
    """The full model without some terms."""
    terms = "1 + P + T_sensor + T_SSE + P^2 + T_sensor^2 + T_SSE^2 + P:T_sensor + P:T_SSE + T_sensor:T_SSE"
    kept = [term for term in terms.split(" + ") if term not in lacks]
    return "full" if not lacks else " + ".join(kept)


def left(data: WholePlotData, added: np.ndarray, one: Hidden) -> float:
    """Root mean square of what the declared model cannot take up of a column, over its stratum's error."""
    plot = np.eye(data.whole_plots.size)[data.whole_plot_index]
    count = plot.sum(axis=0)
    p, a, b = data.pressure_psia, data.sensor_temperature_degC + 90.0, data.sse_temperature_degC
    of_pressure = {"P": p, "P^2": p * p, "P:T_sensor": p * a, "P:T_SSE": p * b}
    within = np.column_stack([column for name, column in of_pressure.items() if name not in one.lacks])
    if not one.between:
        x = np.column_stack([plot, within])
        scaled = x / np.abs(x).max(axis=0)
        e = added - scaled @ np.linalg.lstsq(scaled, added, rcond=None)[0]
        return float(np.sqrt(np.mean(e**2)) / SUBPLOT)
    y, a, b = (plot.T @ v / count for v in (added, a / 40.0, b / 40.0))
    x = np.column_stack([np.ones_like(a), a, b, a * a, a * b, b * b])
    e = y - x @ np.linalg.lstsq(x, y, rcond=None)[0]
    return float(np.sqrt(np.mean(e**2)) / np.hypot(WHOLE_PLOT, SUBPLOT / np.sqrt(count.mean())))
