"""What the three kinds share: streams of numbers, noises, projection, exact sizes, text of a table."""
import math
import numpy as np

CODES = {"attitude": 61, "whole_plots": 62, "general": 63}


def stream(kind, seed, *more):
    """A stream of its own for each purpose: design, noise and each effect never share draws."""
    words = [CODES[kind], int(seed) & 0xFFFFFFFF, 20206]
    for m in more:
        if isinstance(m, str):
            words.extend(m.encode("ascii"))
        else:
            words.append(int(m))
    return np.random.default_rng(words)


class Table:
    """csv (text), options (list of words), size (float), hidden (rows,);
    more than the contract asks: error_sd (of the first response), sizes (by effect), kept (by effect:
    rms after / rms before the declared model), effects, noise, seed, kind."""

    def __init__(self, **words):
        self.__dict__.update(words)

    def __repr__(self):
        return "<%s seed %s %s noise %s size %.4g>" % (
            self.kind, self.seed, list(self.effects), self.noise, self.size)


def rms(v):
    return float(np.sqrt(np.mean(np.square(v))))


def outside(model, v, groups=None):
    """v less its least-squares fit on the columns of model (in each group if there are groups)."""
    v = np.asarray(v, float)
    out = np.empty_like(v)
    if groups is None:
        groups = np.zeros(len(v), int)
    for k in np.unique(groups):
        at = groups == k
        a = model[at]
        a = a / np.maximum(np.sqrt(np.mean(a * a, axis=0)), 1e-300)
        c = np.linalg.lstsq(a, v[at], rcond=1e-10)[0]
        r = v[at] - a @ c
        out[at] = r - a @ np.linalg.lstsq(a, r, rcond=1e-10)[0]
    return out


def raw_noise(name, rng, n, grow, groups):
    """Errors of about unit size, rows in executed order; the caller brings them to their exact size."""
    if name in ("white", "rounded"):
        return rng.standard_normal(n)
    if name == "heavy_tails":
        return rng.standard_t(3.0, n)
    if name == "ar1":
        rho = rng.uniform(0.55, 0.92)
        e = rng.standard_normal(n)
        out = np.empty(n)
        out[0] = e[0]
        for i in range(1, n):
            out[i] = rho * out[i - 1] + math.sqrt(1 - rho * rho) * e[i]
        return out
    if name == "flicker":
        m = 4 * n
        f = np.fft.rfftfreq(m)
        f[0] = f[1]
        spectrum = (rng.standard_normal(len(f)) + 1j * rng.standard_normal(len(f))) / np.sqrt(f)
        spectrum[0] = 0
        v = np.fft.irfft(spectrum, m)[:n]
        return v / np.std(v) + 0.3 * rng.standard_normal(n)
    if name == "growing":
        u = (grow - grow.min()) / (grow.max() - grow.min())
        return rng.standard_normal(n) * (0.35 + rng.uniform(1.2, 2.2) * u)
    if name == "bursts":
        scale = np.ones(n)
        for _ in range(int(rng.integers(2, 6))):
            length = max(3, int(round(n * rng.uniform(0.01, 0.03))))
            start = int(rng.integers(0, n - length))
            scale[start:start + length] = rng.uniform(4, 8)
        return rng.standard_normal(n) * scale
    if name == "skew":
        return rng.gamma(1.3, 1.0, n) - 1.3
    if name.startswith("by_"):
        ids, at = np.unique(groups, return_inverse=True)
        level = np.exp(0.6 * rng.standard_normal(len(ids)))
        level[int(rng.integers(len(ids)))] *= 1.8
        return rng.standard_normal(n) * level[at]
    raise ValueError("no such noise: %r" % (name,))


def errors(name, rng, n, grow, groups, sd, clean, plots=None, ratio=3.0):
    """(errors, step of rounding or None). Their standard deviation over the rows of the table is sd exactly
    (with rounding nearly: build measures what it is).

    With plots, a second error, the same for all rows of a whole plot, of `ratio` times the reading's.
    With rounding, the errors are those of the rounded null table."""
    e = raw_noise(name, rng, n, grow, groups)
    e = e / np.std(e)
    if plots is not None:
        ids, at = np.unique(plots, return_inverse=True)
        w = {"heavy_tails": lambda: rng.standard_t(4.0, len(ids)),
             "skew": lambda: rng.gamma(1.5, 1.0, len(ids)) - 1.5}.get(
                 name, lambda: rng.standard_normal(len(ids)))()
        w = w / np.std(w)
        e = e + ratio * w[at]
    one = 1.0 if plots is None else 1.0 / math.sqrt(1 + ratio * ratio)   # reading's part of the sd
    if name != "rounded":
        return e * (sd / np.std(e)), None
    e = e * (0.9 * sd / np.std(e))
    step = 1.8 * sd * one
    # a step of an honest display: one or two digits
    digits = 1 - int(math.floor(math.log10(step)))
    step = round(step, digits)
    total = np.round((clean + e) / step) * step - clean
    return total, step


def sized(shape, model, groups, want):
    """(shape times a constant so that what the model leaves has rms `want`, share left by the model)."""
    left = outside(model, shape[:, 0], groups)
    whole = rms(shape[:, 0] - shape[:, 0].mean()) + 1e-300
    share = rms(left) / whole
    if not np.isfinite(share) or share < 1e-4:
        raise ValueError("the declared model takes up the whole effect")
    return shape * (want / rms(left)), share


def two(shape, k):
    shape = np.asarray(shape, float)
    if shape.ndim == 1:
        shape = shape[:, None]
    if shape.shape[1] == 1 and k > 1:
        shape = np.repeat(shape, k, axis=1)
    return shape[:, :k]


def places(sd):
    """Decimals so that the last digit is below a ten-thousandth of the error."""
    return max(0, int(math.ceil(-math.log10(sd))) + 4)


def text(columns):
    """columns: list of (name, values, decimals); decimals None for integers and words."""
    cells = []
    for _, v, d in columns:
        if d is None:
            cells.append([str(x) if isinstance(x, str) else str(int(x)) for x in v])
        else:
            cells.append(["%.*f" % (d, x + 0.0) for x in v])
    lines = [",".join(c[0] for c in columns)]
    lines.extend(",".join(r) for r in zip(*cells))
    return "\n".join(lines) + "\n"


def build(kind, module, effects, seed, size, noise):
    """One table. The design and the errors come from streams which know nothing of the effects."""
    effects = tuple([effects] if isinstance(effects, str) else effects)
    for e in effects:
        if e not in module.EFFECTS:
            raise ValueError("%s has no effect %r" % (kind, e))
    if noise not in module.NOISES:
        raise ValueError("%s has no noise %r" % (kind, noise))
    d = module.design(seed)
    clean = d["clean"]
    n, k = clean.shape
    err = np.empty_like(clean)
    step = None
    for j in range(k):
        rng = stream(kind, seed, "noise", noise, j)
        err[:, j], s = errors(noise, rng, n, d["grow"], d["noise_groups"], d["sd"][j],
                              clean[:, j], d.get("plots"))
        step = s if step is None else step
    sd = float(np.std(err[:, 0]))
    add = np.zeros_like(clean)
    sizes, kept = {}, {}
    for e in effects:
        rng = stream(kind, seed, "effect", e)
        sign = rng.choice([-1.0, 1.0])
        shape = two(module.EFFECTS[e](d, rng), k)
        if size == 0:
            sizes[e] = 0.0
            continue
        scaled, kept[e] = sized(sign * shape, d["model"], d["groups"], size * sd)
        sizes[e] = rms(outside(d["model"], scaled[:, 0], d["groups"])) / sd
        add = add + scaled
    y = clean + err + add
    if noise == "rounded":
        for j in range(k):
            st = errors(noise, stream(kind, seed, "noise", noise, j), n, d["grow"],
                        d["noise_groups"], d["sd"][j], clean[:, j], d.get("plots"))[1]
            # errors already holds the rounding of the null; the display rounds the sum, so undo and redo
            y[:, j] = np.round((unrounded(kind, seed, noise, j, d) + add[:, j]) / st) * st
    columns = list(d["columns"])
    for j, name in enumerate(d["responses"]):
        columns.append((name, y[:, j], places(d["sd"][j])))
    return Table(kind=kind, seed=seed, noise=noise, effects=effects, csv=text(columns),
                 options=list(d["options"]), hidden=add[:, 0].copy(), error_sd=sd,
                 size=float(np.mean(list(sizes.values()))) if sizes else 0.0,
                 sizes=sizes, kept=kept, step=step)


def unrounded(kind, seed, noise, j, d):
    """Clean reading and its error before the display rounds it."""
    clean = d["clean"][:, j]
    rng = stream(kind, seed, "noise", noise, j)
    n = len(clean)
    e, _ = errors("white", rng, n, d["grow"], d["noise_groups"], 0.9 * d["sd"][j], clean, d.get("plots"))
    return clean + e
