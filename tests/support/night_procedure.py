"""The procedure of one night, for tests of run lists: 2886 points."""

from __future__ import annotations

from typing import Any

from rig.procedures.attitude.settings import PitchRollProcedure

NIGHT = {
    "kind": "pitch-roll",
    "name": "night",
    "seed": 7,
    "replications": 6,
    "design": {"type": "D1", "pitch_max_deg": 180, "pitch_count": 37, "roll_count": 13},
}


def procedure(**changes: Any) -> PitchRollProcedure:
    return PitchRollProcedure.model_validate({**NIGHT, **changes})
