"""What the kinds of laboratories share: random numbers, noises, least squares, text."""
import zlib
import numpy as np

NOISES = {
    "white": "Normal, independent.",
    "heavy": "Student t with four degrees of freedom.",
    "ar1": "Each error keeps 0.55 of the one before, within a group of rows.",
    "heteroscedastic": "Grows with the load on the sensor.",
    "rounded": "Readings rounded to about two standard deviations.",
    "outliers": "Two rows in a hundred have seven times the spread.",
    "bursts": "A few stretches of rows have four times the spread.",
    "skewed": "A long tail on one side (gamma, shape 2).",
}
FINE, STEP = 0.8, float(np.sqrt(12 * (1 - 0.8 ** 2)))  # rounded: white part and step, in sd of a row


def rng(*words):
    return np.random.default_rng([zlib.crc32(("tenth/%s" % (w,)).encode()) for w in words])


def one_of(g, items):
    return items[int(g.integers(len(items)))]


def turn(seed, count, tag):
    """0 .. count - 1, each once in every `count` seeds that follow each other."""
    k, i = divmod(int(seed), count)
    return int(rng("turn", tag, k).permutation(count)[i])


def rms(v):
    return float(np.sqrt(np.mean(np.square(v))))


def left(model, groups, v):
    """What least squares on the declared model leaves of v, in each group."""
    out = np.empty(len(v))
    for k in np.unique(groups):
        at = groups == k
        m = model[at]
        u, s, _ = np.linalg.svd(m / np.sqrt(np.mean(m * m, axis=0) + 1e-300), full_matrices=False)
        q = u[:, s > 1e-10 * s[0]]
        w = v[at] - q @ (q.T @ v[at])
        out[at] = w - q @ (q.T @ w)
    return out


def draw(g, noise, groups, load):
    """(rows,) of variance one. groups: runs of rows that follow each other; load: 0 .. 1 for each row."""
    n = len(groups)
    if noise in ("white", "plots_ar"):
        return g.standard_normal(n)
    if noise == "rounded":
        return FINE * g.standard_normal(n)
    if noise == "heavy":
        return g.standard_t(4, n) / np.sqrt(2)
    if noise == "ar1":
        e = g.standard_normal(n)
        for i in range(1, n):
            if groups[i] == groups[i - 1]:
                e[i] = 0.55 * e[i - 1] + np.sqrt(1 - 0.55 ** 2) * e[i]
        return e
    if noise == "heteroscedastic":
        s = 0.35 + 1.3 * load
        return g.standard_normal(n) * s / rms(s)
    if noise == "outliers":
        return g.standard_normal(n) * np.where(g.random(n) < 0.02, 7.0, 1.0) / np.sqrt(0.98 + 0.02 * 49)
    if noise == "bursts":
        s = np.ones(n)
        for _ in range(3):
            a = int(g.integers(0, n))
            s[a:a + max(3, n // 30)] = 4.0
        return g.standard_normal(n) * s / rms(s)
    if noise == "skewed":
        return (g.gamma(2.0, 1.0, n) - 2) / np.sqrt(2)
    raise ValueError("unknown noise: %s" % noise)


def text(v, digits):
    return ["%.*f" % (digits, x) for x in v]


def unit(v):
    v = np.asarray(v, float)
    return (v - v.min()) / (v.max() - v.min() + 1e-300)


def lagged(target, gap, tau, start):
    """First-order state which strives after target[i] during gap[i] before row i."""
    out = np.empty(len(target))
    s = start
    for i in range(len(target)):
        s = target[i] + (s - target[i]) * np.exp(-gap[i] / tau)
        out[i] = s
    return out


class Lab:
    """columns: name -> texts; responses: names; clean: (rows, sensors); error: sd for each sensor; model, groups: the declared model;
    runs: rows whose noise hangs together; load: 0 .. 1; options: words of the command line; and what its kind needs."""

    def __init__(self, **k):
        self.__dict__.update(k)
