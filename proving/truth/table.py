"""Tables as a laboratory might hand them over, written from what happens there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

Columns = dict[str, Any]
Rng = np.random.Generator


@dataclass(frozen=True)
class Lab:
    """How a table comes about.

    Attributes:
        n: rows.
        covariates: columns recorded besides, none of which does anything: a wandering temperature, a humidity, noise.
        groups: specimens, none different; 0 for no such column.
        clock: whether seconds are recorded.
        sides: whether settings are approached from both sides.
        outliers: share of readings that are off by 10 sd.
        ar: correlation of neighbouring errors.
        walk: sd at the end of a random walk that is added.
        flicker: sd of 1/f noise that is added.
        growing: sd at the highest setting over that at the lowest.
        plots: whole plots, whose errors are as large as the readings'; 0 for none.
        repeats: replications with offsets of one sd; 0 for none.
        design: "random" order of the settings, "sweeps" up and down over eight levels, or "rising" once.

    """

    n: int = 40
    covariates: int = 1
    groups: int = 0
    clock: bool = False
    sides: bool = False
    outliers: float = 0.0
    ar: float = 0.0
    walk: float = 0.0
    flicker: float = 0.0
    growing: float = 1.0
    plots: int = 0
    repeats: int = 0
    design: str = "random"


def simulate(lab: Lab, seed: int, effect: Callable[[Columns, Rng], Any] | None = None) -> Columns:
    """y = 3 + 2 x + error of sd one, x in random order from 0 to 10, plus what an effect adds in units of the sd."""
    rng = np.random.default_rng([seed, lab.n])
    n = lab.n
    c: Columns = {"x": _settings(lab.design, n, rng)}
    recorded = {
        "temp_c": 22.0 + _walk(rng, n, 0.15),
        "humidity": 45.0 + 3.0 * rng.standard_normal(n) + 4.0 * np.sin(np.arange(n) / max(n, 2) * 7.0),
        "supply_V": 12.0 + 0.01 * rng.standard_normal(n),
        "load": rng.choice([0.0, 1.0, 2.0, 5.0], n),
    }
    if lab.covariates > len(recorded):
        recorded |= {
            "pressure_hPa": 1013.0 + 2.0 * _walk(rng, n, 1.0) / np.sqrt(n),
            "room_c": 21.0 + np.sin(np.arange(n) / n * 9.0 + rng.uniform(0.0, 6.0)) + 0.05 * rng.standard_normal(n),
        }
    c |= dict(list(recorded.items())[: lab.covariates])
    if lab.groups:
        c["unit"] = rng.permutation(np.arange(n) % lab.groups)
    if lab.clock:
        c["t_s"] = np.cumsum(60.0 + 5.0 * rng.random(n))
    if lab.sides:
        c["side"] = rng.choice([-1.0, 1.0], n)
    if lab.plots:
        c["plot"] = np.arange(n) * lab.plots // n
    if lab.repeats:
        c["rep"] = np.arange(n) * lab.repeats // n
    error = rng.standard_normal(n)
    if lab.ar:
        for i in range(1, n):
            error[i] = lab.ar * error[i - 1] + np.sqrt(1.0 - lab.ar**2) * error[i]
    if lab.walk:
        error += _walk(rng, n, lab.walk / np.sqrt(n))
    if lab.flicker:
        error += lab.flicker * _flicker(rng, n)
    error *= 1.0 + (lab.growing - 1.0) * c["x"] / 10.0
    for name in ("plot", "rep"):
        if name in c:
            error += rng.standard_normal(c[name].max() + 1)[c[name]]
    if lab.outliers:
        off = rng.random(n) < lab.outliers
        error[off] += 10.0 * rng.choice([-1.0, 1.0], int(off.sum()))
    c["y"] = 3.0 + 2.0 * c["x"] + error + (0.0 if effect is None else effect(c, rng))
    return c


def options(lab: Lab) -> dict[str, Any]:
    """What a user would say of the columns."""
    told: dict[str, Any] = {"response": "y", "formula": "1 + x"}
    if lab.groups:
        told["group"] = ("unit",)
    if lab.clock:
        told["time"] = "t_s"
    if lab.sides:
        told["direction"] = "side"
    if lab.plots:
        told["whole_plot"] = ("plot",)
    if lab.repeats:
        told["replicate"] = "rep"
    return told


def _walk(rng: Rng, n: int, step: float) -> Any:
    return np.cumsum(step * rng.standard_normal(n))


def _flicker(rng: Rng, n: int) -> Any:
    """1/f noise of sd one, by its spectrum."""
    spectrum = np.fft.rfft(rng.standard_normal(4 * n))
    spectrum[1:] /= np.sqrt(np.arange(1, len(spectrum)))
    spectrum[0] = 0.0
    wave = np.fft.irfft(spectrum)[:n]
    return wave / np.std(wave)


def _settings(design: str, n: int, rng: Rng) -> Any:
    """(n,) from 0 to 10 in the order of taking."""
    if design == "sweeps":
        return np.abs((np.arange(n) + 7) % 14 - 7) / 0.7
    rising = np.round(np.linspace(0.0, 10.0, n), 3)
    return rising if design == "rising" else rng.permutation(rising)


def _scaled(column: Any, x: Any, rms: float) -> Any:
    """A column of a given rms beside a straight line over x."""
    line = np.column_stack([np.ones_like(x), x])
    left = column - line @ np.linalg.lstsq(line, column, rcond=None)[0]
    return column * rms / np.sqrt(np.mean(left**2))


@dataclass(frozen=True)
class Missing:
    """An effect the declared straight line lacks.

    Attributes:
        column: what it adds, up to its size.
        named: beginnings of names by which it is rightly reported.
        lab: on which it shows.

    """

    column: Callable[[Columns], Any]
    named: tuple[str, ...]
    lab: Lab = field(default_factory=Lab)

    def at(self, rms: float) -> Callable[[Columns, Rng], Any]:
        """The effect with an rms of so many sd beside the straight line."""
        return lambda c, _rng: _scaled(np.asarray(self.column(c), float), c["x"], rms)


def _lagging(v: Any, rows: float) -> Any:
    out = np.empty(len(v))
    out[0] = v[0]
    for i in range(1, len(v)):
        out[i] = out[i - 1] + (v[i] - out[i - 1]) * (1.0 - np.exp(-1.0 / rows))
    return out


CLOCKED = Lab(120, clock=True)
MISSING = {
    "curvature": Missing(lambda c: c["x"] ** 2, ("second-order:x",), Lab(60)),
    "cubic": Missing(lambda c: (c["x"] - 5) ** 3, ("third-order:x",), Lab(60)),
    "kink": Missing(lambda c: np.maximum(c["x"] - 6.3, 0), ("kink:x",), Lab(100)),
    "wave": Missing(lambda c: np.sin(2 * np.pi * c["x"] / 1.7 + 0.4), ("periodic:x",), Lab(100)),
    "temperature": Missing(lambda c: c["temp_c"], ("temperature:temp_c",), CLOCKED),
    "sensitivity": Missing(
        lambda c: c["x"] * (c["temp_c"] - c["temp_c"].mean()), ("sensitivity-temperature:temp_c",), CLOCKED
    ),
    "lag": Missing(lambda c: _lagging(c["temp_c"], 12.0), ("thermal-lag:temp_c",), Lab(200, clock=True)),
    "drift": Missing(lambda c: c["t_s"], ("drift:t_s",), CLOCKED),
    "warm-up": Missing(lambda c: np.exp(-c["t_s"] / 900.0), ("warm-up:t_s",), CLOCKED),
    "square root": Missing(lambda c: np.sqrt(c["x"]), ("square-root:",), Lab(60)),
    "step": Missing(lambda c: c["t_s"] > 0.37 * c["t_s"].max(), ("step:t_s",), CLOCKED),
    "oscillation": Missing(lambda c: np.sin(2 * np.pi * c["t_s"] / 900.0), ("oscillation:t_s",), CLOCKED),
    "group offset": Missing(
        lambda c: np.array([0.3, -1.0, 0.2, 1.4, -0.9])[c["unit"]], ("group-offset:unit",), Lab(60, groups=5)
    ),
    "group gain": Missing(
        lambda c: np.array([0.3, -1.0, 0.2, 1.4, -0.9])[c["unit"]] * c["x"], ("group-gain:unit",), Lab(60, groups=5)
    ),
    "direction": Missing(lambda c: c["side"], ("direction:",), Lab(60, sides=True)),
    "hysteresis": Missing(lambda c: c["side"] * c["x"] * (10 - c["x"]), ("hysteresis:",), Lab(60, sides=True)),
    "carry-over": Missing(
        lambda c: np.concatenate([c["x"][:1], c["x"][:-1]]) - c["x"], ("carry-over:x",), Lab(60, clock=True)
    ),
}
