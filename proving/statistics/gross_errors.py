"""How often a clean table has a row named a gross error: docs/explanation/fits.md."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

from proving.frame import Figures, Part, Results, Study
from proving.ledger import Result
from proving.truth import attitude, whole_plot
from rig.fitter.arrays import FloatArray
from rig.fitter.gross import GrossErrors
from rig.procedures.attitude.gross import of_attitude
from rig.procedures.general.gross import of_table
from rig.procedures.pressure.fit import named_formula
from rig.procedures.pressure.gross import of_whole_plots

Tables = Callable[[int], Iterator[GrossErrors]]
FULL = named_formula("full", ())


def table(n: int, k: int, step: float = 0.0, growing: float = 0.0) -> Tables:
    """Normal errors of sd one about a model of k columns, rounded to `step`; sd 1 + `growing` x."""

    def look(seed: int) -> Iterator[GrossErrors]:
        rng = np.random.default_rng([n, k, seed])
        x = rng.uniform(0.0, 10.0, (n, k - 1))
        y: FloatArray = np.sum(x, axis=1) + (1.0 + growing * x[:, 0]) * rng.standard_normal(n)
        yield of_table(np.round(y / step) * step if step else y, np.column_stack([np.ones(n), x]))

    return look


def whole_plots(bench: whole_plot.Bench) -> Tables:
    """The design of 20 whole plots of 11 pressures."""

    def look(seed: int) -> Iterator[GrossErrors]:
        yield from of_whole_plots(whole_plot.simulate(bench, seed=seed), FULL).values()

    return look


def nights(**given: Any) -> Tables:
    """Three sensors, six replications of 9 x 9 points."""
    bench = attitude.Bench(**given)

    def look(seed: int) -> Iterator[GrossErrors]:
        yield from of_attitude(attitude.simulate(bench, attitude.D1(180, 9, 9), seed)[0]).values()

    return look


GROWING = whole_plot.Bench((whole_plot.Transducer(cubic=whole_plot.CUBIC),), subplot=whole_plot.GROWING)
CASES = {
    "12 rows, 2 coefficients": table(12, 2),
    "21 rows, 4 coefficients": table(21, 4),
    "60 rows, 3 coefficients": table(60, 3),
    "200 rows, 6 coefficients": table(200, 6),
    "60 rows rounded to 3 sd": table(60, 2, step=3.0),
    "60 rows rounded to 2 sd": table(60, 2, step=2.0),
    "60 rows rounded to 1 sd": table(60, 2, step=1.0),
    "120 rows, noise that grows": table(120, 2, growing=1.0),
    "whole plots": whole_plots(whole_plot.Bench()),
    "whole plots, cubic and noise that grows": whole_plots(GROWING),
    "attitude, pads and drift": nights(compliance={("y", "x"): 4e-3}, offset_sd=2.0),
    "attitude, noise of the angles": nights(sigma_deg=2e-5, jitter_deg=1e-3),
}


def gross_errors() -> Study:
    """Tables with a row named, and of how many."""
    return Study({name: partial(_named, case=name) for name in CASES}, _count, block=8)


def _named(seed: int, case: str) -> Result:
    return {"named": any(found.rows.size for found in CASES[case](seed))}


def _count(results: Results) -> Figures:
    return {"named": sum(one["named"] for one in results), "of": len(results)}


PARTS = {"": Part(gross_errors, 300)}
