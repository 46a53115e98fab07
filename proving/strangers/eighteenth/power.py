"""Power of a test at 1 % by somebody who knows the cause's column, at size 1 in white noise. From the parent folder:
python -m FOLDER.power [laboratories, 20]
"""

import sys

import numpy as np

from . import KINDS, table
from .check import design, read
from .common import Array, Table

LEVEL, DRAWS = 0.01, 40000


def t_power(shift: float, free: int) -> tuple[float, float]:
    """The two-sided t test's critical value, and its power for a shift in standard errors; both by the same draws."""
    g = np.random.default_rng(free)
    z, scale = g.standard_normal(DRAWS), np.sqrt(g.chisquare(free, DRAWS) / free)
    cut = float(np.quantile(np.abs(z) / scale, 1 - LEVEL))
    return cut, float(np.mean(np.abs(z + shift) / scale > cut))


def beyond_model(kind: str, got: Table) -> tuple[Array, Array, int]:
    """Cause and response in standard deviations, without the declared model and common errors; degrees of freedom."""
    c, lab = read(got.csv), got.lab
    model: Array
    both: Array
    y, model, groups = design(kind, got.options, c)
    if kind == "attitude":
        model = np.hstack([model * (groups == k)[:, None] for k in np.unique(groups)])
    elif kind == "general" and lab.world.roles == "runs":
        model = np.column_stack([model, lab.world.run[:, None] == np.unique(lab.world.run)[1:]])
    both = np.column_stack([got.hidden, c[y]]) / lab.outputs[0].sd
    model = model / np.linalg.norm(model, axis=0)
    if lab.block is not None:
        cov = (1 - lab.share) * np.eye(len(both)) + lab.share * (lab.block[:, None] == lab.block)
        root = np.linalg.cholesky(cov)
        model, both = np.linalg.solve(root, model), np.linalg.solve(root, both)
    q, s, _ = np.linalg.svd(model, full_matrices=False)
    q = q[:, s > 1e-9 * s[0]]
    both = both - q @ (q.T @ both)
    return both[:, 0], both[:, 1], len(both) - q.shape[1] - 1


def main(laboratories: int) -> None:
    """The least power of each cause, and how often it is seen in its tables."""
    low = []
    for kind, module in KINDS.items():
        for name in module.EFFECTS:
            powers, seen, left = [], 0, []
            for seed in range(700, 700 + laboratories):
                got = table(kind, name, seed, 1.0)
                x, y, free = beyond_model(kind, got)
                length = float(np.linalg.norm(x))
                cut, power = t_power(length, free)
                along = float(x @ y) / length
                seen += abs(along) > cut * np.sqrt((y @ y - along**2) / free)
                powers.append(power)
                left.append(got.left[name])
            if min(powers) < 0.9:
                low.append(name)
            print(
                f"{kind:11} {name:22} power {min(powers):.4f} or more; seen in {seen} of {laboratories};"
                f" the model leaves {min(left):.3f} to {max(left):.3f}"
            )
    print(f"too low: {', '.join(low)}" if low else "all have 90 % or more")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 20)
