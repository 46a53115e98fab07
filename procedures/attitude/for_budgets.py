"""The evaluation of a run for its budgets, by the declared model or with the effects that a trace finds."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

from rig.fitter.errors import FitError
from rig.procedures.attitude.budget import AttitudeEvaluation
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.results import PITCH, ROLL
from rig.procedures.attitude.table import attitude_data
from rig.procedures.errors import DataError
from rig.procedures.tables.table import Table

if TYPE_CHECKING:
    from rig.procedures.attitude.fitted import Others
    from rig.procedures.attitude.infer.traced import Volts


def attitude_evaluation(
    table: Table,
    at: Sequence[Mapping[str, float]],
    *,
    temperature: bool | None,
    traced: bool = False,
    effects: tuple[Volts, Others] | None = None,
    gravity: float | None,
) -> AttitudeEvaluation:
    """The evaluation of a table; arguments and errors as for `Kind.evaluation`.

    Args:
        temperature: as for `fit_attitude_table`.
        traced: with the effects that a trace finds.
        effects: with these, and with others in their place, as `rig.procedures.attitude.fitted.effects_of` has them.
    """
    made: Callable[..., AttitudeEvaluation] = AttitudeEvaluation
    if traced or effects is not None:
        from rig.procedures.attitude.budget_traced import TracedEvaluation  # noqa: PLC0415 - few budgets are traced

        made = partial(TracedEvaluation, effects=effects)

    data = attitude_data(table)
    warm = bool(table.declared.get("temperature", False)) if temperature is None else temperature
    try:
        return made(data, _points(data, at), temperature=warm, gravity=gravity)
    except FitError as error:
        raise DataError(f"{table.source}: {error}") from error


def _points(data: AttitudeData, at: Sequence[Mapping[str, float]]) -> list[tuple[float, float]]:
    """Pitch and roll of every point; level, and the ends of the calibrated pitch at zero roll, if none is given."""
    if not at:
        low, high = float(data.pitch_deg.min()), float(data.pitch_deg.max())
        ends = [one for one in (max(low, -60.0), 0.0, min(high, 60.0)) if low <= one <= high]
        return [(one, 0.0 if data.has_roll else float(data.roll_deg[0])) for one in dict.fromkeys(ends)]
    for one in at:
        unknown = [name for name in one if name not in (PITCH, ROLL)]
        if unknown or PITCH not in one:
            raise DataError(f"--at: a point has {PITCH}, and perhaps {ROLL}: --at {PITCH}=10,{ROLL}=30")
    return [(one[PITCH], one.get(ROLL, 0.0)) for one in at]
