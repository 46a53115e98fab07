"""Hidden error sources for a calibration tracer: table(kind, effects, seed, size, noise) makes one run."""
from dataclasses import dataclass, field

import numpy as np

from . import attitude, general, whole_plots
from .common import rng_of, seen, solve

KINDS = {"attitude": attitude, "whole_plots": whole_plots, "general": general}


@dataclass
class Made:
    csv: str            # text of the table
    columns: dict       # name -> array, as written
    options: list       # command line options (general only)
    size: float         # achieved; of a pair the one farther from what was asked; 0 for a null
    hidden: np.ndarray  # (rows,) what the effects add to the first response, in its unit
    sd: float = 0.0     # sd of the error of a single row of the first response (nominal)
    sizes: tuple = ()   # achieved, one per effect
    parts: dict = field(default_factory=dict)  # name -> (rows,) share of hidden


def _try(mod, kind, effects, seed, size, attempt):
    """One laboratory; None if an effect would not be seen in it."""
    needs = {}
    for name in effects:
        needs.update(mod.EFFECTS[name].needs)
    lab = mod.laboratory(rng_of("lab", kind, effects, seed, attempt), needs)
    shares, sizes = [], []
    for name in effects:
        def physics(k, name=name):
            h = mod.EFFECTS[name](lab, rng_of("effect", kind, name, seed, attempt), k)
            return h.reshape(lab.n, -1)
        k = solve(lambda k: mod.ruler(lab, physics(k)[:, 0])[1], size)
        if k is None or k > 30:   # out of reach, or only with an implausible constant
            return None
        h = physics(k)
        r, s = mod.ruler(lab, h[:, 0])
        if not seen(h[:, 0], r):
            return None
        shares.append(h)
        sizes.append(s)
    return lab, shares, sizes


def table(kind, effects, seed, size, noise="white"):
    mod, effects = KINDS[kind], tuple(effects)
    for attempt in range(200):
        got = _try(mod, kind, effects, seed, size, attempt)
        if got:
            break
    else:
        raise RuntimeError(f"no laboratory shows {effects} (seed {seed})")
    lab, shares, sizes = got
    error = mod.errors(lab, mod.NOISES[noise], rng_of("noise", kind, effects, seed, noise))
    y = lab.truth + error
    for h in shares:
        y = y + h
    columns = dict(lab.columns)
    for j, name in enumerate(lab.responses):
        columns[name] = np.round(y[:, j], lab.decimals)
    rows = zip(*[[str(v) for v in c.tolist()] for c in columns.values()])
    csv = "\n".join([",".join(columns)] + [",".join(r) for r in rows]) + "\n"
    parts = {name: h[:, 0] for name, h in zip(effects, shares)}
    hidden = sum(parts.values()) if parts else np.zeros(lab.n)
    worst = max(sizes, key=lambda s: abs(s - size)) if sizes else 0.0
    return Made(csv, columns, list(lab.options), float(worst), hidden, float(mod.ruler(lab, hidden, sd=True)),
                tuple(float(s) for s in sizes), parts)
