"""Fractions of simulated nights with the paper's isolation pads: how often they say what the whole night says.

The bench is proving/truth/attitude.py: 1.5e-4 deg of scatter, pads so soft that sigma_bias of the x sensor is the
paper's 3.7e-4 deg. Beside them figures of NASA/TP-1999-209835: Table 2, sections 9.2.2 to 9.3.4.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from proving.frame import Figures, Part, Results, Study
from proving.ledger import Result
from proving.truth.attitude import D1, Bench, simulate
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.fractions_compared import compare_fractions
from rig.procedures.tables.table import Table

PADS = replace(Bench(), compliance={("y", "x"): 1.5e-3})
"""sigma_prec 1.5e-4 deg, and isolation pads that give so much that sigma_bias of x is the paper's 3.7e-4 deg."""
NAMES = (
    "T_bias of all points",
    "of the part",
    "residuals of all points, part's coefficients over their own",
    "the former over sigma_E of the part",
    "interval over that of all points",
    "of all points within the part's 95 %",
)
CASES = {
    "13 x 25 over +-30 deg, 53 points": (D1(30, 13, 25), "53", (26.2, 36.2, 1.005, 0.911)),
    "37 x 13 over +-180 deg, 73 points": (D1(180, 37, 13), "73", (23.9, 27.3, 1.002, 0.995)),
    "37 x 13 over +-180 deg, tumble": (D1(180, 37, 13), "tumble", (23.9, 85.0, 2.54, 2.40)),
}


def table_of(data: AttitudeData, **changed: Any) -> Table:
    """A night as the table it would be read from."""
    columns = {
        "replicate": data.replicate,
        "order": data.order,
        "elapsed_s": data.elapsed_s,
        "pitch_deg": data.pitch_deg,
        "roll_deg": data.roll_deg,
        "sensor_temperature_degC": data.sensor_temperature_degC,
        **data.outputs,
    }
    return Table("night.csv", {n: np.asarray(v, float) for n, v in columns.items()}, True, {}, **changed)


def fractions() -> Study:
    """Of the x sensor: medians, and in how many nights the part finds lack of fit and keeps residuals within 2 %."""
    return Study({name: partial(_compared, case=name) for name in CASES}, _medians)


def _compared(seed: int, case: str) -> Result:
    plan, which, paper = CASES[case]
    found = compare_fractions(table_of(simulate(PADS, plan, seed)[0]), which)
    whole, part = (side["sensors"]["x_V"] for side in (found["full"], found["fractions"][0]))
    values = (
        whole["T_bias"],
        part["T_bias"],
        part["residual_deg"] / whole["residual_deg"],
        part["residual_deg"] / part["sigma_E_deg"],
        part["interval_ratio"],
        part["coverage95"],
    )
    figures = dict(zip(NAMES, map(float, values), strict=True))
    return {"figures": figures, "paper": paper, "found": bool(part["T_bias"] > part["F_bias_95"])}


def _medians(results: Results) -> Figures:
    medians = {name: float(np.median([one["figures"][name] for one in results])) for name in NAMES}
    return {
        **medians,
        "the paper": results[0]["paper"],
        "lack of fit found": sum(one["found"] for one in results),
        "residuals within 2 %": sum(one["figures"][NAMES[2]] < 1.02 for one in results),
        "of": len(results),
    }


PARTS = {"": Part(fractions, 100)}
