"""Effects that an attitude calibration may lack: the catalogue, and the separation of effects that look alike."""

from rig.procedures.attitude.effects.catalogue import CATALOGUE
from rig.procedures.attitude.effects.effect import Effect, Term
from rig.procedures.attitude.effects.scene import Scene
from rig.procedures.attitude.effects.separation import separate

__all__ = [
    "CATALOGUE",
    "Effect",
    "Scene",
    "Term",
    "separate",
]
