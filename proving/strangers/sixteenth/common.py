"""What the three kinds share: causes and their register, memories, noises, and how a table is put together."""

import math
from dataclasses import dataclass, field

import numpy as np

NOISES = {
    "white": "normal and independent",
    "heavy": "heavy tails: Student's t, 3.5 to 5 degrees of freedom, cut off at 10",
    "wander": "up to half of the variance wanders slowly, with a memory in real time of some rows",
    "sittings": "5 to 15 rows of one sitting have a part of their error in common",
    "grows": "normal, with a standard deviation that grows with the signal",
    "glitches": "normal, but one or two rows in a hundred are far off",
    "rounded": "normal, and the display has steps of about one standard deviation",
}


@dataclass
class Output:
    name: str
    declared: np.ndarray
    sd: float
    shift: np.ndarray | float = 0.0


@dataclass
class Lab:
    """A laboratory before anything hidden happens. world: all that the causes need to know."""

    columns: list
    outputs: list
    model: np.ndarray
    groups: np.ndarray
    t: np.ndarray
    world: object
    options: list = field(default_factory=list)
    block: np.ndarray | None = None
    share: float = 0.0


@dataclass
class Result:
    lab: Lab
    csv: str = ""
    options: list = field(default_factory=list)
    size: float = 0.0
    hidden: np.ndarray | None = None
    error_sd: float = 0.0
    display: float = 0.0
    kept: dict = field(default_factory=dict)


class World:
    def __init__(self, **known):
        vars(self).update(known)


class Register(dict):
    """Names of causes and their functions. bench: one size for all outputs, because its place is the bench or a common
    instrument. both: physics allows either sign."""

    def __init__(self):
        super().__init__()
        self.bench, self.both, self.about = set(), set(), {}

    def __call__(self, about, bench=False, both=False):
        def take(f):
            self[f.__name__] = f
            self.about[f.__name__] = about
            if bench:
                self.bench.add(f.__name__)
            if both:
                self.both.add(f.__name__)
            return f

        return take


def chance(*key):
    return np.random.default_rng(np.random.SeedSequence([20261129, 16, *key]))


def size_of(v):
    return math.sqrt(float(np.dot(v, v)) / len(v))


def residual(v, model, groups):
    """v without what least squares can take up, group by group."""
    rest = np.array(v, float)
    for label in set(groups.tolist()):
        rows = np.flatnonzero(groups == label)
        m = model[rows] / np.linalg.norm(model[rows], axis=0).clip(1e-300)
        for _ in range(2):
            rest[rows] -= m @ np.linalg.lstsq(m, rest[rows], rcond=1e-11)[0]
    return rest


def held(level, t, tau, begin=None):
    """A first-order memory of a level that is set at once after the row before, and then held."""
    state = [level[0] if begin is None else begin]
    fade = np.exp(-np.diff(t) / tau)
    for new, f in zip(level[1:], fade, strict=True):
        state.append(new + f * (state[-1] - new))
    return np.array(state)


def ramped(level, t, tau):
    """A first-order memory of a level that goes in straight lines from row to row."""
    state = [level[0]]
    for i in range(1, len(t)):
        gap = t[i] - t[i - 1]
        lag = tau * (level[i] - level[i - 1]) / gap
        state.append(level[i] - lag + (state[-1] - level[i - 1] + lag) * math.exp(-gap / tau))
    return np.array(state)


def walk(g, t, tau):
    """Unit variance with an exponential memory (Ornstein and Uhlenbeck)."""
    keep = np.exp(-np.diff(t) / tau)
    out = [g.standard_normal()]
    for k, z in zip(keep, g.standard_normal(len(keep)), strict=True):
        out.append(k * out[-1] + math.sqrt(1 - k * k) * z)
    return np.array(out)


def softened(v, width):
    """max(v, 0) with a rounded corner."""
    return width * np.logaddexp(0.0, v / width)


def mixed(share, a, b):
    """share: of the variance, for b."""
    return math.sqrt(1 - share) * a + math.sqrt(share) * b


def errors(noise, g, t, signal):
    """Of unit standard deviation, one for each row."""
    n = len(t)
    plain = g.standard_normal(n)
    if noise == "heavy":
        free = g.uniform(3.5, 5.0)
        tails = g.standard_t(free, n) * math.sqrt(1 - 2 / free)
        plain = np.minimum(np.maximum(tails, -10), 10)
    elif noise == "wander":
        memory = g.uniform(2.0, 8.0) * np.median(np.diff(t))
        plain = mixed(g.uniform(0.2, 0.5), plain, walk(g, t, memory))
    elif noise == "sittings":
        ends = np.cumsum(g.integers(5, 16, n))
        sitting = np.searchsorted(ends, np.arange(n), side="right")
        plain = mixed(g.uniform(0.15, 0.35), plain, g.standard_normal(n)[sitting])
    elif noise == "grows":
        grown = g.uniform(0.3, 0.6) + g.uniform(0.8, 1.4) * np.abs(signal) / np.abs(signal).max()
        plain = plain * grown / size_of(grown)
    elif noise == "glitches":
        many = max(1, round(g.uniform(0.01, 0.02) * n))
        rows = g.permutation(n)[:many]
        plain[rows] = np.where(g.random(many) < 0.5, -1, 1) * g.uniform(5.0, 9.0, many)
        plain = plain / math.sqrt(1 + many / n * 49)
    return plain


def places(sd):
    """How many decimals an output needs to be written to a thousandth of sd."""
    return max(0, math.ceil(3 - math.log10(sd) - 1e-9))


def make(number, lab, causes, effects, seed, size, noise):
    if noise not in NOISES:
        raise ValueError("no such noise: %s" % noise)
    effects = (effects,) if isinstance(effects, str) else tuple(effects)
    index = {name: k for k, name in enumerate(causes)}
    noise_index = list(NOISES).index(noise)
    first_sd = lab.outputs[0].sd
    res = Result(lab, options=list(lab.options), error_sd=first_sd)
    scale, columns = {}, list(lab.columns)
    for j, out in enumerate(lab.outputs):
        total = np.zeros(len(lab.t))
        for name in effects:
            who = 0 if name in causes.bench else j
            raw = np.asarray(causes[name](lab.world, chance(number, seed, 20 + index[name], who), j), float)
            own = chance(number, seed, 60 + index[name], who)
            factor = own.choice([1.0, -1.0]) if name in causes.both else 1.0
            if j == 0:
                rest = size_of(residual(raw, lab.model, lab.groups))
                res.kept[name] = rest / np.std(raw)
                scale[name] = size * first_sd / rest
            elif name not in causes.bench:
                factor *= own.uniform(0.5, 1.5) * out.sd / first_sd
            total += scale[name] * factor * raw
        g = chance(number, seed, 90, j, noise_index)
        e = errors(noise, g, lab.t, out.declared)
        if lab.share:
            e = mixed(lab.share**2, e, g.standard_normal(len(lab.t))[lab.block])
        y = out.declared + out.shift + out.sd * e + total
        d = places(out.sd)
        if noise == "rounded":
            display = max(1, round(g.uniform(0.6, 1.1) * out.sd * 10**d)) / 10**d
            y = display * np.rint(y / display)
            res.display = res.display or display
        columns.append((out.name, ["%.*f" % (d, v) for v in y]))
        if j == 0:
            res.hidden = total
            if effects:
                res.size = size_of(residual(total, lab.model, lab.groups)) / first_sd
    lines = [",".join(name for name, _ in columns)]
    lines += map(",".join, zip(*(text for _, text in columns), strict=True))
    res.csv = "\n".join(lines) + "\n"
    return res
