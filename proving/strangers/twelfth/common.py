"""What all kinds share: random streams, errors, least squares, text of the table."""
import zlib
from types import SimpleNamespace
import numpy as np


def stream(*words):
    return np.random.default_rng([zlib.crc32(str(w).encode()) for w in words])


def rms(v):
    return float(np.sqrt(np.mean(np.square(v))))


def left(model, groups, v):
    """What least squares of the declared model leaves, in each group."""
    out = np.empty(len(v))
    for k in np.unique(groups):
        at = groups == k
        m = model[at]
        q, s, _ = np.linalg.svd(m / np.sqrt(np.mean(m ** 2, axis=0) + 1e-300), full_matrices=False)
        q = q[:, s > 1e-10 * s[0]]
        w = v[at] - q @ (q.T @ v[at])
        out[at] = w - q @ (q.T @ w)
    return out


def white(r, n, level):
    return r.standard_normal(n)


def heavy(r, n, level):
    return r.standard_t(4, n) / np.sqrt(2.0)


def ar1(r, n, level):
    f = r.uniform(0.4, 0.7)
    e = r.standard_normal(n)
    out = np.empty(n)
    out[0] = e[0]
    for i in range(1, n):
        out[i] = f * out[i - 1] + np.sqrt(1 - f * f) * e[i]
    return out


def heteroscedastic(r, n, level):
    a = np.abs(level - np.mean(level))
    w = 0.4 + 1.6 * a / (a.max() + 1e-300)
    return r.standard_normal(n) * w / rms(w)


def outliers(r, n, level):
    bad = r.random(n) < 0.03
    return r.standard_normal(n) * np.where(bad, 6.0, 1.0) / np.sqrt(0.97 + 0.03 * 36)


def bursts(r, n, level):
    w, i = np.ones(n), 0
    while i < n:
        i += int(r.integers(12, 40))
        k = int(r.integers(3, 9))
        w[i:i + k] = 3.0
        i += k
    return r.standard_normal(n) * w / rms(w)


def skewed(r, n, level):
    k = 2.0
    return (r.gamma(k, 1.0, n) - k) / np.sqrt(k)


NOISES = {"white": white, "heavy": heavy, "ar1": ar1, "heteroscedastic": heteroscedastic, "rounded": white,
          "outliers": outliers, "bursts": bursts, "skewed": skewed}
STEP = 1.0      # of the rounded tables, in sd of a row's error


def walk(r, t, tau, sd):
    """A wandering quantity at times t, with memory tau."""
    out = np.empty(len(t))
    out[0] = r.standard_normal()
    for i in range(1, len(t)):
        f = np.exp(-(t[i] - t[i - 1]) / tau)
        out[i] = f * out[i - 1] + np.sqrt(1 - f * f) * r.standard_normal()
    return sd * out


def finish(kind, lab, module, effects, seed, size, noise):
    """lab: columns (name -> (values, digits or None)), responses (name -> clean values), error_sds, model, groups, options."""
    n = len(lab.groups)
    hidden = np.zeros((n, len(lab.responses)))
    kept = {}
    sd0 = lab.error_sds[0]
    for name in effects:
        raw = module.EFFECTS[name](lab, stream(kind, seed, "effect", name))
        raw = raw.reshape(n, -1)
        rest = rms(left(lab.model, lab.groups, raw[:, 0]))
        kept[name] = rest / rms(raw[:, 0] - raw[:, 0].mean())
        hidden += raw / rest * size * np.asarray(lab.error_sds)[None, :]
    r = stream(kind, seed, "error", noise)
    text = {}
    step = 0.0
    for j, (name, clean) in enumerate(lab.responses.items()):
        sd = lab.error_sds[j]
        e = lab.error(r, NOISES.get(noise, white), noise, clean) * sd
        y = clean + e + hidden[:, j]
        digits = int(np.ceil(-np.log10(sd * 4e-4)))
        if noise == "rounded":
            y = np.round(y / (STEP * sd)) * (STEP * sd)
            digits += 2
            if j == 0:
                step = STEP * sd
        text[name] = ["%.*f" % (max(digits, 0), v) for v in y]
    cols = {}
    for name, (v, d) in lab.columns.items():
        cols[name] = [str(w) for w in v] if d is None else ["%.*f" % (d, w) for w in v]
    cols.update(text)
    lines = [",".join(cols)] + [",".join(row) for row in zip(*cols.values())]
    got = rms(left(lab.model, lab.groups, hidden[:, 0])) / sd0 if len(kept) else 0.0
    return SimpleNamespace(csv="\n".join(lines) + "\n", options=list(lab.options), size=got, hidden=hidden[:, 0].copy(),
                           error_sd=sd0, kept=kept, step=step, lab=lab)
