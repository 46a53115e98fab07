"""Do the intervals that `rig fit --traced` keeps hold the truth, whichever of several causes was named?

Dry runs of the attitude laboratory with one x sensor, each seed another noise: offset b and sensitivity S of the
calibration that is kept, against those of the world; with the interval of the cause that was named, and with the one
that covers every cause that the data cannot separate. Run it so: python -m benchmarks.cover_campaign [SEEDS]
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.confirm_campaign import NO_ROLL, first_run
from rig.closed_loop import fit_table
from rig.tables import run_table

OFFSET_V, S_V = 0.0123, 5.02
SENSOR = {"sensors": {"x": {"offset_V": OFFSET_V, "sensitivity_V_per_g": S_V, "coning_deg": 0.21, "azimuth_deg": 90.0}}}
"""In the plane of pitch, so that S of a run without roll is the sensor's own."""
NARROW = {"type": "D", "pitch_deg": np.linspace(-30.0, 30.0, 25).tolist(), "roll_deg": [0.0]}
DESIGNS = {"+-30 deg": NARROW, "+-180 deg": NO_ROLL}
BACKLASH, CUBE = {"backlash": {"pitch_arcsec": 10.0}}, {"third_order": {"ug_per_g3": 200.0}}
FALLING = {"third_order": {"ug_per_g3": -200.0}}
WORLDS = {
    "nothing": {},
    "backlash": BACKLASH,
    "cube": CUBE,
    "cube that falls": FALLING,
    "backlash, cube": BACKLASH | CUBE,
    "backlash, cube that falls": BACKLASH | FALLING,
    "pads": {"isolation_pad": {"pitch_compliance_deg_per_g": 1.5e-3}},
    "square": {"second_order": {"ug_per_g2": 100.0}},
}


def kept(effects, design, seed):
    """(named, in the interval as named, in the one that covers all) for S and b of one run."""
    with tempfile.TemporaryDirectory() as folder:
        table = run_table(first_run(effects, SENSOR, seed, Path(folder), design))
        result = fit_table(table, traced=True).to_json()
    one = result["kept"].get("x_V", {"effects": (), "parameters": result["sensors"]["x_V"]["parameters"]})
    out = []
    for name, truth in (("S_V", S_V), ("b_V", OFFSET_V)):
        row = one["parameters"][name]
        low, high = row["interval95"]
        narrow = row.get("interval95_as_named", (low, high))
        out.append((narrow[0] <= truth <= narrow[1], low <= truth <= high))
    return tuple(one["effects"]), out


def main(seeds):
    for design, points in DESIGNS.items():
        for world, effects in WORLDS.items():
            runs = [kept(effects, points, seed) for seed in range(seeds)]
            hits = np.sum([inside for _, inside in runs], axis=0)
            found = {", ".join(names) or "nothing": 0 for names, _ in runs}
            for names, _ in runs:
                found[", ".join(names) or "nothing"] += 1
            print(
                f"{design:>10}  {world:<26} S {hits[0, 0]} as named, {hits[0, 1]} of {seeds} covered; "
                f"b {hits[1, 0]}, {hits[1, 1]}; found: {found}",
                flush=True,
            )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 6)
