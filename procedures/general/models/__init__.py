"""Standard models of the field by name: `--model NAME`. Every module of this folder with `MODELS` adds its own.

A new model is an entry in such a module, or a module; nothing else changes (docs/reference/models.md).
"""

from rig.procedures.general.models.entry import Derived, Parameter, Quantity, StandardModel
from rig.procedures.general.models.named import NamedCurve, standard_models

__all__ = ["Derived", "NamedCurve", "Parameter", "Quantity", "StandardModel", "standard_models"]
