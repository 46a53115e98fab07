"""A set of hidden causes by a stranger: see README.md."""
from . import attitude, common, general, whole_plots

KINDS = {"attitude": attitude, "whole_plots": whole_plots, "general": general}


def table(kind, effects, seed, size, noise="white"):
    """A table of the kind. size is that of each effect; .size is the smallest achieved (0 for a null)."""
    names = [effects] if isinstance(effects, str) else list(effects)
    csv, options, hidden, sigma, parts, sizes = KINDS[kind].table(names, int(seed), float(size), noise)
    return common.Table(csv, options, min(sizes.values()) if sizes else 0.0, hidden, sigma, parts, sizes)
