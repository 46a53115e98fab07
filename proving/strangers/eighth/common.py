"""What the three kinds share: the table, the size, the noises."""
import zlib
import numpy as np


class Table:
    pass


def generator(seed, *words):
    return np.random.default_rng([int(seed)] + [zlib.crc32(str(w).encode()) for w in words])


def rms(v):
    return float(np.sqrt(np.mean(np.square(v))))


def left(model, groups, v):
    """What least squares of the declared model, in each group, leaves of v."""
    out = np.empty(len(v))
    for k in np.unique(groups):
        at = groups == k
        m = model[at] / np.sqrt(np.mean(model[at] ** 2, axis=0) + 1e-300)
        q, s, _ = np.linalg.svd(m, full_matrices=False)
        q = q[:, s > 1e-10 * s[0]]
        w = v[at] - q @ (q.T @ v[at])
        out[at] = w - q @ (q.T @ w)
    return out


def lag(target, dt, tau, start):
    """First-order lag of a target that is held for dt before each reading."""
    out, s = np.empty(len(target)), start
    for k in range(len(target)):
        s = target[k] + (s - target[k]) * np.exp(-dt[k] / tau)
        out[k] = s
    return out


# ---- noises of unit standard deviation; lab has n, blocks (rows that follow each other), strength (a scale 0..1 of the reading)

def white(lab, g):
    return g.standard_normal(lab.n)


def heavy(lab, g):
    return g.standard_t(4, lab.n) / np.sqrt(2.0)


def ar1(lab, g):
    e, rho, out = g.standard_normal(lab.n), 0.5, np.empty(lab.n)
    for k in range(lab.n):
        new = k == 0 or lab.blocks[k] != lab.blocks[k - 1]
        out[k] = e[k] if new else rho * out[k - 1] + np.sqrt(1 - rho * rho) * e[k]
    return out


def heteroscedastic(lab, g):
    s = 0.45 + 1.3 * lab.strength
    return g.standard_normal(lab.n) * s / rms(s)


def outliers(lab, g):
    e = g.standard_normal(lab.n)
    e[g.random(lab.n) < 0.02] *= 6.0
    return e / np.sqrt(0.98 + 0.02 * 36.0)


def bursts(lab, g):
    s, noisy = np.empty(lab.n), False
    for k in range(lab.n):
        noisy = g.random() < (0.85 if noisy else 0.03)
        s[k] = 2.6 if noisy else 0.8
    return g.standard_normal(lab.n) * s / rms(s)


def skewed(lab, g):
    return (g.gamma(2.5, 1.0, lab.n) - 2.5) / np.sqrt(2.5)


NOISES = {"white": white, "heavy": heavy, "ar1": ar1, "heteroscedastic": heteroscedastic, "rounded": white, "outliers": outliers,
          "bursts": bursts, "skewed": skewed}


def finish(module, kind, lab, effects, seed, size, noise):
    """Noise, effects of the size asked, text."""
    effects = [effects] if isinstance(effects, str) else list(effects)
    t = Table()
    t.kind, t.effects, t.seed, t.noise, t.options, t.error_sd = kind, tuple(effects), seed, noise, list(lab.options), lab.error_sd
    first = lab.sensors[0]
    step = 0.0
    text_step = 10.0 ** -lab.decimals
    if noise == "rounded":
        step = max(1, round(0.9 * lab.error_sd / text_step)) * text_step
    t.step = step
    share = np.sqrt(max(0.1, 1.0 - step * step / 12.0 / lab.error_sd ** 2))
    out = {}
    for s in lab.sensors:
        g = generator(seed, kind, "noise", s)
        e = module.NOISES[noise](lab, g)
        if lab.plots is not None:
            e = lab.plot_error(e, g, noise)
        out[s] = lab.clean[s] + share * lab.error_sd * lab.ratio[s] * e
    t.hidden, t.kept, t.sizes = np.zeros(lab.n), {}, {}
    for name in effects:
        raw = module.EFFECTS[name](lab, generator(seed, kind, name))
        got = left(lab.model, lab.groups, raw[first])
        about = raw[first] - raw[first].mean()
        t.kept[name] = rms(got) / max(rms(about), 1e-300)
        factor = size * lab.error_sd / rms(got)
        for s in raw:
            out[s] = out[s] + factor * raw[s]
        t.hidden = t.hidden + factor * raw[first]
        t.sizes[name] = rms(left(lab.model, lab.groups, factor * raw[first])) / lab.error_sd
    t.size = float(np.mean(list(t.sizes.values()))) if effects else 0.0
    lines = [",".join(list(lab.columns) + lab.sensors)]
    for s in lab.sensors:
        if step:
            out[s] = np.round(out[s] / step) * step
    for k in range(lab.n):
        lines.append(",".join([lab.columns[c][k] for c in lab.columns] + ["%.*f" % (lab.decimals, out[s][k]) for s in lab.sensors]))
    t.csv = "\n".join(lines) + "\n"
    t.lab = lab
    return t


def texts(v, form):
    """Text of a column, and the numbers that the text says."""
    w = [form % x for x in v]
    return w, np.array([float(x) for x in w])
