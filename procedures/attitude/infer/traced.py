"""The calibration with the effects found by a trace, and with every other cause that the data cannot separate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from rig.fitter import RankError
from rig.fitter.arrays import FloatArray
from rig.procedures.attitude.fit import parameter_table
from rig.procedures.attitude.infer.alternatives import by_class, cover_rows
from rig.procedures.attitude.infer.calibrate import NotApplicable, calibrate_package

if TYPE_CHECKING:
    from rig.procedures.attitude.data import AttitudeData
    from rig.procedures.attitude.infer.calibration import AttitudeCalibration

Volts = Mapping[str, Mapping[str, FloatArray]]
"""(n,) contribution of effects, V, or (n, q) of their terms, by effect and sensor."""


def calibrate_traced(
    data: AttitudeData,
    effects: Volts,
    others: Sequence[tuple[str, str, Volts]],
    *,
    temperature: bool = False,
) -> AttitudeCalibration:
    """A package's calibration with effects, and its alternatives.

    Args:
        data: the run.
        effects: the named ones: (n,) volts by name and sensor.
        others: all effects with another member of a class in place of the named one: (named, member, effects).
        temperature: whether the declared model has temperature.

    Raises:
        rig.fitter.linear.RankError: the points do not determine the declared model.
        FitError: as `calibrate_package`.
    """
    kept = _applied(data, effects, temperature=temperature, merge=True)
    found, open_ = [], []
    for named, member, volts in others:
        one = _with(data, volts, temperature=temperature)
        if one is None:
            open_.append(f"{member} in place of {named}")
        else:
            found.append((named, member, one))
    notes = list(kept.notes)
    if found:
        classes = "; ".join(" or ".join(members) for members in by_class([(n, m) for n, m, _ in found]))
        notes.append(
            f"these data cannot separate {classes}: 95 % intervals cover all of them, values and standard deviations "
            "are those of the first"
        )
    if open_:
        notes.append(f"intervals leave out {', '.join(open_)}: these data do not determine the model with it")
    return replace(kept, alternatives=tuple(found), notes=tuple(notes))


def _with(data: AttitudeData, volts: Volts, *, temperature: bool) -> AttitudeCalibration | None:
    """None if the points do not determine the model with these effects."""
    try:
        return _applied(data, volts, temperature=temperature)
    except RankError:
        return None


def _applied(data: AttitudeData, effects: Volts, *, temperature: bool, merge: bool = False) -> AttitudeCalibration:
    """The calibration; effects that cannot be applied in use are fitted and omitted, with a note."""
    behind: tuple[str, ...] = ()
    while True:
        try:
            return calibrate_package(data, effects=effects, temperature=temperature, left_behind=behind, merge=merge)
        except NotApplicable as error:
            behind = (*behind, error.effect)


def covering_parameters(calibration: AttitudeCalibration, name: str) -> dict[str, Any]:
    """The paper's parameters of a sensor, each with an interval that covers every cause the data cannot separate.

    See `rig.procedures.attitude.infer.alternatives.cover_rows` for the keys.
    """
    others = [(named, member, _table(other, name)) for named, member, other in calibration.alternatives]
    return cover_rows(_table(calibration, name), others)


def _table(calibration: AttitudeCalibration, name: str) -> dict[str, Any]:
    """Parameters of a sensor; intervals include the model error if lack of fit remains."""
    table = parameter_table(*calibration.parameters(name))
    misfit = calibration.misfits.get(name)
    return dict(table) if misfit is None else misfit.widened(table)
