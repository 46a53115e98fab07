"""What a sensor remembers of where it was before: hysteresis by the side of approach, and creep."""

from __future__ import annotations

import numpy as np

from fitter.effects.effect import Alias, Effect, Term, fixed
from fitter.effects.sizes import micro, relative

_FLAT = "read both sides where the output hardly depends on the angle: backlash is gone there, hysteresis is not"


HYSTERESIS_PITCH = Effect(
    name="hysteresis-pitch",
    cause="the output depends on whether the pitch was reached from below or from above, by volts and not by an angle",
    source="sensor",
    scope="sensor",
    stratum="point-by-replication",
    unit="V",
    size=micro("uV from side to side"),
    against="pitch_deg",
    terms=fixed(Term("pitch side/2", lambda scene, _sensor: scene.data.pitch_side / 2)),
    separate_by=_FLAT,
    usual_size="1e-5 of the range",
    known_aliases={},
    needs=("pitch sides",),
)

HYSTERESIS_ROLL = Effect(
    name="hysteresis-roll",
    cause="the output depends on whether the roll was reached from below or from above, by volts and not by an angle",
    source="sensor",
    scope="sensor",
    stratum="point-by-replication",
    unit="V",
    size=micro("uV from side to side"),
    against="roll_deg",
    terms=fixed(Term("roll side/2", lambda scene, _sensor: scene.data.roll_side / 2)),
    separate_by=_FLAT,
    usual_size="1e-5 of the range",
    known_aliases={"backlash-roll": Alias("over a small range of roll", _FLAT)},
    needs=("roll sides",),
)

CREEP = Effect(
    name="creep",
    cause="the sensor still gives way to the acceleration it was under at the point before",
    source="sensor",
    scope="sensor",
    stratum="point-by-replication",
    unit="V/g",
    size=relative("ppm of the change"),
    against="elapsed_s",
    terms=fixed(
        Term(
            "previous-present gravity",
            lambda scene, sensor: np.asarray(
                (scene.g_before - scene.g) @ scene.axes[sensor] / np.linalg.norm(scene.axes[sensor])
            ),
        )
    ),
    separate_by="wait twice as long before reading at some points after large moves",
    usual_size="1e-5 of the change",
    known_aliases={},
    needs=("pitch sides",),
)
