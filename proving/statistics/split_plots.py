"""How often nominal 95 % intervals of split plots hold, by the variance between whole plots over that within."""

from __future__ import annotations

from functools import partial

import numpy as np

from proving.frame import Figures, Part, Results, Study
from proving.ledger import Result
from proving.truth.split_plot import NAMES, WHOLE_PLOT, columns
from rig.fitter.split_plot import SplitPlotDesign

RATIOS = (0.0, 0.02, 0.05, 0.1, 0.3, 1.0, 10.0)
NEW = (2, 80)
"""Rows of the design at whose settings a new reading is predicted."""


def coverage(calibrations: int = 2000) -> Study:
    """Coefficients, and a new reading in a new whole plot at two settings; a seed is a stream of calibrations."""
    return Study({"intervals": partial(_held, calibrations=calibrations)}, _shares)


def _held(seed: int, calibrations: int) -> Result:
    rng = np.random.default_rng(seed)
    x, unit = columns(), np.eye(len(NAMES))
    design, at = SplitPlotDesign(x, WHOLE_PLOT, NAMES), x[list(NEW)]
    cells: Result = {}
    for ratio in RATIOS:
        between = np.sqrt(ratio)
        errors = rng.normal(size=(len(x), calibrations))
        batch = design.fit_many(errors + between * rng.normal(size=(20, calibrations))[WHOLE_PLOT])
        off = (
            batch.coefficients @ at.T
            - between * rng.normal(size=(calibrations, 1))
            - rng.normal(size=(calibrations, 1))
        )
        terms = np.sum(np.abs(batch.coefficients) < batch.interval(unit), axis=0)
        readings = np.sum(np.abs(off) < batch.interval(at, new_whole_plot=True, new_readings=1), axis=0)
        zero = int(batch.boundary.sum())
        cells[f"ratio {ratio:g}"] = {"zero": zero, "terms": terms.tolist(), "readings": readings.tolist()}
    return {"cells": cells, "of": calibrations}


def _shares(results: Results) -> Figures:
    """In percent."""
    of = sum(one["of"] for one in results)
    out: Figures = {}
    for cell in results[0]["cells"]:
        zero, terms, readings = (
            100.0 * np.sum([one["cells"][cell][name] for one in results], axis=0) / of
            for name in ("zero", "terms", "readings")
        )
        named = dict(zip(NAMES, terms.tolist(), strict=True))
        out[cell] = {"zero": float(zero), "terms": named, "new readings": readings.tolist()}
    return {**out, "of": of}


PARTS = {"coverage": Part(coverage, 10)}
