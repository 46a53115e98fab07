"""Power at size 1, level 1 %, of the F test of somebody who knows the true column. python3 power.py [number of seeds, 20]"""
import os
import sys
import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
sys.dont_write_bytecode = True
sys.path.insert(0, os.path.dirname(HERE))
import fourteenth  # noqa: E402
from fourteenth import check  # noqa: E402


def parts(kind, t):
    """Response, everything that is no effect, and what whitens the rows (white noise; the error of a whole plot has a known share)."""
    c = check.read(t.csv)
    y, m, groups = check.what(kind, t, c)
    n = len(c[y])
    lab = t.lab
    if kind == "attitude":
        m = np.column_stack([m * (groups == k)[:, None] for k in np.unique(groups)])
    if kind == "general" and lab.replicates:
        m = np.column_stack([m] + [(lab.run == k).astype(float) for k in np.unique(lab.run)[1:]])
    w = None
    if kind == "whole_plots":
        v = (1 - lab.share ** 2) * np.eye(n) + lab.share ** 2 * (lab.plot[:, None] == lab.plot[None, :])
        w = np.linalg.inv(np.linalg.cholesky(v))
    return c[y], m, w


def main(seeds):
    g = np.random.default_rng(1)
    chi = g.standard_normal(40000)
    critical, good = {}, True
    for kind, mod in fourteenth.KINDS.items():
        for e in mod.EFFECTS:
            least, seen = 1.0, 0
            for seed in range(seeds):
                t = fourteenth.table(kind, [e], 100 + seed, 1.0)
                y, m, w = parts(kind, t)
                x = t.hidden / t.error_sd
                z = y / t.error_sd
                if w is not None:
                    m, x, z = w @ m, w @ x, w @ z
                u, s, _ = np.linalg.svd(m / np.sqrt(np.mean(m * m, axis=0)), full_matrices=False)
                q = u[:, s > 1e-10 * s[0]]
                df = len(z) - q.shape[1] - 1
                if df not in critical:
                    den = g.chisquare(df, 40000) / df
                    critical[df] = (np.quantile(chi ** 2 / den, 0.99), den)
                x = x - q @ (q.T @ x)
                z = z - q @ (q.T @ z)
                nc = x @ x
                cut, den = critical[df]
                least = min(least, float(np.mean((chi + np.sqrt(nc)) ** 2 / den > cut)))
                b = (x @ z) / nc
                seen += b * b * nc / (np.sum((z - b * x) ** 2) / df) > cut
            ok = least >= 0.9
            good &= ok
            print("%-12s %-22s least power over seeds %.3f, found %d of %d%s" % (kind, e, least, seen, seeds, "" if ok else "   TOO LOW"))
    print("passed" if good else "FAILED")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 20)
