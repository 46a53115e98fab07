"""What the three kinds share: random numbers, noises, sizes, the text of a table."""
import hashlib
import math
import numpy as np

NOISES = {
    "white": "independent, normal",
    "heavy": "independent, Student's t with four degrees of freedom",
    "ar1": "each row keeps a part of the error of the row before",
    "heteroscedastic": "the error grows with what is measured",
    "rounded": "white, and the display shows coarse steps",
    "outliers": "white, and a row in fifty far off",
    "bursts": "white, and some spells of rows are three times as noisy",
    "skewed": "independent, with a long tail to one side",
}


class Lab:
    """One laboratory: plain attributes, set by the kind."""


class Table:
    """Text of a table and what is hidden in it."""


def rng(*words):
    key = hashlib.sha256("/".join(str(w) for w in ("XI",) + words).encode()).digest()
    return np.random.default_rng(int.from_bytes(key[:8], "little"))


def text(values, decimals):
    return ["%.*f" % (decimals, v) for v in values]


def shown(values, decimals):
    """The numbers as a reader of the text has them."""
    return np.array([float(s) for s in text(values, decimals)])


def unit_errors(g, noise, n, level):
    """(n,) errors of sd 1; level: 0 to 1, how large the measured value is."""
    if noise in ("white", "rounded", "plots_ar"):
        return g.standard_normal(n)
    if noise == "heavy":
        return g.standard_t(4, n) / math.sqrt(2)
    if noise == "ar1":
        rho = g.uniform(0.4, 0.7)
        e = g.standard_normal(n)
        for i in range(1, n):
            e[i] = rho * e[i - 1] + math.sqrt(1 - rho * rho) * e[i]
        return e
    if noise == "heteroscedastic":
        s = 0.4 + g.uniform(1.5, 3.0) * level
        return g.standard_normal(n) * s / np.sqrt(np.mean(s * s))
    if noise == "outliers":
        e = g.standard_normal(n)
        far = g.random(n) < 0.02
        e = e + far * g.choice([-1.0, 1.0], n) * g.uniform(4, 7, n)
        return e / math.sqrt(1 + 0.02 * 31)
    if noise == "bursts":
        s = np.ones(n)
        for _ in range(max(2, n // 60)):
            i = g.integers(0, n)
            s[i:i + int(g.integers(4, 13))] = 3.0
        return g.standard_normal(n) * s / np.sqrt(np.mean(s * s))
    if noise == "skewed":
        k = 1.5
        return (g.gamma(k, 1.0, n) - k) / math.sqrt(k)
    raise ValueError("no such noise: %s" % noise)


def left(m, groups, v):
    """What least squares leaves of v, in each group."""
    out = np.empty(len(v))
    for k in np.unique(groups):
        at = groups == k
        q, s, _ = np.linalg.svd(m[at] / np.sqrt(np.mean(m[at] ** 2, axis=0) + 1e-300), full_matrices=False)
        q = q[:, s > 1e-10 * s[0]]
        w = v[at] - q @ (q.T @ v[at])
        out[at] = w - q @ (q.T @ w)
    return out


def rms(v):
    return float(np.sqrt(np.mean(v * v)))


def coarse(sd):
    """A display step of 1, 2 or 5, at most 1.6 sd; and its decimals."""
    best = None
    for e in range(-12, 6):
        for k in (1, 2, 5):
            if k * 10.0 ** e <= 1.6 * sd:
                best = (k, e)
    return best[0] * 10.0 ** best[1], max(0, -best[1])


def lowpass(times, target, tau, start=None):
    """A state that runs after a target, which holds since the row before."""
    out = np.empty(len(times))
    s = target[0] if start is None else start
    for i in range(len(times)):
        dt = times[i] - times[i - 1] if i else 3 * (times[1] - times[0])
        s = target[i] + (s - target[i]) * math.exp(-dt / tau)
        out[i] = s
    return out


def make(kind, module, effects, seed, size, noise):
    if noise not in module.NOISES:
        raise ValueError("no such noise: %s" % noise)
    effects = [effects] if isinstance(effects, str) else list(effects)
    lab = module.laboratory(seed)
    n, k = lab.base.shape
    total = np.zeros((n, k))
    kept = {}
    for e in effects:
        raw = np.asarray(module.EFFECTS[e](lab, rng(kind, seed, "cause", e)), float)
        rest = rms(left(lab.model, lab.groups, raw[:, 0]))
        about = rms(raw[:, 0] - raw[:, 0].mean())
        kept[e] = rest / about if about else 0.0
        total = total + raw * (size * lab.sd[0] / rest)
    g = rng(kind, seed, "noise", noise)
    columns = list(lab.columns)
    step = None
    for j in range(k):
        sd = lab.sd[j]
        if noise == "rounded":
            width, decimals = coarse(sd)
            err = lab.errors(g, noise, j) * math.sqrt(sd * sd - width * width / 12)
            y = np.round((lab.base[:, j] + err + total[:, j]) / width) * width
            step = width if j == 0 else step
        else:
            decimals = int(math.ceil(3 - math.log10(sd)))
            y = lab.base[:, j] + lab.errors(g, noise, j) * sd + total[:, j]
        columns.append((lab.responses[j], text(y, decimals)))
    lines = [",".join(c for c, _ in columns)] + [",".join(r) for r in zip(*[v for _, v in columns])]
    t = Table()
    t.csv = "\n".join(lines) + "\n"
    t.options = list(lab.options)
    t.hidden = total[:, 0]
    t.size = rms(left(lab.model, lab.groups, t.hidden)) / lab.sd[0] if effects else 0.0
    t.error_sd = float(lab.sd[0])
    t.kept, t.step, t.lab, t.all_hidden = kept, step, lab, total
    return t
