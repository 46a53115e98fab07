"""Changes that a person can make to a bench for pressure transducers, and their influence on families of effects.

An effect with another influence has its own `manual_changes` in its entry.
"""

from __future__ import annotations

from collections.abc import Mapping

from rig.fitter.effects.manual_changes import ByHand, Change, resized_by

OTHER_GAUGE = Change("gauge-swapped", "use another pressure controller, with a gauge of its own")
OTHER_LINE = Change("line-swapped", "use another line to the transducers, of at least twice the bore", anew=False)
OTHER_VOLTMETER = Change("voltmeter-swapped", "read the transducers with another voltmeter and supply")

FAMILIES: Mapping[str, tuple[ByHand, ...]] = {
    "line": (resized_by(OTHER_LINE),),
    "voltmeter": (resized_by(OTHER_VOLTMETER),),
}
"""By source of the effect."""
