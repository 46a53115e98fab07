"""Power at size 1, level 1 %, of an F test by somebody who knows the true column. python3 power.py [seeds, 20]"""

import os
import sys

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
sys.dont_write_bytecode = True
sys.path.insert(0, os.path.dirname(HERE))
import fifteenth  # noqa: E402
from fifteenth import check  # noqa: E402


def parts(kind, t):
    """Response, all that is no effect, and what whitens the rows (white noise; the share of a whole plot is known)."""
    c = check.read(t.csv)
    y, m, groups = check.what(kind, t, c)
    lab = t.lab
    if kind == "attitude":
        m = np.column_stack([m * (groups == k)[:, None] for k in np.unique(groups)])
    if kind == "general" and lab.mode == "replicate":
        m = np.column_stack([m, *[(lab.run == k).astype(float) for k in range(1, lab.runs)]])
    share = 0.0 if kind == "attitude" else lab.share
    if not share:
        return c[y], m, None
    group = lab.plot if kind == "whole_plots" else lab.batch
    v = (1 - share**2) * np.eye(lab.n) + share**2 * (group[:, None] == group[None, :])
    return c[y], m, np.linalg.inv(np.linalg.cholesky(v))


def main(seeds):
    g = np.random.default_rng(1)
    z0 = g.standard_normal(40000)
    critical, good = {}, True
    for kind, mod in fifteenth.KINDS.items():
        for e in mod.EFFECTS:
            least, seen, kept = 1.0, 0, []
            for seed in range(100, 100 + seeds):
                t = fifteenth.table(kind, [e], seed, 1.0)
                kept.append(t.kept[e])
                z, m, w = parts(kind, t)
                x, z = t.hidden / t.error_sd, z / t.error_sd
                if w is not None:
                    m, x, z = w @ m, w @ x, w @ z
                u, s, _ = np.linalg.svd(m / np.sqrt(np.mean(m * m, axis=0)), full_matrices=False)
                u = u[:, s > 1e-10 * s[0]]
                df = len(z) - u.shape[1] - 1
                if df not in critical:
                    den = g.chisquare(df, 40000) / df
                    critical[df] = (np.quantile(z0**2 / den, 0.99), den)
                cut, den = critical[df]
                x = x - u @ (u.T @ x)
                z = z - u @ (u.T @ z)
                nc = x @ x
                least = min(least, float(np.mean((z0 + np.sqrt(nc)) ** 2 / den > cut)))
                b = (x @ z) / nc
                seen += b * b * nc / (np.sum((z - b * x) ** 2) / df) > cut
            good &= least >= 0.9
            print(
                "%-12s %-16s least power %.3f, found %d of %d; the model leaves %.3f to %.3f of it%s"
                % (kind, e, least, seen, seeds, min(kept), max(kept), "" if least >= 0.9 else "   TOO LOW"),
                flush=True,
            )
    print("passed" if good else "FAILED")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 20)
