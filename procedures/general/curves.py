"""Curves of calibrations as JSON values: formulas, arithmetic with named parameters, standard models."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rig.fitter.errors import FitError
from rig.fitter.formula import Formula
from rig.fitter.nonlinear import Curve, WrittenCurve


def curve_to_dict(curve: Curve) -> dict[str, Any]:
    """JSON values; `curve_from_dict` restores the same curve."""
    told: dict[str, Any] = {"formula": str(curve)}
    if isinstance(curve, Formula):
        return told
    if isinstance(curve, WrittenCurve):
        return {**told, "parameters": list(curve.parameters)}
    from rig.procedures.general.models import NamedCurve  # noqa: PLC0415 - plain formulas need no models

    if not isinstance(curve, NamedCurve):
        raise TypeError(f"{curve} cannot be stored")
    columns = {"variable": curve.variable, "abscissa": list(curve.abscissa), "response": list(curve.response)}
    return {**told, "parameters": list(curve.parameters), "model": {"name": curve.model.name, **columns}}


def curve_from_dict(given: Mapping[str, Any]) -> Curve:
    """Restore from `curve_to_dict`.

    Raises:
        FitError: the formula cannot be read, or there is no such model.
        KeyError, TypeError, ValueError: values are missing or invalid.
    """
    if "model" in given:
        from rig.procedures.general.models.named import NamedCurve, standard_model  # noqa: PLC0415

        told = given["model"]
        pairs = [(float(a), float(b)) for a, b in (told["abscissa"], told["response"])]
        curve = NamedCurve(standard_model(told["name"]), str(told["variable"]), *pairs)
        if list(curve.parameters) != given["parameters"]:
            raise FitError(f"its parameters of {curve.model.name} are not {', '.join(curve.parameters)}")
        return curve
    if "parameters" in given:
        return WrittenCurve.parse(given["formula"], [str(name) for name in given["parameters"]])
    return Formula.parse(given["formula"])
