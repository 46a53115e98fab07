"""Simulated calibration tables with hidden physical causes."""
from . import attitude, common, general, whole_plots

KINDS = {"attitude": attitude, "whole_plots": whole_plots, "general": general}


def table(kind, effects, seed, size, noise="white"):
    """A table of a kind. Effects: a sequence of names, empty for a null. The same for the same arguments."""
    if isinstance(effects, str):
        effects = [effects]
    return common.build(kind, KINDS[kind], list(effects), int(seed), float(size), noise)
