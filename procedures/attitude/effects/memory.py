"""Effects of the history of head and sensor: hysteresis, creep, and an axis that is not yet at rest."""

from __future__ import annotations

import numpy as np

from rig.fitter.effects.entry import Alias, Signed
from rig.fitter.effects.sizes import micro, relative
from rig.procedures.attitude.effects.effect import Effect, Term, fixed
from rig.procedures.attitude.effects.head import pitch_error, roll_error

_FLAT = "read both sides where the output hardly depends on the angle: backlash is gone there, hysteresis is not"
_AT_REST = Signed("share of its last move", +1, "an axis that is beyond where it was sent, by an overshoot")


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
    cause="the sensor still creeps after the acceleration at the previous point",
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
    needs=("pitch sides",),
    dynamic=True,
)

SETTLING_PITCH = Effect(
    name="settling-pitch",
    cause="the pitch axis has not come to rest: it still lags by a share of its last move",
    source="pitch axis",
    scope="package",
    stratum="point-by-replication",
    unit="deg/deg",
    size=micro("ppm of the move"),
    against="elapsed_s",
    terms=fixed(pitch_error("(previous-present)", lambda s: s.data.previous_pitch_deg - s.data.pitch_deg)),
    signed=_AT_REST,
    separate_by="settle twice as long at some points after large moves of pitch",
    usual_size="1e-5 of the move",
    needs=("pitch sides",),
)

SETTLING_ROLL = Effect(
    name="settling-roll",
    cause="the roll axis has not come to rest: it still lags by a share of its last move",
    source="roll axis",
    scope="package",
    stratum="point-by-replication",
    unit="deg/deg",
    size=micro("ppm of the move"),
    against="elapsed_s",
    terms=fixed(roll_error("(previous-present)", lambda s: s.data.previous_roll_deg - s.data.roll_deg)),
    signed=_AT_REST,
    separate_by="settle twice as long at some points after large moves of roll",
    usual_size="1e-5 of the move",
    known_aliases={
        "backlash-roll": Alias(
            "where all steps of roll are equally large",
            "reach some points by a step of another size from the same side: backlash stays, settling grows with it",
        )
    },
    needs=("roll sides",),
)
