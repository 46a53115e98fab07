"""Sentences about a trace or a fit of attitude sensors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

_CARRIES_OVER = 0.8
"""Ratio of left-out errors after and before; above this the effects found are of little use for new data."""


def misfit_in_words(sensor: Mapping[str, Any]) -> str:
    """Possible change of each parameter of a sensor by a model error as large as the significant lack of fit."""
    moves = [
        f"{name.partition('_')[0]} by up to {value:.2g} {name.partition('_')[2]}"
        for name, value in sensor["model_error"].items()
    ]
    return (
        f"lack of fit is significant: a model error of the size that is left ({sensor['sigma_bias_deg']:.2g} deg rms) "
        f"can move {', '.join(moves)} beyond the intervals; see rig trace"
    )


def little_help(sensor: Mapping[str, Any]) -> str:
    """A warning if the effects found hardly help for left-out replications."""
    before, after = sensor["before"]["cv_rms_deg"], sensor["after"]["cv_rms_deg"]
    if not sensor["effects"] or not before or after is None or after <= _CARRIES_OVER * before:
        return ""
    if after >= before:
        return (
            f"The effects found do not help at replications the fit has not seen: the left-out error goes from "
            f"{before:.3g} to {after:.3g} deg. Measure again before relying on them."
        )
    return (
        f"The effects found matter little at replications the fit has not seen: the left-out error goes from "
        f"{before:.3g} to {after:.3g} deg."
    )
