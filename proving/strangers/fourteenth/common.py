"""What the three kinds share: noises, sizes, text."""
import numpy as np

ROW_NOISES = {
    "white": "normal, independent",
    "heavy": "Student's t with 4 to 6 degrees of freedom",
    "ar1": "each row remembers the row before",
    "heteroscedastic": "normal, its sd goes with something; the laboratory draws with what",
    "rounded": "normal, and the reading is rounded to about an sd",
    "outliers": "normal, a few rows are far off",
    "bursts": "normal, some stretches are several times noisier",
    "skewed": "gamma, long to one side",
}


def rng(*key):
    return np.random.default_rng([1414] + list(key))


def rms(v):
    return float(np.sqrt(np.mean(np.square(v))))


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


def row_noise(name, g, n, form):
    """Errors of unit sd. form: relative sds of the rows if heteroscedastic."""
    z = g.standard_normal(n)
    if name == "heavy":
        nu = g.choice([4.0, 5.0, 6.0])
        t = g.standard_t(nu, n)
        return np.clip(t / np.sqrt(nu / (nu - 2)), -9, 9)
    if name == "ar1":
        rho = g.uniform(0.3, 0.7)
        e = np.empty(n)
        e[0] = z[0]
        for i in range(1, n):
            e[i] = rho * e[i - 1] + np.sqrt(1 - rho * rho) * z[i]
        return e
    if name == "heteroscedastic":
        return z * form / rms(form)
    if name == "outliers":
        k = max(2, int(round(n * g.uniform(0.015, 0.04))))
        at = g.choice(n, k, replace=False)
        z[at] += g.choice([-1, 1], k) * g.uniform(4, 7, k)
        return z / np.sqrt(1 + k / n * 31)
    if name == "bursts":
        s = np.ones(n)
        for _ in range(max(2, n // 70)):
            a = int(g.integers(n))
            s[a:a + int(g.integers(5, 15))] = g.uniform(2.5, 4)
        return z * s / rms(s)
    if name == "skewed":
        k = g.uniform(0.8, 2)
        return (g.gamma(k, 1, n) - k) / np.sqrt(k) * g.choice([-1, 1])
    return z


class Table:
    def __init__(self, **k):
        self.__dict__.update(k)


def decimals(sd):
    """Decimals with which a step of the text is at most a thousandth of sd."""
    return max(0, int(np.ceil(-np.log10(sd * 1e-3) - 1e-9)))


def assemble(lab, effects, size, noise, number, seed, causes, names, noises, error):
    """lab: columns (name, text of rows), responses (name, declared values, sd), model, groups.
    error(noise, generator, response number): errors of unit sd."""
    effects = [effects] if isinstance(effects, str) else list(effects)
    assert noise in noises, noise
    cols = list(lab.columns)
    out = Table(lab=lab, options=list(lab.options), kept={}, step=0.0, error_sd=lab.responses[0][2])
    for j, (name, declared, sd) in enumerate(lab.responses):
        share = 1.0 if j == 0 else float(rng(number, seed, 70 + j).uniform(0.6, 1.3))
        hidden = np.zeros(lab.n)
        for e in effects:
            raw = np.asarray(causes[e](lab, rng(number, seed, 100 + names.index(e)), j), float)
            rest = left(lab.model, lab.groups, raw)
            if j == 0:
                out.kept[e] = rms(rest) / rms(raw - raw.mean())
            hidden = hidden + raw * (size * share * sd / rms(rest))
        g = rng(number, seed, 500 + j, list(noises).index(noise))
        y = declared + lab.shifts[j] + sd * error(noise, g, j) + hidden
        d = decimals(sd)
        if noise == "rounded":
            k = max(1, int(round(g.uniform(0.6, 1.1) * sd * 10 ** d)))
            step = k * 10.0 ** -d
            y = np.round(y / step) * step
            if j == 0:
                out.step = step
        cols.append((name, ["%.*f" % (d, v) for v in y]))
        if j == 0:
            out.hidden = hidden
            out.size = rms(left(lab.model, lab.groups, hidden)) / sd if effects else 0.0
    rows = zip(*[c for _, c in cols])
    out.csv = ",".join(c for c, _ in cols) + "\n" + "\n".join(",".join(r) for r in rows) + "\n"
    return out
