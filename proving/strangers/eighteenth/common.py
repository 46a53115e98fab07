"""What the kinds share: causes, memories, noises, and how a table comes out of a laboratory."""

import math
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any, TypeAlias

import numpy as np

Array: TypeAlias = Any  # an array of numpy
Random = np.random.Generator
Act = Callable[[SimpleNamespace, "Output", Random, Random], Array]

NOISES = {
    "white": "normal and independent",
    "heavy": "Student's t of 3.5 to 5 degrees of freedom, cut off at 10 standard deviations",
    "wander": "a part of the variance wanders, with a memory of some rows in real time",
    "restless": "normal; in some stretches of rows the standard deviation is two to three times as large",
    "grows": "normal, the standard deviation grows with the signal",
    "glitches": "normal, but one or two rows of a hundred are far off",
    "rounded": "normal, and the display has steps of about one standard deviation",
}


@dataclass
class Output:
    """A response: what the declared model makes of it, the sd of a row's error, what replications add to it."""

    name: str
    declared: Array
    sd: float
    gain: float
    shift: Array = 0.0
    axis: Array = None


@dataclass
class Lab:
    """A laboratory before anything hidden happens. `share`: of the variance, for an error of a whole block."""

    columns: dict[str, list[str]]
    outputs: list[Output]
    model: Array
    groups: Array
    t: Array
    world: SimpleNamespace
    options: list[str] = field(default_factory=list)
    block: Array = None
    share: float = 0.0


@dataclass
class Table:
    """What the contract asks for, and for the tests: the laboratory, the display's step, what the model leaves."""

    csv: str
    options: list[str]
    size: float
    hidden: Array
    lab: Lab
    display: float
    left: dict[str, float]


@dataclass
class Cause:
    """`act(world, output, g, own)`: g is common to all outputs, own is the output's. `bench`: one size for all outputs.
    `both`: physics allows either sign.
    """

    act: Act
    bench: bool
    both: bool

    @property
    def about(self) -> str:
        """What happens, on which recorded variables it depends, when it matters."""
        return " ".join((self.act.__doc__ or "").split())


class Causes(dict[str, Cause]):
    """Causes by name. A function's docstring says what happens."""

    def __call__(self, bench: bool = False, both: bool = False) -> Callable[[Act], Act]:
        """A decorator that enters a function."""

        def enter(act: Act) -> Act:
            self[act.__name__] = Cause(act, bench, both)
            return act

        return enter

    def about(self) -> dict[str, str]:
        """The same of all, by name."""
        return {name: cause.about for name, cause in self.items()}


def chance(kind: str, seed: int, what: str, j: int = 0) -> Random:
    """A generator of its own for each thing that is drawn."""
    return np.random.default_rng([18, 20261130, seed, j, zlib.crc32(f"{kind} {what}".encode())])


def rms(v: Array) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(v))))


def residual(v: Array, model: Array, groups: Array) -> Array:
    """What least squares leaves of v, group by group; twice, for the last digits."""
    rest = np.array(v, float)
    for label in np.unique(groups):
        rows = groups == label
        scaled = model[rows] / np.abs(model[rows]).max(axis=0).clip(1e-300)
        for _ in range(2):
            rest[rows] -= scaled @ np.linalg.lstsq(scaled, rest[rows], rcond=1e-11)[0]
    return rest


def memory(level: Array, t: Array, tau: float, begin: float | None = None) -> Array:
    """First order; the level of a row is there from the reading of the row before it."""
    state = np.array(level, float)
    if begin is not None:
        state[0] = begin
    fade = np.exp(-np.diff(t) / tau)
    for i, f in enumerate(fade, 1):
        state[i] += f * (state[i - 1] - level[i])
    return state


def last_side(v: Array, band: float, begin: float) -> Array:
    """The sign of v, or within +-band the side on which it was last."""
    sides = np.where(np.abs(v) > band, np.sign(v), 0.0)
    for i in np.flatnonzero(sides == 0):
        sides[i] = sides[i - 1] if i else begin
    return sides


def walk(g: Random, t: Array, tau: float) -> Array:
    """A stationary walk of unit variance with an exponential memory."""
    out, keep = g.standard_normal(len(t)), np.exp(-np.diff(t) / tau)
    for i, k in enumerate(keep, 1):
        out[i] = k * out[i - 1] + math.sqrt(1 - k * k) * out[i]
    return out


def mixed(share: float, rest: Array, part: Array) -> Array:
    """Both, with this share of the variance for the part."""
    return math.sqrt(1 - share) * rest + math.sqrt(share) * part


def errors(noise: str, g: Random, t: Array, signal: Array) -> Array:
    """One for each row, of unit standard deviation."""
    n = len(t)
    e = g.standard_normal(n)
    match noise:
        case "heavy":
            free = g.uniform(3.5, 5)
            return np.clip(g.standard_t(free, n) * math.sqrt(1 - 2 / free), -10, 10)
        case "wander":
            return mixed(g.uniform(0.2, 0.5), e, walk(g, t, g.uniform(2, 8) * float(np.median(np.diff(t)))))
        case "restless":
            stretch = np.repeat(np.arange(n), g.integers(10, 30, n))[:n]
            sd = np.where(g.random(n) < 0.3, g.uniform(2, 3), 1.0)[stretch]
            return e * sd / rms(sd)
        case "grows":
            sd = g.uniform(0.25, 0.6) + np.abs(signal) / np.abs(signal).max()
            return e * sd / rms(sd)
        case "glitches":
            far = g.permutation(n) < max(1, round(g.uniform(0.01, 0.02) * n))
            e = np.where(far, g.choice([-1, 1], n) * g.uniform(5, 9, n), e)
            return e / math.sqrt(1 + 49 * far.mean())
    return e


def build(kind: str, lab: Lab, causes: Causes, effects: tuple[str, ...], seed: int, size: float, noise: str) -> Table:
    """The table of a laboratory. The first output has the asked size of each cause; in the others a cause of the bench
    is as large as there, any other half to one and a half times as large against their own error.
    """
    if noise not in NOISES:
        raise ValueError(f"no such noise: {noise}")
    first = lab.outputs[0]
    columns, scale, left = dict(lab.columns), {}, {}
    hidden, display = np.zeros(len(lab.t)), 0.0
    for j, out in enumerate(lab.outputs):
        added = np.zeros(len(lab.t))
        for name in effects:
            cause = causes[name]
            own = chance(kind, seed, f"{name}, own", j)
            raw = cause.act(lab.world, out, chance(kind, seed, name), own)
            if j == 0:
                rest = rms(residual(raw, lab.model, lab.groups))
                left[name] = rest / float(np.std(raw))
                scale[name] = size * first.sd / rest
            signs = chance(kind, seed, f"{name}, sign", 0 if cause.bench else j)
            factor = float(signs.choice([-1, 1])) if cause.both else 1.0
            if j and not cause.bench:
                factor *= own.uniform(0.5, 1.5) * out.sd / first.sd
            added += factor * scale[name] * raw
        g = chance(kind, seed, f"error {noise}", j)
        e = errors(noise, g, lab.t, out.declared)
        if lab.block is not None:
            e = mixed(lab.share, e, g.standard_normal(len(lab.t))[lab.block])
        y = out.declared + out.shift + out.sd * e + added
        digits = max(0, math.ceil(3 - math.log10(out.sd)))
        if noise == "rounded":
            step = round(g.uniform(0.6, 1.1) * out.sd, digits)
            y = step * np.rint(y / step)
            display = display or step
        columns[out.name] = [f"{v:.{digits}f}" for v in y]
        if j == 0:
            hidden = added
    csv = "\n".join([",".join(columns), *map(",".join, zip(*columns.values(), strict=True))]) + "\n"
    achieved = rms(residual(hidden, lab.model, lab.groups)) / first.sd
    return Table(csv, list(lab.options), achieved, hidden, lab, display, left)
