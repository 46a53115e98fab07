"""What the three kinds share: random streams, noises, scaling, the table that is returned."""
import zlib

import numpy as np


def stream(*words):
    """A random stream that depends on the words only."""
    return np.random.default_rng([zlib.crc32(str(w).encode()) for w in words])


def residual(shape, model, blocks=None):
    """What is left of shape after least squares on model, in each block apart if blocks are given."""
    out = np.array(shape, float)
    if blocks is None:
        blocks = np.zeros(len(out), int)
    for b in np.unique(blocks):
        k = blocks == b
        m = model[k]
        s = np.abs(m).max(axis=0)
        m = m / np.where(s > 0, s, 1)
        out[k] = out[k] - m @ np.linalg.lstsq(m, out[k], rcond=None)[0]
    return out


def rms(v):
    return float(np.sqrt(np.mean(np.square(v))))


def draw(make, words, model, blocks=None, want=0.25, tries=40):
    """Constants of the laboratory for one effect: redrawn (deterministically) while the declared model would
    swallow nearly all of the effect, for such a laboratory could have no complaint. make(rng) gives a list of
    shapes, one per response; the first decides."""
    best = None
    for i in range(tries):
        shapes = make(stream(*words, i))
        first = shapes[0]
        spread = rms(first - first.mean())
        share = rms(residual(first, model, blocks)) / spread if spread > 0 else 0.0
        if best is None or share > best[0]:
            best = (share, shapes)
        if share >= want:
            break
    return best


def low_pass(u, t, tau, start=0.0, restart=None):
    """First-order memory of u held between readings. The state at a reading is what earlier readings left.
    restart: rows at which the state goes back to start."""
    y = np.empty(len(u))
    s = start
    for i in range(len(u)):
        if i and not (restart is not None and restart[i]):
            a = np.exp(-(t[i] - t[i - 1]) / tau)
            s = a * s + (1 - a) * u[i - 1]
        else:
            s = start
        y[i] = s
    return y


# ---- errors of mean 0 and sd 1 (over the rows of a table, on the average) ----------------------------------

def white(r, n, **_):
    return r.standard_normal(n)


def student(r, n, **_):
    return r.standard_t(5, n) / np.sqrt(5 / 3)


def skewed(r, n, **_):
    return (r.gamma(3.0, 1.0, n) - 3.0) / np.sqrt(3.0)


def contaminated(r, n, **_):
    z = r.standard_normal(n) * np.where(r.random(n) < 0.03, 4.5, 1.0)
    return z / np.sqrt(0.97 + 0.03 * 4.5 ** 2)


def uniform(r, n, **_):
    return r.uniform(-1, 1, n) * np.sqrt(3)


def ar1(r, n, rho=None, **_):
    rho = r.uniform(0.3, 0.6) if rho is None else rho
    e = r.standard_normal(n)
    z = np.empty(n)
    z[0] = e[0]
    for i in range(1, n):
        z[i] = rho * z[i - 1] + np.sqrt(1 - rho * rho) * e[i]
    return z


def flicker(r, n, **_):
    """White with a tenth to a third of the variance in a sum of slow first-order processes."""
    f = r.uniform(0.1, 0.33)
    slow = sum(ar1(r, n, rho=np.exp(-1 / k)) for k in (2.0, 8.0, 32.0)) / np.sqrt(3)
    return np.sqrt(1 - f) * r.standard_normal(n) + np.sqrt(f) * slow


def by_level(r, n, level=None, **_):
    """sd grows about threefold with the level (0 to 1)."""
    s = 0.5 + level
    return r.standard_normal(n) * s / rms(s)


def by_block(r, n, block=None, **_):
    """Every block its own sd, about 2:1 between them."""
    b = np.unique(block, return_inverse=True)[1]
    s = np.exp(r.uniform(-0.4, 0.4, b.max() + 1))[b]
    return r.standard_normal(n) * s / rms(s)


def bursts(r, n, **_):
    """Quiet and loud stretches of about fifteen readings."""
    loud = np.cumsum(r.random(n) < 1 / 15) % 2
    s = np.where(loud == 1, 1.6, 0.7)
    return r.standard_normal(n) * s / rms(s)


class Table:
    def __init__(self, kind, effects, seed, noise, columns, options, responses, hidden, sizes, sigma, blocks=None,
                 model=None, shares=None):
        self.kind, self.effects, self.seed, self.noise = kind, tuple(effects), seed, noise
        self.columns, self.options, self.responses = columns, list(options), list(responses)
        self.hidden, self.sizes, self.sigma = hidden, sizes, sigma
        self.size = min(sizes.values()) if sizes else 0.0
        self.model, self.blocks, self.shares = model, blocks, shares or {}

    @property
    def csv(self):
        names = list(self.columns)
        cols = [self.columns[k][1] for k in names]
        lines = [",".join(names)]
        for i in range(len(cols[0])):
            lines.append(",".join(c[i] for c in cols))
        return "\n".join(lines) + "\n"


def text(values, digits=None):
    """A column: (values as they stand in the file, their text)."""
    if digits is None:
        return (list(values), [str(v) for v in values])
    if digits == 0:
        v = [int(round(float(x))) for x in values]
        return (np.array(v), [str(x) for x in v])
    s = [f"{float(x):.{digits}f}" for x in values]
    s = [w[1:] if w.startswith("-") and not w.strip("-0.") else w for w in s]
    return (np.array([float(x) for x in s]), s)


def decimals(sigma):
    """Enough digits for a hundredth of sigma."""
    return int(max(1, np.ceil(-np.log10(sigma)) + 2))
