"""Fine periods over an angle that no table of teeth has: a strain wave gear, a vernier, the lines of a scale."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rig.fitter import ties
from rig.fitter.arrays import FloatArray
from rig.fitter.trace.fine_periods import FEWEST, fine_period
from rig.fitter.trace.flexible import Block, Remainder
from rig.fitter.trace.lines import Line
from rig.fitter.trace.unmodelled import Seen
from rig.procedures.attitude.data import settings
from rig.procedures.attitude.effects.scene import Scene
from rig.procedures.attitude.trace.view import View


def fine_of(scene: Scene, view: View, seen: Seen) -> Line | None:
    """The clearest fine period of pitch or roll in all sensors together; None where the angles visited tell none.

    Args:
        scene: the run.
        view: what is left between points.
        seen: the same in the metric of its errors.
    """
    y, n = view.outputs.reshape(-1), len(scene.data)
    angles = {"pitch": (scene.data.pitch_deg, scene.per_pitch)}
    if scene.roll:
        angles["roll"] = (np.mod(scene.data.roll_deg, 360.0), scene.per_roll)
    found = []
    for name, (at, per_deg) in angles.items():
        if np.unique(settings(at)).size < FEWEST:
            continue
        slope = np.concatenate([per_deg(sensor) for sensor in scene.data.sensors])

        def ask(block: Block, slope: FloatArray = slope) -> Remainder | None:
            own = replace(block, columns=slope[:, None] * np.tile(block.columns, (len(view.outputs), 1)))
            return seen.remainder(own)

        found.append(fine_period(np.sum((slope * y).reshape(-1, n), axis=0), at, name, ask, "deg"))
    there = [one for one in found if one is not None]
    best = ties.least(there, key=lambda one: one.p) if there else None
    return None if best is None else replace(best, p=min(best.p * len(found), 1.0))


def turns_with(scene: Scene, angle: str, i: int) -> bool:
    """Whether sensor `i` shows an error of an angle, beside the others."""
    per_deg = scene.per_pitch if angle == "pitch" else scene.per_roll
    size = [float(np.linalg.norm(per_deg(sensor))) for sensor in scene.data.sensors]
    return size[i] > 0.1 * max(size)
