"""What the three kinds share: random streams, noises, scaling, the table."""
import zlib

import numpy as np


class Table:
    """csv, options, size, hidden as in the contract; besides: sigma, parts (name -> what it adds to the first response), sizes."""

    def __init__(self, csv, options, size, hidden, sigma, parts, sizes):
        self.csv, self.options, self.size, self.hidden = csv, options, size, hidden
        self.sigma, self.parts, self.sizes = sigma, parts, sizes


def stream(*words):
    key = [int(w) if isinstance(w, (int, np.integer)) else zlib.crc32(str(w).encode()) for w in words]
    return np.random.default_rng(key)


def left_over(design, h):
    return h - design @ np.linalg.lstsq(design, h, rcond=None)[0]


def rms(v):
    return float(np.sqrt(np.mean(np.square(v))))


def dummies(levels):
    levels = np.asarray(levels)
    return (levels[:, None] == np.unique(levels)[None, :]).astype(float)


def previous(v, first):
    return np.concatenate([[first], v[:-1]])


def low_pass(u, t, tau, start, restart=None):
    """First-order lag of u; u[i] was there from the time of row i-1 to that of row i. restart: rows at which the state is `start` again."""
    out, y = np.empty(len(u)), start
    for i in range(len(u)):
        if restart is not None and restart[i]:
            y = start
        dt = t[i] - t[i - 1] if i and not (restart is not None and restart[i]) else 60.0
        y = u[i] + (y - u[i]) * np.exp(-dt / tau)
        out[i] = y
    return out


def schmitt(v, low, high, state=0):
    out = np.empty(len(v))
    for i, a in enumerate(v):
        if a > high:
            state = 1
        elif a < low:
            state = 0
        out[i] = state
    return out


def scaled(effects, names, lab, kind, seed, design, sigma, size, gains):
    """name -> (rows, sensors) in the units of the responses, each so that the first column has the size."""
    norm = np.linalg.qr(design / np.maximum(np.abs(design).max(0), 1e-300))[0]
    parts, sizes = {}, {}
    for name in names:
        for attempt in range(40):
            raw = np.asarray(effects[name](lab, stream(kind, seed, name, attempt)), float)
            raw = raw.reshape(len(raw), -1)
            raw = raw * gains[None, :raw.shape[1]]
            first = raw[:, 0]
            rest = rms(left_over(norm, first))
            if rest > 0.06 * rms(first) and np.isfinite(raw).all():
                break
        else:
            raise ValueError(f"{name} cannot be had in laboratory {seed}")
        factor = size * sigma / rest
        full = np.zeros((len(raw), len(gains)))
        full[:, :raw.shape[1]] = raw * factor
        parts[name] = full
        sizes[name] = rms(left_over(norm, full[:, 0])) / sigma
    return parts, sizes


# ---- noises: (rng, level 0..1 of the signal, session of each row, order) -> errors of standard deviation 1 in expectation ----

def white(rng, level, session):
    return rng.standard_normal(len(level))


def heavy(rng, level, session):
    return rng.standard_t(4, len(level)) / np.sqrt(2.0)


def with_level(rng, level, session):
    sd = 0.4 + 1.6 * level
    return rng.standard_normal(len(level)) * sd / rms(sd)


def quantised(rng, level, session):
    return rng.standard_normal(len(level)) * np.sqrt(1.0 - QUANTUM ** 2 / 12.0)


QUANTUM = 2.0  # steps of the voltmeter, in standard deviations of the total error


def ar1(rng, level, session, rho=0.5):
    e = rng.standard_normal(len(level))
    out = np.empty(len(e))
    out[0] = e[0]
    for i in range(1, len(e)):
        out[i] = rho * out[i - 1] + np.sqrt(1 - rho ** 2) * e[i]
    return out


def sessions(rng, level, session):
    names, where = np.unique(session, return_inverse=True)
    sd = np.exp(0.5 * rng.standard_normal(len(names)))[where]
    return rng.standard_normal(len(level)) * sd / rms(sd)


def outliers(rng, level, session):
    e = rng.standard_normal(len(level)) * np.where(rng.random(len(level)) < 0.01, 7.0, 1.0)
    return e / np.sqrt(0.99 + 0.01 * 49.0)


def skewed(rng, level, session):
    return (rng.gamma(3.0, 1.0, len(level)) - 3.0) / np.sqrt(3.0)


def bursts(rng, level, session):
    n = len(level)
    sd = np.ones(n)
    for _ in range(max(2, n // 90)):
        a = int(rng.integers(0, n))
        sd[a:a + int(rng.integers(4, 13))] = 3.0
    return rng.standard_normal(n) * sd / rms(sd)


def hum(rng, level, session):
    """Mains hum caught by readings that are not in step with it: its phase walks from reading to reading."""
    n = len(level)
    phase = rng.uniform(0, 2 * np.pi) + np.cumsum(1.9 + 1.6 * rng.standard_normal(n))
    return np.sqrt(0.5) * rng.standard_normal(n) + np.sin(phase)


def flicker(rng, level, session):
    n = len(level)
    m = 4 * n
    f = np.fft.rfftfreq(m)
    s = np.zeros(len(f))
    s[1:] = f[1:] ** -0.5
    e = np.fft.irfft(s * np.exp(2j * np.pi * rng.random(len(f))) * rng.rayleigh(1.0, len(f)), m)
    e = e / rms(e)
    a = int(rng.integers(0, m - n))
    return np.sqrt(0.65) * rng.standard_normal(n) + np.sqrt(0.35) * e[a:a + n]


def walk(rng, level, session):
    """White, and a small random walk whose standard deviation at the end of the run is 0.7 of it."""
    n = len(level)
    w = np.cumsum(rng.standard_normal(n)) * 0.7 / np.sqrt(n)
    w = w - w.mean()
    return (rng.standard_normal(n) + w) / np.sqrt(1.0 + 0.49 / 6.0)


def text(header, columns, decimals):
    rows = [",".join(header)]
    for values in zip(*columns):
        rows.append(",".join(v if isinstance(v, str) else (str(int(v)) if d == 0 else f"{v:.{d}f}")
                             for v, d in zip(values, decimals)))
    return "\n".join(rows) + "\n"


def digits(sigma):
    return int(max(0, np.ceil(-np.log10(sigma / 25.0))))
