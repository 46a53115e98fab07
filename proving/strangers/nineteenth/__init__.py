"""The nineteenth set: what instruments do that their calibration models leave out, by someone who calibrates."""

from collections.abc import Sequence

from . import attitude, general, whole_plots
from .common import Table, build

KINDS = {"attitude": attitude, "whole_plots": whole_plots, "general": general}


def table(kind: str, effects: str | Sequence[str], seed: int, size: float, noise: str = "white") -> Table:
    """A table of a kind with the named effects, each of the given size; the same for the same arguments."""
    names = (effects,) if isinstance(effects, str) else tuple(effects)
    module = KINDS[kind]
    return build(kind, module.laboratory(seed, names), module.EFFECTS, names, seed, size, noise)
