"""Noises, memories in real time, sizes and the text of a table."""

import numpy as np

NOISES = {
    "white": "normal, independent",
    "heavy": "Student's t with 3.5 to 5 degrees of freedom, cut off at 10",
    "wander": "half or less of the variance wanders with a memory of some rows, in real time",
    "sittings": "consecutive rows in groups of 5 to 15 share a part of their error",
    "grows": "normal, the sd grows with the signal",
    "glitches": "normal, one or two rows in a hundred are far off",
    "rounded": "normal, and the reading is rounded to about an sd",
}


class Table:
    def __init__(self, **k):
        self.__dict__.update(k)


def rng(*key):
    return np.random.default_rng([151515, *key])


def rms(v):
    return float(np.sqrt(np.mean(np.square(v))))


def relax(target, t, tau, start=None):
    """A first-order memory: between rows it approaches the later target."""
    out = np.empty(len(t))
    state = target[0] if start is None else start
    out[0] = state
    for i in range(1, len(t)):
        state = target[i] + (state - target[i]) * np.exp(-(t[i] - t[i - 1]) / tau)
        out[i] = state
    return out


def play(v, width, start):
    """What follows v through a slack of +-width (a number, or one for each row)."""
    width = np.broadcast_to(width, v.shape)
    out = np.empty(len(v))
    state = start
    for i in range(len(v)):
        state = min(max(state, v[i] - width[i]), v[i] + width[i])
        out[i] = state
    return out


def left(model, groups, v):
    """What least squares leaves of v, in each group."""
    out = np.empty(len(v))
    for k in np.unique(groups):
        at = groups == k
        u, s, _ = np.linalg.svd(model[at] / np.sqrt(np.mean(model[at] ** 2, axis=0) + 1e-300), full_matrices=False)
        u = u[:, s > 1e-10 * s[0]]
        w = v[at] - u @ (u.T @ v[at])
        out[at] = w - u @ (u.T @ w)
    return out


def row_noise(name, g, t, signal):
    """Errors of unit sd. signal: the declared response."""
    n = len(t)
    z = g.standard_normal(n)
    if name == "heavy":
        nu = g.uniform(3.5, 5)
        return np.clip(g.standard_t(nu, n) / np.sqrt(nu / (nu - 2)), -10, 10)
    if name == "wander":
        share, tau = g.uniform(0.25, 0.5), g.uniform(2, 8) * float(np.median(np.diff(t)))
        walk = np.empty(n)
        walk[0] = g.standard_normal()
        for i in range(1, n):
            keep = np.exp(-(t[i] - t[i - 1]) / tau)
            walk[i] = keep * walk[i - 1] + np.sqrt(1 - keep * keep) * g.standard_normal()
        return np.sqrt(1 - share) * z + np.sqrt(share) * walk
    if name == "sittings":
        share = g.uniform(0.15, 0.35)
        group = np.repeat(np.arange(n), g.integers(5, 16, n))[:n]
        return np.sqrt(1 - share) * z + np.sqrt(share) * g.standard_normal(n)[group]
    if name == "grows":
        size = np.abs(signal) / np.max(np.abs(signal))
        form = np.hypot(g.uniform(0.3, 0.6), g.uniform(1.0, 1.6) * size)
        return z * form / rms(form)
    if name == "glitches":
        k = max(1, int(round(n * g.uniform(0.01, 0.02))))
        at = g.choice(n, k, replace=False)
        z[at] += g.choice([-1, 1], k) * g.uniform(5, 9, k)
        return z / np.sqrt(1 + k / n * 50)
    return z


def decimals(sd):
    """Decimals with which a step of the text is at most a thousandth of sd."""
    return max(0, int(np.ceil(-np.log10(sd * 1e-3) - 1e-9)))


def assemble(number, seed, lab, effects, size, noise, module, error):
    """lab: columns (name, text of rows), responses (name, declared values, sd), shifts, model, groups. error(noise,
    generator, response number): errors of unit sd. Causes of module.COMMON have one size for all responses (one bench,
    one room); of the others each response has its own. Those of module.SIGNED may have either sign."""
    effects = [effects] if isinstance(effects, str) else list(effects)
    if noise not in module["NOISES"]:
        raise ValueError(noise)
    names = list(module["EFFECTS"])
    out = Table(lab=lab, options=list(lab.options), kept={}, step=0.0, error_sd=lab.responses[0][2])
    columns = list(lab.columns)
    factor = {}
    for j, (name, declared, sd) in enumerate(lab.responses):
        hidden = np.zeros(lab.n)
        for e in effects:
            raw = np.asarray(module["EFFECTS"][e](lab, rng(number, seed, 100 + names.index(e)), j), float)
            d = rng(number, seed, 300 + names.index(e), 0 if e in module["COMMON"] else j)
            own = d.choice([-1.0, 1.0]) if e in module["SIGNED"] else 1.0
            if j == 0:
                rest = left(lab.model, lab.groups, raw)
                out.kept[e] = rms(rest) / rms(raw - raw.mean())
                factor[e] = size * sd / rms(rest)
            elif e not in module["COMMON"]:
                own *= sd / out.error_sd * d.uniform(0.5, 1.4)
            hidden = hidden + factor[e] * own * raw
        g = rng(number, seed, 500 + j, list(module["NOISES"]).index(noise))
        y = declared + lab.shifts[j] + sd * error(noise, g, j) + hidden
        d = decimals(sd)
        if noise == "rounded":
            step = max(1, int(round(g.uniform(0.6, 1.1) * sd * 10**d))) * 10.0**-d
            y = np.round(y / step) * step
            if j == 0:
                out.step = step
        columns.append((name, ["%.*f" % (d, v) for v in y]))
        if j == 0:
            out.hidden = hidden
            out.size = rms(left(lab.model, lab.groups, hidden)) / sd if effects else 0.0
    rows = zip(*[c for _, c in columns], strict=True)
    out.csv = "\n".join([",".join(c for c, _ in columns)] + [",".join(r) for r in rows]) + "\n"
    return out
