"""Changes that a person can make to an attitude bench, and their influence on families of effects.

An effect with another influence has its own `manual_changes` in its entry.
"""

from __future__ import annotations

from collections.abc import Mapping

from rig.fitter.effects.manual_changes import ByHand, Change, resized_by

PADS_LOCKED = Change("pads-locked", "lock the isolation pads under the package")
REMOUNTED = Change("remount", "take the package off the table, and mount it again as it was")
OTHER_CABLE = Change("cable-swapped", "use another cable to the package, and lead it another way")
OTHER_VOLTMETER = Change("voltmeter-swapped", "connect the sensors to another voltmeter, if possible of another type")

FAMILIES: Mapping[str, tuple[ByHand, ...]] = {
    "voltmeter": (resized_by(OTHER_VOLTMETER),),
    "package": (resized_by(REMOUNTED),),
}
"""By source of the effect."""
