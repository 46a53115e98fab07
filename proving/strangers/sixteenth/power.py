"""Power of an F test at 1 % by somebody who knows the cause's column, at size 1 and in white noise. From the parent
folder: python -m FOLDER.power [seeds, 20]"""

import math
import sys

import numpy as np

from . import KINDS, table
from .check import columns, design

LEVEL = 0.01
NORMAL = np.vectorize(lambda v: 0.5 * math.erfc(-v / math.sqrt(2)))


def beyond(cut, shift, free):
    """Chance that |z + shift| / sqrt(chi2 / free) is more than cut: by the sum over the density of chi."""
    chi = math.sqrt(free) + np.linspace(-6, 6, 401)
    chi = chi[chi > 0]
    weight = np.exp((free - 1) * np.log(chi / math.sqrt(free)) - (chi * chi - free) / 2)
    edge = cut * chi / math.sqrt(free)
    return float((weight / weight.sum()) @ (NORMAL(-edge - shift) + NORMAL(shift - edge)))


def critical(free):
    low, high = 2.0, 5.0
    for _ in range(30):
        mid = (low + high) / 2
        low, high = (mid, high) if beyond(mid, 0.0, free) > LEVEL else (low, mid)
    return high


def whitened(kind, got):
    """Model, cause and response in units of the error, with independent errors."""
    c = columns(got.csv)
    y, m, groups = design(kind, got.options, c)
    if kind == "attitude":
        m = np.hstack([np.where((groups == k)[:, None], m, 0.0) for k in np.unique(groups)])
    lab, w = got.lab, got.lab.world
    if kind == "general" and w.way == "runs":
        m = np.column_stack([m, *((w.run == k).astype(float) for k in range(1, int(w.run[-1]) + 1))])
    all_ = np.column_stack([m / np.linalg.norm(m, axis=0), got.hidden / got.error_sd, c[y] / got.error_sd])
    if lab.share:
        together = lab.block[:, None] == lab.block
        root = np.linalg.cholesky((1 - lab.share**2) * np.eye(len(lab.t)) + lab.share**2 * together)
        all_ = np.linalg.solve(root, all_)
    return all_[:, :-2], all_[:, -2], all_[:, -1]


def main(seeds):
    cuts, failed = {}, []
    for kind, mod in KINDS.items():
        for name in mod.EFFECTS:
            least, hits, kept = 1.0, 0, []
            for seed in range(500, 500 + seeds):
                got = table(kind, name, seed, 1.0)
                kept.append(got.kept[name])
                m, x, y = whitened(kind, got)
                q, s, _ = np.linalg.svd(m, full_matrices=False)
                q = q[:, s > 1e-9 * s[0]]
                x, y = x - q @ (q.T @ x), y - q @ (q.T @ y)
                free = len(y) - q.shape[1] - 1
                if free not in cuts:
                    cuts[free] = critical(free)
                length = float(np.linalg.norm(x))
                least = min(least, beyond(cuts[free], length, free))
                along = float(x @ y) / length
                hits += abs(along) > cuts[free] * math.sqrt(max(float(y @ y) - along**2, 0.0) / free)
            if least < 0.9:
                failed.append(name)
            row = (kind, name, least, hits, seeds, min(kept), max(kept))
            print("%-11s %-20s least power %.4f, seen in %d of %d; left by the model: %.3f to %.3f of it" % row)
    print("too low: " + ", ".join(failed) if failed else "all have 90 % or more")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 20)
