"""Hidden physics for tables of three kinds: see README.md. numpy only."""
from . import attitude, general, whole_plots

_KINDS = {"attitude": attitude, "whole_plots": whole_plots, "general": general}
KINDS = tuple(_KINDS)


def table(kind, effects, seed, size, noise="white"):
    """A table of that kind with those effects (a sequence of names, empty for a null). Deterministic."""
    if isinstance(effects, str):
        effects = (effects,)
    return _KINDS[kind.replace("-", "_").replace(" ", "_")].table(tuple(effects), int(seed), float(size), noise)
