"""Shared pieces: seeded streams, noises, what a declared model leaves over, text of a table."""
import zlib
from dataclasses import dataclass, field

import numpy as np


def stream(seed, *tags):
    """A generator of its own for every seed and purpose."""
    words = [int(seed) & 0xFFFFFFFF, (int(seed) >> 32) & 0xFFFFFFFF]
    words += [zlib.crc32(str(tag).encode()) for tag in tags]
    return np.random.default_rng(words)


@dataclass
class Table:
    csv: str
    options: list
    size: float          # achieved; in a pair the mean of the two (each in .sizes)
    hidden: np.ndarray   # (rows,) added to the first response
    sizes: dict = field(default_factory=dict)
    sigma: float = 0.0   # standard deviation of the error of a row, first response
    sigma_reading: float = 0.0   # whole plots: that of a reading alone
    facts: dict = field(default_factory=dict)   # of the laboratory, for people


def left_over(h, model, groups=None):
    """What least squares with the columns `model` leaves of h (in each group if groups are given)."""
    h = np.asarray(h, float)
    out = np.empty_like(h)
    parts = [np.ones(h.size, bool)] if groups is None else [groups == g for g in np.unique(groups)]
    for part in parts:
        a = model[part]
        scale = np.sqrt((a * a).sum(0))
        a = a / np.where(scale > 0, scale, 1.0)
        u, s, _ = np.linalg.svd(a, full_matrices=False)
        u = u[:, s > 1e-9 * s[0]]
        out[part] = h[part] - u @ (u.T @ h[part])
    return out


def rms(v):
    return float(np.sqrt(np.mean(np.square(v))))


def csv_text(columns):
    """columns: (name, values, format) in order; a format None writes the words as they are."""
    texts = [[str(v) if f is None else format(v, f) for v in values] for _, values, f in columns]
    lines = [",".join(name for name, _, _ in columns)]
    lines += [",".join(row) for row in zip(*texts)]
    return "\n".join(lines) + "\n"


def digits(sigma):
    """Decimals enough that writing costs about a hundredth of sigma at most."""
    return int(max(0, min(9, np.ceil(-np.log10(sigma)) + 2)))


def pick(r, *values):
    return values[int(r.integers(len(values)))]


def between(r, low, high):
    return float(r.uniform(low, high))


def wander(r, n, rows):
    """A smooth wandering line of rms 1: a first-order process of `rows` rows memory."""
    rho = np.exp(-1.0 / rows)
    e = r.standard_normal(n)
    v = np.empty(n)
    v[0] = e[0]
    for i in range(1, n):
        v[i] = rho * v[i - 1] + np.sqrt(1 - rho * rho) * e[i]
    return v


# Noises: unit variance (mean square over the rows where it is not the same for all of them)
def white(r, n):
    return r.standard_normal(n)


def student(r, n):
    return r.standard_t(4, n) / np.sqrt(2.0)


def uniform(r, n):
    return r.uniform(-1, 1, n) * np.sqrt(3.0)


def skewed(r, n):
    shape = 3.0
    return pick(r, -1, 1) * (r.gamma(shape, 1.0, n) - shape) / np.sqrt(shape)


def outliers(r, n):
    wild = r.random(n) < 0.03
    return r.standard_normal(n) * np.where(wild, 5.0, 1.0) / np.sqrt(0.97 + 0.03 * 25.0)


def ar1(r, n):
    rho = between(r, 0.3, 0.6)
    return wander(r, n, -1.0 / np.log(rho))


def flicker(r, n):
    slow = sum(wander(r, n, rows) for rows in (2, 8, 32, 128)) / 2.0
    return np.sqrt(0.6) * r.standard_normal(n) + np.sqrt(0.4) * slow


def bursts(r, n):
    w = np.empty(n)
    i, loud = 0, r.random() < 0.5
    while i < n:
        k = int(r.integers(8, 40))
        w[i:i + k] = 2.2 if loud else 0.8
        loud, i = not loud, i + k
    return weighted(r, w)


def weighted(r, w):
    """Normal, with standard deviations in proportion to w."""
    return r.standard_normal(w.size) * w / rms(w)
