"""Verdicts of the trace about laws that are a little shifted (proving/truth/laws.py), and about tables without a fault.

A law counts where the declared formula misses it by more than the noise: by more than one sd of it, rms over the rows.
What is left of it beside the effects found, and beside rows that are said to be gross errors, is in the same unit. A
verdict is blind where it is "nothing to add" or "explained" with more than one sd left.
"""

from __future__ import annotations

from collections import Counter
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from proving.frame import Figures, Part, Results, Study, pooled
from proving.ledger import Result
from proving.truth.laws import Law, drawn, laws
from proving.truth.table import Lab, options, simulate
from rig.fitter.trace.engine.judge import TableJudge
from rig.procedures.general.column_roles import Roles, roles_of
from rig.procedures.general.trace import trace_general
from rig.procedures.general.trace.run import problem_of
from rig.procedures.general.trace.together import together
from rig.procedures.tables.table import Table

LEFT_SD = 1.0
"""Part of the truth beyond a model, rms over sd, from which on it counts."""
SHAPES: dict[str, Lab] = {
    "8 rows": Lab(8),
    "12 rows": Lab(12, 2),
    "20 rows": Lab(20, 2),
    "40 rows, sorted": Lab(40, 2, design="rising"),
    "56 rows, sweeps": Lab(56, 3, design="sweeps"),
    "80 rows": Lab(80, 4),
    "400 rows": Lab(400, 4),
    "60 rows, sd grows five times": Lab(60, 2, growing=5.0),
    "200 rows, sd grows ten times": Lab(200, 4, growing=10.0),
    "60 rows, outliers 3 %": Lab(60, 2, outliers=0.03),
    "100 rows, AR 0.7": Lab(100, 4, ar=0.7, clock=True),
    "100 rows, walk to 3 sd": Lab(100, 4, walk=3.0, clock=True),
    "60 rows, whole plots": Lab(60, 3, plots=10),
    "60 rows, replications": Lab(60, 3, repeats=3),
}


def verdicts() -> Study:
    """The whole trace of each law."""
    cases = {number: partial(judged, law) for number, law in laws().items()}
    return Study(cases, _counted, pooled(_counted))


def clean() -> Study:
    """The shape of all columns jointly, in tables whose declared model is right."""
    return Study({name: partial(_asked, lab) for name, lab in SHAPES.items()}, _alarms, pooled(_alarms))


def judged(law: Law, seed: int) -> Result:
    """The verdict of the trace of a law, and what is left of it in sd: beside the declared model, and at the end."""
    columns, true, sd = drawn(law, seed)
    told = Roles(response="y", formula=law.declared)
    found = trace_general(roles_of(Table("law", columns, True, {}), told)[0])
    problem, chosen = found.search.judge.problem, found.search.chosen
    return {
        "verdict": found.verdict,
        "declared": _left(true, problem.declared) / sd,
        "left": _left(true, problem.model(chosen)) / sd,
    }


def blind(result: Result) -> bool:
    """Whether a verdict passes over what is left of a law; see above."""
    return result["verdict"] in ("nothing to add", "explained") and result["left"] > LEFT_SD


def _left(true: NDArray[np.float64], model: NDArray[np.float64]) -> float:
    """Rms of what columns (n, k) leave of the truth (n,)."""
    scaled = model / np.linalg.norm(model, axis=0)
    return float(np.sqrt(np.mean((true - scaled @ np.linalg.lstsq(scaled, true, rcond=None)[0]) ** 2)))


def _counted(results: Results) -> Figures:
    seen = [one for one in results if one["declared"] > LEFT_SD]
    verdict: dict[str, Any] = dict(Counter(one["verdict"] for one in seen))
    wrong = [one for one in seen if blind(one)]
    return {
        "laws": len(seen),
        **verdict,
        "blind": len(wrong),
        "most left": max((o["left"] for o in wrong), default=0.0),
    }


def _asked(lab: Lab, seed: int) -> Result:
    columns = simulate(lab, seed)
    data = roles_of(Table("clean", columns, True, {}), Roles(**options(lab)))[0]
    return {"alarm": together(TableJudge(problem_of(data)), (), data) is not None}


def _alarms(results: Results) -> Figures:
    return {"tables": len(results), "alarms": sum(one["alarm"] for one in results)}


PARTS = {"verdicts": Part(verdicts, 1), "clean": Part(clean, 25, 1000)}
