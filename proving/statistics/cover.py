"""Do the intervals that `rig fit --traced` keeps hold the truth, whichever of several causes was named?

Dry runs of the attitude laboratory with one x sensor, each seed another noise: offset b and sensitivity S of the
calibration that is kept, against those of the world; with the interval of the cause that was named, and with the one
that covers every cause that the data cannot separate.
"""

from __future__ import annotations

import tempfile
from collections import Counter
from functools import partial
from pathlib import Path

import numpy as np

from proving.frame import Figures, Part, Results, Study
from proving.ledger import Result
from proving.statistics.confirm import NO_ROLL
from proving.statistics.dry_runs import Truth, one_sensor
from rig.by_kind import fit_table
from rig.tables.table_of_run import run_table

OFFSET_V, S_V = 0.0123, 5.02
SENSOR: Truth = {
    "sensors": {"x": {"offset_V": OFFSET_V, "sensitivity_V_per_g": S_V, "coning_deg": 0.21, "azimuth_deg": 90.0}}
}
"""In the plane of pitch, so that S of a run without roll is the sensor's own."""
NARROW: Truth = {"type": "D", "pitch_deg": np.linspace(-30.0, 30.0, 25).tolist(), "roll_deg": [0.0]}
DESIGNS = {"+-30 deg": NARROW, "+-180 deg": NO_ROLL}
BACKLASH: Truth = {"backlash": {"pitch_arcsec": 10.0}}
CUBE: Truth = {"third_order": {"ug_per_g3": 200.0}}
FALLING: Truth = {"third_order": {"ug_per_g3": -200.0}}
WORLDS: dict[str, Truth] = {
    "nothing": {},
    "backlash": BACKLASH,
    "cube": CUBE,
    "cube that falls": FALLING,
    "backlash, cube": BACKLASH | CUBE,
    "backlash, cube that falls": BACKLASH | FALLING,
    "pads": {"isolation_pad": {"pitch_compliance_deg_per_g": 1.5e-3}},
    "square": {"second_order": {"ug_per_g2": 100.0}},
}
TRUTHS = {"S": ("S_V", S_V), "b": ("b_V", OFFSET_V)}


def cover() -> Study:
    """Intervals that hold the truth, as named and covering all causes."""
    cells = [(design, world) for design in DESIGNS for world in WORLDS]
    return Study({f"{design}, {world}": partial(_kept, design=design, world=world) for design, world in cells}, _held)


def _kept(seed: int, design: str, world: str) -> Result:
    with tempfile.TemporaryDirectory() as folder:
        table = run_table(one_sensor(WORLDS[world], SENSOR, seed, Path(folder), DESIGNS[design]))
        result = fit_table(table, traced=True).to_json()
    one = result["kept"].get("x_V", {"effects": (), "parameters": result["sensors"]["x_V"]["parameters"]})
    inside = {}
    for name, (parameter, truth) in TRUTHS.items():
        row = one["parameters"][parameter]
        low, high = row["interval95"]
        least, most = row.get("interval95_as_named", (low, high))
        inside[name] = [bool(least <= truth <= most), bool(low <= truth <= high)]
    return {"named": ", ".join(one["effects"]) or "nothing", "inside": inside}


def _held(results: Results) -> Figures:
    counts: Figures = {}
    for name in TRUTHS:
        narrow, covered = np.sum([one["inside"][name] for one in results], axis=0).tolist()
        counts[name] = {"as named": narrow, "covered": covered}
    return {**counts, "of": len(results), "found": dict(Counter(one["named"] for one in results))}


PARTS = {"": Part(cover, 6)}
