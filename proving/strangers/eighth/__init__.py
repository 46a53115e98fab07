"""The eighth set of hidden causes, by a stranger."""
from . import attitude, general, whole_plots

KINDS = {"attitude": attitude, "whole_plots": whole_plots, "general": general}


def table(kind, effects, seed, size, noise="white"):
    return KINDS[kind].table(effects, seed, size, noise)
