"""What the kinds share: how causes are entered, relaxation and play, noises, and how a table is made."""

import math
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any, TypeAlias

import numpy as np

Array: TypeAlias = Any  # of numpy
World = SimpleNamespace
Random = np.random.Generator
Act = Callable[[Any, Random, int], Array]

NOISES = {
    "white": "normal, rows independent",
    "heavy": "Student's t with 4 degrees of freedom, cut at 8 standard deviations",
    "wander": "normal; 30 to 60 % of the variance is flicker-like, with memories of about 3, 10 and 30 rows",
    "shifts": "normal; standard deviation of one person's rows is 1.5 to 2.5 times the other's, in turns of 20 to 60 rows",
    "grows": "normal, standard deviation grows with the size of the signal",
    "glitches": "normal; one row of about 80 is 5 to 9 standard deviations off",
    "rounded": "normal; a display of 0.7 to 1.2 standard deviations a digit",
}


@dataclass
class Output:
    """A response: its name, what the declared model says, standard deviation of a row's error."""

    name: str
    declared: Array
    sd: float


@dataclass
class Lab:
    """A laboratory with nothing hidden. `extra`: (outputs, rows) errors of blocks or replications, in its unit."""

    columns: dict[str, list[str]]
    outputs: list[Output]
    model: Array
    groups: Array
    world: World
    extra: Array
    options: list[str] = field(default_factory=list)


@dataclass
class Table:
    """What the contract asks for, and the laboratory."""

    csv: str
    options: list[str]
    size: float
    hidden: Array
    lab: Lab


@dataclass(frozen=True)
class Cause:
    """A cause as a function of world, random numbers and number of the output, in any unit: `build` gives its size.

    Attributes:
        act: the function.
        bench: of the bench or its surroundings: the same constants and scale in all outputs; else each has its own.
        both: nature allows either sign.
        fields: laboratories in which it can happen (tables of any kind); all if empty.
    """

    act: Act
    bench: bool
    both: bool
    fields: tuple[str, ...]

    def __call__(self, world: Any, g: Random, j: int) -> Array:
        """What it adds to output j, before it is given a size."""
        return self.act(world, g, j)


class Causes(dict[str, Cause]):
    """Causes by name; a docstring says what happens, where, and who described it."""

    def enter(self, *fields: str, bench: bool = False, both: bool = True) -> Callable[[Act], Act]:
        """A decorator that enters a function by its name."""

        def entered(act: Any) -> Any:
            self[act.__name__] = Cause(act, bench, both, fields)
            return act

        return entered

    def about(self) -> dict[str, str]:
        """The docstrings by name, in one line."""
        return {name: " ".join((cause.act.__doc__ or "").split()) for name, cause in self.items()}


def chance(kind: str, seed: int, what: str, j: int = 0) -> Random:
    """Random numbers of their own for each thing."""
    return np.random.default_rng([19, 1202612, seed, j, zlib.crc32(f"{kind}/{what}".encode())])


def rms(v: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.asarray(v) ** 2)))


def beside(v: Array, model: Array, groups: Array) -> Array:
    """What least squares by the declared model leaves, in each group."""
    rest = np.array(v, float)
    for group in np.unique(groups):
        rows = groups == group
        part = model[rows] / np.linalg.norm(model[rows], axis=0)
        u, s, _ = np.linalg.svd(part, full_matrices=False)
        u = u[:, s > 1e-10 * s[0]]
        for _ in range(2):
            rest[rows] -= u @ (u.T @ rest[rows])
    return rest


def lagged(v: Array, t: Array, tau: Any, start: float | None = None) -> Array:
    """First-order lag behind v, which takes its value soon after the row before; settled at the first row."""
    keep = np.exp(-np.diff(t, prepend=t[0]) / tau)
    out = np.empty(len(v))
    state = v[0] if start is None else start
    for i, now in enumerate(v):
        state = out[i] = now + (state - now) * keep[i]
    return out


def play(v: Array, half: float, start: float | None = None) -> Array:
    """The play operator: what follows v on a loose link of this half width."""
    out = np.empty(len(v))
    state = v[0] if start is None else start
    for i, now in enumerate(v):
        state = out[i] = min(max(state, now - half), now + half)
    return out


def previous(v: Array, first: float) -> Array:
    """The row before."""
    return np.concatenate([[first], v[:-1]])


def brown(g: Random, t: Array, tau: float) -> Array:
    """A stationary wander of unit variance with a memory of tau."""
    keep = np.exp(-np.diff(t, prepend=t[0]) / tau)
    kicks = g.standard_normal(len(t))
    out = np.empty(len(t))
    state = kicks[0]
    for i in range(len(t)):
        state = out[i] = keep[i] * state + math.sqrt(1 - keep[i] ** 2) * kicks[i]
    return out


def errors(noise: str, g: Random, t: Array, signal: Array) -> Array:
    """Errors of rows, of unit variance but for glitches."""
    n = len(t)
    e = g.standard_normal(n)
    if noise == "heavy":
        return np.clip(g.standard_t(4, n) / math.sqrt(2), -8, 8)
    if noise == "wander":
        part, usual = g.uniform(0.3, 0.6), float(np.median(np.diff(t)))
        slow = sum(brown(g, t, rows * usual) for rows in (3, 10, 30)) / math.sqrt(3)
        return math.sqrt(1 - part) * e + math.sqrt(part) * slow
    if noise == "shifts":
        turn = (np.arange(n) // int(g.integers(20, 61))) % 2
        weight = np.where(turn == 1, g.uniform(1.5, 2.5), 1.0)
        return e * weight / rms(weight)
    if noise == "grows":
        weight = 0.4 + np.abs(signal) / np.abs(signal).max()
        return e * weight / rms(weight)
    if noise == "glitches":
        off = g.random(n) < 1 / 80
        return e + off * g.uniform(5, 9, n) * g.choice([-1, 1], n)
    return e


def build(kind: str, lab: Lab, causes: Causes, names: tuple[str, ...], seed: int, size: float, noise: str) -> Table:
    """A table. In the first output each cause has the asked size; in others one of the bench has the same scale, any
    other 0.6 to 1.4 of the size against their own error.
    """
    if noise not in NOISES:
        raise ValueError(f"no noise {noise}")
    t, columns = lab.world.t, dict(lab.columns)
    hidden = np.zeros(len(t))
    for j, out in enumerate(lab.outputs):
        added = np.zeros(len(t))
        for name in names:
            cause = causes[name]
            k = 0 if cause.bench else j
            g = chance(kind, seed, f"sign and size of {name}", k)
            sign = float(g.choice([-1, 1])) if cause.both else 1.0
            lead = 0 if cause.bench else j
            shape = cause(lab.world, chance(kind, seed, name, lead), lead)
            left = rms(beside(shape, lab.model, lab.groups))
            asked = size * lab.outputs[lead].sd * (g.uniform(0.6, 1.4) if k else 1.0)
            if cause.bench and j:
                shape = cause(lab.world, chance(kind, seed, name, lead), j)
            added += sign * asked / left * shape
        g = chance(kind, seed, f"noise {noise}", j)
        y = out.declared + lab.extra[j] + out.sd * errors(noise, g, t, out.declared) + added
        digits = max(0, math.ceil(2.5 - math.log10(out.sd)))
        if noise == "rounded":
            step = round(g.uniform(0.7, 1.2) * out.sd, digits)
            y = step * np.rint(y / step)
        columns[out.name] = [f"{v:.{digits}f}" for v in y]
        if j == 0:
            hidden = added
    csv = "\n".join([",".join(columns), *map(",".join, zip(*columns.values(), strict=True))]) + "\n"
    return Table(csv, lab.options, rms(beside(hidden, lab.model, lab.groups)) / lab.outputs[0].sd, hidden, lab)


def texts(v: Array, digits: int) -> list[str]:
    """Numbers of a column."""
    return [f"{one:.{digits}f}" for one in v]
