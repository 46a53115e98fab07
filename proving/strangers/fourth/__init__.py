"""The fourth stranger's set: hidden causes in calibration tables. numpy only, deterministic."""
from . import attitude, general, whole_plots

KINDS = {"attitude": attitude, "whole_plots": whole_plots, "general": general}


def table(kind, effects, seed, size, noise="white"):
    """A table of `kind` with the named effects hidden (none: a null), each of size `size`."""
    if isinstance(effects, str):
        effects = (effects,)
    module = KINDS[str(kind).replace(" ", "_").replace("-", "_")]
    return module.make(tuple(effects), int(seed), float(size), noise)
