"""Simulated calibration tables with hidden physical causes. See README.md."""
from functools import lru_cache
import numpy as np
from . import attitude, whole_plots, general
from .common import Lab, rng, left, rms, draw, STEP

KINDS = {"attitude": attitude, "whole_plots": whole_plots, "general": general}


class Table:
    def __init__(self, csv, options, size, hidden, error_sd, kept, step, lab):
        self.csv, self.options, self.size, self.hidden = csv, options, size, hidden
        self.error_sd, self.kept, self.step, self.lab = error_sd, kept, step, lab


@lru_cache(maxsize=8)
def laboratory(kind, seed) -> Lab:
    return KINDS[kind].lab(seed)


def errors(lab, kind, seed, noise):
    """(rows, sensors) errors in units of each sensor's sd, and the step of rounding (0: none)."""
    g = rng(kind, seed, "noise", noise)
    out = np.empty(lab.clean.shape)
    share = getattr(lab, "share", 0.0)
    for s in range(out.shape[1]):
        e = draw(g, noise, lab.runs, lab.load)
        if share:
            p = g.standard_normal(int(lab.plot.max()) + 1)
            if noise == "plots_ar":
                for i in range(1, len(p)):
                    p[i] = 0.5 * p[i - 1] + np.sqrt(0.75) * p[i]
            e = share * p[lab.plot] + np.sqrt(1 - share ** 2) * e
        out[:, s] = e
    return out, (STEP * np.sqrt(1 - share ** 2) if noise == "rounded" else 0.0)


def table(kind, effects, seed, size, noise="white"):
    mod = KINDS[kind]
    if noise not in mod.NOISES:
        raise ValueError("unknown noise: %s" % noise)
    lab = laboratory(kind, seed)
    added = np.zeros(lab.clean.shape)
    kept = {}
    for e in effects:
        v = mod.EFFECTS[e](lab, rng(kind, seed, "effect", e))
        r = rms(left(lab.model, lab.groups, v[:, 0]))
        kept[e] = r / rms(v[:, 0] - np.mean(v[:, 0]))
        added = added + v * (size * lab.error[0] / r)
    e, step = errors(lab, kind, seed, noise)
    y = lab.clean + added + e * lab.error
    cols = dict(lab.columns)
    for s, name in enumerate(lab.responses):
        v = y[:, s]
        if step:
            v = np.round(v / (step * lab.error[s])) * (step * lab.error[s])
        digits = max(0, int(np.ceil(-np.log10(5e-4 * lab.error[s]))))
        cols[name] = ["%.*f" % (digits, x) for x in v]
    rows = zip(*cols.values())
    csv = ",".join(cols) + "\n" + "\n".join(",".join(r) for r in rows) + "\n"
    return Table(csv, list(lab.options), float(size) if len(effects) else 0.0, added[:, 0].copy(), float(lab.error[0]),
                 kept, float(step * lab.error[0]), lab)
