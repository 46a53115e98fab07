"""Optimal designs beside pyoptex (BSD, coordinate exchange in Cython): ratio of criteria, and of processor time.

The peer has dependencies that the project does not want, so it is in no extra. In an environment of its own:

python -m venv peer && peer/bin/pip install numpy scipy pyoptex
PYTHONPATH=. peer/bin/python -m benchmarks.bench_designs

Each case is searched by both, the peer with as many random starts as take about our time, and at least ten. Both
designs are evaluated by one function that neither of them uses. A D-ratio above 1 means that ours has more information:
(|M| / |M of the peer|)^(1/p); an I-ratio above 1 that our mean variance is smaller.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from rig.fitter.designs import optimal

ETA = 1.0


@dataclass(frozen=True)
class Case:
    """A quadratic model of factors at -1, 0 and 1; the first `hard` of them in whole plots."""

    factors: int
    points: int
    hard: int = 0
    plots: int | None = None

    def __str__(self) -> str:
        plots = f" in {self.plots} whole plots, {self.hard} hard" if self.plots else ""
        return f"{self.points} points, {self.factors} factors{plots}"


CASES = (Case(2, 20), Case(3, 14), Case(2, 20, 1, 4), Case(3, 24, 1, 6), Case(4, 30, 2, 10), Case(5, 40, 1, 10))


def quadratic(points: np.ndarray) -> np.ndarray:
    x = np.asarray(points, float)
    k = x.shape[1]
    products = [x[:, i] * x[:, j] for i in range(k) for j in range(i + 1, k)]
    return np.column_stack([np.ones(len(x)), x, *products, x**2])


def judged(points: np.ndarray, plot: np.ndarray) -> tuple[float, float]:
    """log |M| and mean variance over the cube, with V written out."""
    z = plot[:, None] == np.unique(plot)
    v = np.eye(len(points)) + (ETA * z @ z.T if len(np.unique(plot)) < len(points) else 0.0)
    rows = quadratic(points)
    m = rows.T @ np.linalg.solve(v, rows)
    nodes, weights = np.polynomial.legendre.leggauss(3)
    mesh = np.stack([a.reshape(-1) for a in np.meshgrid(*[nodes] * points.shape[1])], axis=1)
    w = np.prod([a.reshape(-1) for a in np.meshgrid(*[weights / 2] * points.shape[1])], axis=0)
    region = quadratic(mesh)
    return np.linalg.slogdet(m)[1], float(np.trace(np.linalg.solve(m, region.T @ (region * w[:, None]))))


def ours(case: Case, criterion: str, seed: int) -> tuple[tuple[float, float], float]:
    began = time.process_time()
    made = optimal(
        [(-1, 0, 1)] * case.factors,
        quadratic,
        case.points,
        hard=range(case.hard),
        whole_plots=case.plots,
        eta=ETA,
        criterion=criterion,  # type: ignore[arg-type]
        seed=seed,
    )
    spent = time.process_time() - began
    plot = np.arange(case.points) if made.whole_plot is None else made.whole_plot
    return judged(made.points, plot), spent


def theirs(case: Case, criterion: str, tries: int, seed: int) -> tuple[tuple[float, float], float]:
    from pyoptex._seed import set_seed
    from pyoptex.doe.fixed_structure import Factor
    from pyoptex.doe.fixed_structure.splitk_plot import Plot, create_parameters, create_splitk_plot_design, default_fn
    from pyoptex.doe.fixed_structure.splitk_plot.metric import Dopt, Iopt
    from pyoptex.utils.model import model2Y2X, partial_rsm_names

    set_seed(seed)
    easy = Plot(level=0, size=case.points // (case.plots or 1))
    plots = [easy, Plot(level=1, size=case.plots, ratio=ETA)] if case.plots else [easy]
    names = [f"x{i}" for i in range(case.factors)]
    factors = [Factor(name, plots[-1] if i < case.hard else easy, type="continuous") for i, name in enumerate(names)]
    model = model2Y2X(partial_rsm_names(dict.fromkeys(names, "quad")), factors)
    metric = Dopt() if criterion == "D" else Iopt()
    parameters = create_parameters(factors, default_fn(factors, metric, model))
    began = time.process_time()
    table, _ = create_splitk_plot_design(parameters, n_tries=tries)
    spent = time.process_time() - began
    points = table[names].to_numpy(float)
    return judged(
        points, np.repeat(np.arange(case.plots or case.points), case.points // (case.plots or case.points))
    ), spent


def main() -> None:
    theirs(CASES[0], "D", 1, 0)  # compiles
    print(f"{'case':45} {'':3} ratio of criteria   ours, s   peer, s  starts of the peer")
    for case in CASES:
        terms = quadratic(np.zeros((1, case.factors))).shape[1]
        for criterion in "DI":
            ratios, own, other = [], [], []
            for seed in range(3):
                (d, i), spent = ours(case, criterion, seed)
                _, once = theirs(case, criterion, 10, seed)
                tries = int(np.clip(10 * spent / max(once, 1e-3), 10, 5000))
                (peer_d, peer_i), peer_spent = theirs(case, criterion, tries, seed)
                ratios.append(np.exp((d - peer_d) / terms) if criterion == "D" else peer_i / i)
                own.append(spent)
                other.append(peer_spent)
            shown = " ".join(f"{r:.4f}" for r in ratios)
            print(f"{case!s:45} {criterion:3} {shown}  {np.median(own):7.2f}  {np.median(other):8.2f}  {tries}")


if __name__ == "__main__":
    main()
