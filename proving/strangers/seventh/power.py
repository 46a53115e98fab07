"""Power of the F test (1 %) by someone who knows the true column, at size 1. python3 power.py [seeds, 12]

The error's covariance is taken as known (white, rows AR, batches AR); for whole plots and shared errors the power stated is the greater of two that do not
need it: within batches only, and all with no more degrees of freedom than there are batches."""
import os
import sys

import numpy as np

sys.dont_write_bytecode = True
HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.dirname(HERE))
import seventh  # noqa: E402

RNG = np.random.default_rng(7)
Z, G = RNG.standard_normal(40000), {}


def power(lam, dof):
    if dof < 2:
        return 0.0
    if dof not in G:
        chi = RNG.chisquare(dof, 40000) / dof
        G[dof] = chi, np.quantile(RNG.standard_normal(400000) ** 2 / (RNG.chisquare(dof, 400000) / dof), 0.99)
    chi, crit = G[dof]
    return float(np.mean((Z + np.sqrt(lam)) ** 2 / chi > crit))


def blocks(lab):
    """Declared model with a block for every group."""
    ks = np.unique(lab.groups)
    return np.column_stack([lab.model * (lab.groups == k)[:, None] for k in ks])


def cov(lab, noise):
    n, b = lab.n, lab.batches
    same = b[:, None] == b[None, :]
    own = np.eye(n)
    share = lab.shared
    common = same.astype(float)
    if noise == "ar_rows":
        own = 0.6 ** np.abs(np.subtract.outer(np.arange(n), np.arange(n))) * same
    if noise == "ar_batches":
        share = max(share, 0.3)
        common = 0.5 ** np.abs(np.subtract.outer(b, b)).astype(float)
    return (1 - share) * own + share * common, share


def lam(m, h, v):
    c = np.linalg.cholesky(v)
    a, y = np.linalg.solve(c, m), np.linalg.solve(c, h)
    q, s, _ = np.linalg.svd(a / np.sqrt(np.mean(a * a, axis=0) + 1e-300), full_matrices=False)
    q = q[:, s > 1e-9 * s[0]]
    w = y - q @ (q.T @ y)
    w = w - q @ (q.T @ w)
    return float(w @ w), q.shape[1]


def main(seeds):
    worst = {}
    for noise, upto in (("white", seeds), ("ar_rows", min(seeds, 6)), ("ar_batches", min(seeds, 6))):
        for kind, module in seventh.KINDS.items():
            for seed in range(upto):
                lab = module.laboratory(seed)
                m = blocks(lab)
                v, share = cov(lab, noise)
                nb = len(np.unique(lab.batches))
                for e in module.EFFECTS:
                    t = seventh.table(kind, [e], seed, 1.0)
                    h = t.hidden / t.error_sd
                    l, p = lam(m, h, v)
                    if share == 0 or kind == "attitude":
                        got = power(l, lab.n - p - 1)
                    else:
                        d = (lab.batches[:, None] == np.unique(lab.batches)).astype(float)
                        lw, pw = lam(np.column_stack([m, d]), h, v)
                        got = max(power(lw, lab.n - pw - 1), power(l, nb - (6 if kind == "whole_plots" else 1) - 1))
                    key = noise, kind, e
                    worst[key] = min(worst.get(key, (2, 0, 0)), (got, seed, l))
    for (noise, kind, e), (p, seed, l) in worst.items():
        print("%-10s %-12s %-20s least power %.3f (seed %d, noncentrality %.0f)%s" % (noise, kind, e, p, seed, l, "" if p >= 0.9 else "  BELOW 0.9"))


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 12)
