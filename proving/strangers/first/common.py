"""What the three kinds share: the answer, noises, least squares, sizes."""
import zlib
from dataclasses import dataclass
import numpy as np


@dataclass
class Made:
    csv: str
    columns: dict
    options: list
    size: float
    hidden: np.ndarray


def stream(*keys):
    return np.random.default_rng([zlib.crc32(repr(k).encode()) for k in keys])


def residual(X, y):
    return y - X @ np.linalg.lstsq(X, y, rcond=None)[0]


def rms(v):
    return float(np.sqrt(np.mean(np.square(v))))


def ar(rng, n, phi):
    e = rng.standard_normal(n)
    for i in range(1, n):
        e[i] = phi * e[i - 1] + np.sqrt(1 - phi * phi) * e[i]
    return e


def pink(rng, n):
    f = np.fft.rfftfreq(2 * n)
    f[0] = f[1]
    z = (rng.standard_normal(len(f)) + 1j * rng.standard_normal(len(f))) / np.sqrt(f)
    v = np.fft.irfft(z, 2 * n)[:n]
    return (v - v.mean()) / v.std()


def outliers(rng, n):
    hit = (rng.random(n) < 0.01) * rng.choice([-1, 1], n) * rng.uniform(5, 15, n)
    return rng.standard_normal(n) + hit


def growing(rng, n, setting):
    s = 0.4 + 1.2 * setting
    return rng.standard_normal(n) * s / rms(s)


def by_block(rng, n, block):
    sds = np.exp(0.5 * rng.standard_normal(block.max() + 1))[block]
    return rng.standard_normal(n) * sds / rms(sds)


def neighbours(rng, n, block):
    """Half of the variance in common to a block, AR 0.5 from block to block."""
    return (ar(rng, block.max() + 1, 0.5)[block] + rng.standard_normal(n)) / np.sqrt(2)


# every noise: (rng, n, setting in 0..1, block number, point number) -> errors of unit sd
NOISES = {
    "white": lambda r, n, s, b, p: r.standard_normal(n),
    "heavy": lambda r, n, s, b, p: r.standard_t(3, n) / np.sqrt(3),
    "outliers": lambda r, n, s, b, p: outliers(r, n),
    "ar3": lambda r, n, s, b, p: ar(r, n, 0.3),
    "ar6": lambda r, n, s, b, p: ar(r, n, 0.6),
    "pink": lambda r, n, s, b, p: pink(r, n),
    "growing": lambda r, n, s, b, p: growing(r, n, s),
    "blocks": lambda r, n, s, b, p: by_block(r, n, b),
    "common": lambda r, n, s, b, p: neighbours(r, n, b),
}


def scaled(f, left, sd_of, size):
    """Find k > 0 so that the residual of f(k)[:, 0] has rms size * sd. None if hardly visible."""
    k = 1.0
    for _ in range(80):
        h = f(k)
        r = left(h[:, 0])
        got = rms(r) / sd_of(r)
        if not np.isfinite(got) or got <= 0 or rms(r) < 0.1 * rms(h[:, 0]):
            return None
        if abs(got / size - 1) < 0.002:
            return h, got
        k *= min(max(size / got, 1e-6), 1e6)
    return None


def csv_text(columns, formats):
    names = list(columns)
    rows = [",".join(names)]
    for i in range(len(columns[names[0]])):
        rows.append(",".join(str(columns[c][i]) if formats[c] is None else format(columns[c][i], formats[c])
                             for c in names))
    return "\n".join(rows) + "\n"


def since(x, start):
    """Value of the row before; for the first row the given start."""
    return np.concatenate([[start], x[:-1]])


def lag(x, t, tau):
    """First-order lag of x over time t."""
    y = np.array(x, float)
    for i in range(1, len(y)):
        w = np.exp(-(t[i] - t[i - 1]) / tau)
        y[i] = x[i] + (y[i - 1] - x[i]) * w
    return y


def telegraph(rng, t, mean):
    """0/1 state that changes after exponential times of the given mean."""
    changes = np.cumsum(rng.exponential(mean, int(6 * (t[-1] - t[0]) / mean) + 20)) + t[0]
    return ((np.searchsorted(changes, t) + rng.integers(2)) % 2).astype(float)
