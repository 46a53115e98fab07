"""The evening question: when will it finish, and how sure is that? Answered by a rehearsal.

The first points of the run list are run dry, on twins with the bench file's own speeds and settings, and the rest
is extrapolated. What a rehearsal cannot know (repeats, retries, an interruption) is added as a stated allowance.
"""

from __future__ import annotations

import itertools
import statistics
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fitter import attitude_columns, variance_function
from procedures import RunList
from rig.controller import Plan, start_run
from rig.engine.run_file import RunReader
from rig.engine.session import Outcome, Progress, Signals
from rig.errors import RigError

ALLOWANCE = 0.05
"""Share added for repeats, retries and one short interruption."""


@dataclass(frozen=True)
class Forecast:
    """How long a run will take, in bench seconds.

    Attributes:
        preparation_s: until the first point is under way: set-up, homing, environment.
        point_s: mean of one point: move, settle, measure.
        point_sd_s: its standard deviation from point to point.
        total_s: all of it, with nothing going wrong.
        latest_s: with the allowance for what may go wrong.
        rehearsed: on how many points this stands.

    """

    preparation_s: float
    point_s: float
    point_sd_s: float
    total_s: float
    latest_s: float
    rehearsed: int


PRECISION_AT_DEG = (0.0, 10.0, 30.0, 60.0, 90.0)
"""Pitch angles at which `rig plan` says how precise the calibration will be; those inside the design are shown."""


def precision(run_list: RunList, sigma_deg: float) -> list[dict[str, float]]:
    """Predicted precision of a sensor's calibrated output at a few pitch angles (eqs. 52 and 72), roll 0.

    Args:
        run_list: every observation that will be made.
        sigma_deg: expected standard error of one observation.

    Returns:
        One row an angle: pitch_deg, sd_deg (of the calibrated output), interval95_deg (half-width).

    """
    setpoints = np.array([p.setpoints for p in run_list.points])
    roll = bool(np.ptp(setpoints[:, 1]))
    angles = [a for a in PRECISION_AT_DEG if a <= np.abs(setpoints[:, 0]).max()]
    design = attitude_columns(setpoints[:, 0], setpoints[:, 1], roll=roll)
    at = attitude_columns(np.array(angles), np.zeros(len(angles)), roll=roll)
    sd = sigma_deg * np.sqrt(variance_function(design, at))
    return [
        {"pitch_deg": a, "sd_deg": float(s), "interval95_deg": 1.96 * float(s)} for a, s in zip(angles, sd, strict=True)
    ]


def rehearse(plan: Plan, on_progress: Callable[[Progress], None], *, points: int = 400) -> Forecast:
    """Run the first `points` points dry and extrapolate.

    Raises:
        RigError: the rehearsal failed, which the run itself would too.

    """
    head = RunList(plan.run_list.factors, plan.run_list.points[:points], plan.run_list.seed)
    with tempfile.TemporaryDirectory(prefix="rig-rehearsal-") as folder:
        paths: list[Path] = []
        dry = replace(plan, run_list=head, dry=True, truth={})
        result = start_run(dry, Path(folder), signals=Signals(), announce=paths.append, on_progress=on_progress)
        if result.outcome is not Outcome.COMPLETE:
            raise RigError(f"a rehearsal on simulated instruments failed: {result.message}")
        with RunReader.open(paths[0]) as reader:
            ends = [record.elapsed_s for record in reader.records("observation")]
    steps = [b - a for a, b in itertools.pairwise(ends)] or [0.0]
    point = statistics.fmean(steps)
    preparation = max(0.0, ends[0] - point)
    total = preparation + len(plan.run_list) * point
    return Forecast(
        preparation_s=preparation,
        point_s=point,
        point_sd_s=statistics.pstdev(steps),
        total_s=total,
        latest_s=preparation + (total - preparation) * (1 + ALLOWANCE),
        rehearsed=len(ends),
    )
