"""What the three kinds share: random streams, relaxation, residuals, the size solver, error sequences."""
import zlib

import numpy as np

ARCSEC = np.pi / 180 / 3600


def rng_of(*key):
    return np.random.default_rng([zlib.crc32(repr(k).encode()) for k in key])


def registry():
    """EFFECTS, ABOUT and the decorator that fills them; needs are demands on the design."""
    effects, about = {}, {}

    def effect(text, **needs):
        def keep(f):
            f.needs = needs
            effects[f.__name__] = f
            about[f.__name__] = " ".join(text.split())
            return f
        return keep
    return effects, about, effect


def relax(t, target, tau, start=None):
    """First-order lag towards target (held since the previous row); tau may be an array."""
    tau = np.broadcast_to(tau, np.shape(t))
    out = np.empty(len(t))
    s = target[0] if start is None else start
    for i in range(len(t)):
        w = np.exp(-(t[i] - t[i - 1]) / tau[i]) if i else 1.0
        s = target[i] + (s - target[i]) * w
        out[i] = s
    return out


def wander(rng, t, sd, hours):
    """Smooth slow wandering (sum of sinusoids with periods around `hours`), t in s."""
    f = 1 / (3600 * hours * np.exp(rng.uniform(-0.7, 1.2, 6)))
    return sd * np.sqrt(2 / 6) * sum(np.sin(2 * np.pi * (fi * t + p)) for fi, p in zip(f, rng.uniform(0, 1, 6)))


def residual(h, X, group=None):
    out = np.array(h, float)
    for g in ([None] if group is None else np.unique(group)):
        m = slice(None) if g is None else group == g
        A = X[m] / np.maximum(np.abs(X[m]).max(0), 1e-12)
        out[m] = out[m] - A @ np.linalg.lstsq(A, out[m], rcond=1e-10)[0]
    return out


def rms(x):
    return float(np.sqrt(np.mean(np.square(x))))


def seen(h, r):
    """At least a tenth of the effect survives the declared model, and on more than a few rows."""
    s2 = np.sum(r ** 2)
    return s2 > 0 and rms(r) > 0.1 * rms(h) and s2 ** 2 / np.sum(r ** 4) > max(4, 0.025 * len(r))


def solve(fun, target):
    """Scale k > 0 so that fun(k) = target: proportional steps, then bisection in log k; None if out of reach."""
    k = 1.0
    for _ in range(8):
        f = fun(k)
        if abs(f / target - 1) < 1e-6:
            return k
        k *= np.clip(target / f, 0.01, 100) if f > 0 else 10.0
    grid = np.exp(np.linspace(np.log(1e-4), np.log(1e4), 60))
    val = np.array([fun(g) for g in grid]) - target
    up = np.flatnonzero((val[:-1] < 0) & (val[1:] >= 0))
    if not len(up):
        return None
    lo, hi = grid[up[0]], grid[up[0] + 1]
    for _ in range(50):
        mid = np.sqrt(lo * hi)
        lo, hi = (mid, hi) if fun(mid) < target else (lo, mid)
    return hi if abs(fun(hi) / target - 1) < 0.02 else None


# --- error sequences of sd 1 -------------------------------------------------------------------------

def _ar(rng, n, phi):
    e = rng.standard_normal(n)
    for i in range(1, n):
        e[i] = phi * e[i - 1] + np.sqrt(1 - phi ** 2) * e[i]
    return e


def _flicker(rng, n):
    m = max(4 * n, 64)
    f = np.arange(1, m // 2 + 1)
    z = (rng.standard_normal(len(f)) + 1j * rng.standard_normal(len(f))) / np.sqrt(f)
    x = np.fft.irfft(np.r_[0, z], m)
    return x[:n] / x.std()


def _outliers(rng, n):
    hit = rng.random(n) < 0.01
    if n >= 50 and not hit.any():
        hit[rng.integers(n)] = True
    return rng.standard_normal(n) + hit * rng.choice([-1, 1], n) * rng.uniform(6, 15, n)


SEQUENCES = {
    "white": lambda rng, n: rng.standard_normal(n),
    "heavy_tails": lambda rng, n: rng.standard_t(3, n) / np.sqrt(3),
    "outliers": _outliers,
    "ar03": lambda rng, n: _ar(rng, n, 0.3),
    "ar06": lambda rng, n: _ar(rng, n, 0.6),
    "flicker": _flicker,
}


def noises():
    """name -> f(rng, setting in 0..1, group number of each row) -> errors (rows,), sd 1 overall."""
    def plain(seq):
        return lambda rng, setting, group: seq(rng, len(setting))

    def grows(rng, setting, group):
        w = 0.3 + rng.uniform(1, 3) * setting
        return rng.standard_normal(len(w)) * w / rms(w)

    def differs(rng, setting, group):
        w = np.exp(rng.uniform(-1, 1, group.max() + 1))[group]
        return rng.standard_normal(len(w)) * w / rms(w)

    def common(rng, setting, group):
        """Half the variance is shared by neighbouring rows (blocks of 3 to 7), AR 0.5 between blocks and between groups."""
        n = len(setting)
        block = np.arange(n) // rng.integers(3, 8)
        shared = 0.5 * (_ar(rng, block.max() + 1, 0.5)[block] + _ar(rng, group.max() + 1, 0.5)[group])
        return shared + np.sqrt(0.5) * rng.standard_normal(n)
    out = {name: plain(seq) for name, seq in SEQUENCES.items()}
    out.update(sd_grows_with_setting=grows, sd_differs_between_groups=differs, common_to_neighbours=common)
    return out
