"""What the three kinds share: random streams, noises, scaling of what is hidden, text of a table."""
import math
import zlib
from dataclasses import dataclass, field

import numpy as np


def stream(*keys):
    """A generator of its own for every list of keys."""
    return np.random.default_rng([zlib.crc32(str(k).encode()) for k in keys])


def record(values, decimals):
    """Values as they stand in the table."""
    return np.array([float("%.*f" % (decimals, v)) for v in values])


@dataclass
class Lab:
    kind: str
    columns: dict                # name -> (array of numbers, decimals) or list of words, in order
    clean: dict                  # response -> reading without error
    sd: dict                     # response -> standard deviation of the error of a row
    model: np.ndarray            # declared model
    groups: np.ndarray           # rows that are fitted together
    batches: np.ndarray          # rows that share an error
    shared: float = 0.0          # share of the error's variance that a batch has in common
    options: list = field(default_factory=list)
    more: dict = field(default_factory=dict)

    @property
    def n(self):
        return len(self.groups)


@dataclass
class Table:
    kind: str
    effects: tuple
    seed: int
    noise: str
    csv: str
    options: list
    hidden: np.ndarray
    size: float
    sizes: dict
    kept: dict
    error_sd: float
    step: float | None


def rms(v):
    return float(np.sqrt(np.mean(np.square(v))))


def left(model, groups, v):
    """What least squares with the declared model leaves of v, group by group."""
    out = np.empty(len(v))
    for k in np.unique(groups):
        at = groups == k
        q, s, _ = np.linalg.svd(model[at] / np.sqrt(np.mean(model[at] ** 2, axis=0) + 1e-300), full_matrices=False)
        q = q[:, s > 1e-10 * s[0]]
        w = v[at] - q @ (q.T @ v[at])
        out[at] = w - q @ (q.T @ w)
    return out


# ---- noises: unit variance, rows of one batch in their order

def _ar(rng, n, rho):
    e = rng.standard_normal(n)
    for i in range(1, n):
        e[i] = rho * e[i - 1] + math.sqrt(1 - rho * rho) * e[i]
    return e


def white(rng, lab, signal):
    return rng.standard_normal(lab.n)


def student(rng, lab, signal):
    """Heavy tails: Student's t with 4 degrees of freedom."""
    return rng.standard_t(4, lab.n) / math.sqrt(2)


def ar_rows(rng, lab, signal):
    """Rows of one batch follow an AR(1) of 0.6."""
    out = np.empty(lab.n)
    for k in np.unique(lab.batches):
        at = lab.batches == k
        out[at] = _ar(rng, int(at.sum()), 0.6)
    return out


def loud_with_signal(rng, lab, signal):
    """Heteroscedastic: the error grows with the size of the reading."""
    a = np.abs(signal)
    s = 0.35 + a / max(float(a.max()), 1e-300)
    return rng.standard_normal(lab.n) * s / rms(s)


def spikes(rng, lab, signal):
    """Outliers: 3 % of the rows have six times the error, mostly to one side."""
    e = rng.standard_normal(lab.n)
    at = rng.random(lab.n) < 0.03
    sign = np.where(rng.random(lab.n) < 0.75, 1.0, -1.0)
    e = np.where(at, sign * 6.0 * np.abs(e), e)
    return e / math.sqrt(0.97 + 0.03 * 36)


def louder_half(rng, lab, signal):
    """From some row on the error is two and a half times as great."""
    start = int(lab.n * rng.uniform(0.4, 0.7))
    s = np.where(np.arange(lab.n) < start, 1.0, 2.5)
    return rng.standard_normal(lab.n) * s / rms(s)


def lopsided(rng, lab, signal):
    """Skew: a gamma law of shape 2 about its mean."""
    return (rng.gamma(2.0, 1.0, lab.n) - 2.0) / math.sqrt(2.0)


NOISES = {"white": white, "student": student, "ar_rows": ar_rows, "loud_with_signal": loud_with_signal, "spikes": spikes,
          "louder_half": louder_half, "lopsided": lopsided, "rounded": white, "ar_batches": white}


def errors(lab, response, noise, seed):
    """Error of every row (variance one)."""
    rng = stream(lab.kind, seed, "error", noise, response)
    own = NOISES[noise](rng, lab, lab.clean[response])
    names, at = np.unique(lab.batches, return_inverse=True)
    if noise == "ar_batches":
        share = max(lab.shared, 0.3)
        common = _ar(rng, len(names), 0.5)
    else:
        share = lab.shared
        common = rng.standard_normal(len(names))
    return math.sqrt(1 - share) * own + math.sqrt(share) * common[at]


def resolution(sd):
    """The coarsest of 1, 2, 5 times a power of ten that is no more than 1.5 sd; decimals to write it."""
    k = math.floor(math.log10(1.5 * sd))
    m = max(v for v in (1, 2, 5) if v * 10.0 ** k <= 1.5 * sd)
    return m * 10.0 ** k, max(0, -k)


def build(kind, module, effects, seed, size, noise):
    effects = tuple(effects)
    if noise not in module.NOISES:
        raise ValueError("no such noise: %s" % noise)
    lab = module.laboratory(int(seed))
    first = next(iter(lab.clean))
    hidden = {r: np.zeros(lab.n) for r in lab.clean}
    sizes, kept = {}, {}
    for name in effects:
        h = module.EFFECTS[name](lab, stream(kind, int(seed), "effect", name))
        rest = rms(left(lab.model, lab.groups, h[first]))
        scale = size * lab.sd[first] / rest
        kept[name] = rest / max(float(np.std(h[first])), 1e-300)
        sizes[name] = scale * rest / lab.sd[first]
        for r in hidden:
            if r in h:
                hidden[r] = hidden[r] + scale * h[r]
    columns = []
    for name, c in lab.columns.items():
        columns.append((name, list(c) if isinstance(c, list) else ["%.*f" % (c[1], v) for v in c[0]]))
    step = None
    for r in lab.clean:
        sd = lab.sd[r]
        e = errors(lab, r, noise, seed)
        if noise == "rounded":
            s, d = resolution(sd)
            y = lab.clean[r] + hidden[r] + e * math.sqrt(sd * sd - s * s / 12)
            y = np.round(y / s) * s
            step = s if r == first else step
        else:
            y, d = lab.clean[r] + hidden[r] + e * sd, max(0, math.ceil(-math.log10(1e-3 * sd)))
        columns.append((r, ["%.*f" % (d, v) for v in y]))
    lines = [",".join(c for c, _ in columns)] + [",".join(row) for row in zip(*(v for _, v in columns))]
    return Table(kind, effects, int(seed), noise, "\n".join(lines) + "\n", list(lab.options), hidden[first],
                 float(np.mean(list(sizes.values()))) if sizes else 0.0, sizes, kept, lab.sd[first], step)
