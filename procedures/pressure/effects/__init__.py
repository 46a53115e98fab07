"""Effects that a pressure calibration over temperature may lack."""

from rig.procedures.pressure.effects.catalogue import GROWING_NOISE, PRESSURE_CATALOGUE

__all__ = ["GROWING_NOISE", "PRESSURE_CATALOGUE"]
