"""Whether a declared model can be fitted to what a bench sets and reads."""

from __future__ import annotations

from collections.abc import Mapping

from rig.fitter.errors import FitError
from rig.fitter.formula import Formula
from rig.procedures.general.factors import DEGC, FactorSettings
from rig.procedures.general.model_settings import ModelSettings
from rig.procedures.general.models.named import standard_model
from rig.procedures.general.models.units import to_model, unit_in
from rig.procedures.present.meant import meant, nearest


def misfit(
    factors: Mapping[str, FactorSettings], models: ModelSettings, sensors: Mapping[str, str], read: Mapping[str, str]
) -> str:
    """Variables that nothing reads, and units that a standard model does not convert, as a sentence; "" if none."""
    known = [*factors, *read]
    for name, column in sensors.items():
        model = models.of(name)
        where = f"model.{name}" if name in models.own else "model"
        if model.standard is not None:
            entry = standard_model(model.standard)
            abscissa = model.abscissa or next(iter(factors))
            try:
                to_model(unit_in(abscissa), entry.abscissa.unit, abscissa)
                to_model(unit_in(column), entry.response.unit, column)
            except FitError as error:
                return f"{where}.standard = {entry.name!r}: {error}"
        elif model.linear and model.formula is not None:
            unread = [one for one in Formula.parse(model.formula).names if one not in known]
            names = Formula.parse(model.formula).names
            if model.abscissa is not None and model.abscissa not in names:
                near = meant(model.abscissa, names)
                return f"{where}.abscissa = {model.abscissa!r} is not in its formula, {model.formula}{near}"
            replaced = {factor: one for one, factor in read.items() if factor}
            if twice := [one for one in Formula.parse(model.formula).names if one in replaced]:
                return (
                    f"{where}.formula: {twice[0]} sets {replaced[twice[0]]}, which is read in its place: write "
                    f"{replaced[twice[0]]}"
                )
            if unread:
                return f"{where}.formula: {_not_read(unread[0], factors, read)}"
    return ""


def _not_read(name: str, factors: Mapping[str, FactorSettings], read: Mapping[str, str]) -> str:
    """Why a quantity cannot be in a model, and what to declare."""
    if near := nearest(name, [*factors, *read]):
        return f"nothing on the bench sets or reads {name}; did you mean {near}?"
    if name.endswith(DEGC):
        there = [one for one in read if one.endswith(DEGC)]
        return (
            f"nothing on the bench reads {name}: [temperatures] has {', '.join(there)}"
            if there
            else (f"nothing on the bench reads {name}: it has no [temperatures]")
        )
    easy = next((one for one, factor in factors.items() if not factor.hard), next(iter(factors)))
    return (
        f"{name} is not a factor ({', '.join(factors)}), and the bench does not read it as what one of them "
        f'sets: `of = "{easy}"` in [references.{name}] of the bench says so'
    )
