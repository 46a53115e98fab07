"""What the three kinds share: streams of random numbers, noises, scaling, text."""
import zlib
import numpy as np


class Lab:
    """A laboratory: its design, its instruments and its habits. The kinds fill it."""


class Table:
    """csv, options, size, hidden, error_sd, kept, step, lab."""


def stream(*words):
    return np.random.default_rng([w if isinstance(w, int) else zlib.crc32(w.encode()) for w in words])


def left(model, groups, v):
    """What least squares with the model in each group cannot take up."""
    out = np.empty(len(v))
    for k in np.unique(groups):
        at = groups == k
        m = model[at]
        q, s, _ = np.linalg.svd(m / np.sqrt(np.mean(m * m, axis=0) + 1e-300), full_matrices=False)
        q = q[:, s > 1e-10 * s[0]]
        w = v[at] - q @ (q.T @ v[at])
        out[at] = w - q @ (q.T @ w)
    return out


def rms(v):
    return float(np.sqrt(np.mean(v * v)))


def nice(v):
    """The nearest of 1, 2, 5 times a power of ten."""
    e = np.floor(np.log10(v))
    c = np.array([1.0, 2.0, 5.0, 10.0]) * 10.0 ** e
    return float(c[np.argmin(np.abs(np.log(c / v)))])


def decimals(v):
    return int(max(0, np.ceil(-np.log10(v) - 1e-9)))


def fixed(v, digits):
    return ["%.*f" % (digits, x + 0.0) for x in np.round(v, digits)]


# Row errors of variance one. g: random numbers, lab: the laboratory, step: in units of the error, free: variance that the row has.
def white(lab, g, j):
    return g.standard_normal(lab.n)


def heavy(lab, g, j):
    return g.standard_t(4.0, lab.n) / np.sqrt(2.0)


def ar1(lab, g, j):
    r = lab.ar
    e = g.standard_normal(lab.n)
    out = np.empty(lab.n)
    out[0] = e[0]
    for i in range(1, lab.n):
        out[i] = r * out[i - 1] + np.sqrt(1 - r * r) * e[i]
    return out


def heteroscedastic(lab, g, j):
    s = lab.spread(j)
    return g.standard_normal(lab.n) * s / rms(s)


def outliers(lab, g, j):
    share, far = 0.025, 6.0
    e = g.standard_normal(lab.n)
    bad = g.random(lab.n) < share
    return np.where(bad, far * e, e) / np.sqrt(1 - share + share * far * far)


def bursts(lab, g, j):
    s = np.ones(lab.n)
    length = int(g.integers(4, 11))
    for _ in range(max(2, int(round(0.1 * lab.n / length)))):
        a = int(g.integers(0, max(1, lab.n - length)))
        s[a:a + length] = 3.5
    return g.standard_normal(lab.n) * s / rms(s)


def skewed(lab, g, j):
    return (g.gamma(2.0, 1.0, lab.n) - 2.0) / np.sqrt(2.0)


NOISES = {"white": white, "heavy": heavy, "ar1": ar1, "heteroscedastic": heteroscedastic, "rounded": white,
          "outliers": outliers, "bursts": bursts, "skewed": skewed}


def resolution(lab, g, wanted):
    """Step of the display of each response, and the sd of the error of a row that goes with it."""
    lab.step = [nice(1.3 * w) for w in wanted]
    lab.error = [s / g.uniform(0.9, 1.7) for s in lab.step]


def build(kind, module, effects, seed, size, noise):
    lab = module.laboratory(seed)
    names = list(lab.truth)
    y0 = names[0]
    hidden = {k: np.zeros(lab.n) for k in names}
    kept = {}
    for e in effects:
        parts = module.EFFECTS[e](lab, stream(kind, seed, "effect", e))
        h = parts[0]
        rest = rms(left(lab.model, lab.groups, h))
        about = rms(h - np.mean(h))
        kept[e] = rest / about
        k = size * lab.error[0] / rest
        for name, p in zip(names, parts):
            hidden[name] = hidden[name] + k * p
    columns = dict(lab.columns)
    for j, name in enumerate(names):
        g = stream(kind, seed, "noise", noise, j)
        sd, step = lab.error[j], lab.step[j]
        row = 1.0 - lab.share ** 2
        if noise == "rounded":
            row -= step ** 2 / 12 / sd ** 2
        err = np.sqrt(row) * module.NOISES[noise](lab, g, j)
        if lab.share:
            p = stream(kind, seed, "plots", j).standard_normal(lab.plots)
            if noise == "plots_ar":
                for i in range(1, lab.plots):
                    p[i] = 0.5 * p[i - 1] + np.sqrt(0.75) * p[i]
            err = err + lab.share * p[lab.plot]
        y = lab.truth[name] + sd * (err + lab.drifts[j]) + hidden[name]
        if noise == "rounded":
            columns[name] = fixed(np.round(y / step) * step, decimals(step))
        else:
            columns[name] = fixed(y, decimals(5e-4 * sd))
    t = Table()
    heads = list(columns)
    t.csv = ",".join(heads) + "\n" + "\n".join(",".join(r) for r in zip(*columns.values())) + "\n"
    t.options = list(lab.options)
    t.size = size if effects else 0.0
    t.hidden = hidden[y0]
    t.error_sd = lab.error[0]
    t.step = lab.step[0]
    t.kept = kept
    t.lab = lab
    return t
