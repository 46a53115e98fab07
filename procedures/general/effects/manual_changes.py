"""Changes that a person can make to any laboratory, and their influence on kinds of effects."""

from __future__ import annotations

from collections.abc import Mapping

from rig.fitter.effects.manual_changes import ByHand, Change, resized_by

OTHER_METER = Change("meter-swapped", "read the sensors with another meter, if possible of another type")
OTHER_REFERENCE = Change("reference-swapped", "use another reference standard, if possible of another type")
OTHER_CHANNEL = Change("channel-swapped", "connect the sensors to other channels, not beside each other", anew=False)
REMOUNTED = Change("remount", "take the sensors out, and mount them again as they were")

MANUAL_CHANGES: Mapping[str, tuple[ByHand, ...]] = {
    "range-step": (resized_by(OTHER_METER),),
    "range-gain": (resized_by(OTHER_METER),),
    "reference-nonlinearity": (resized_by(OTHER_REFERENCE),),
    "cross-talk": (resized_by(OTHER_CHANNEL),),
    "direction": (resized_by(REMOUNTED),),
    "direction-gain": (resized_by(REMOUNTED),),
    "direction-by-covariate": (resized_by(REMOUNTED),),
}
"""By kind of effect: what a change of a part does to an error of this part."""
