"""Seventh set of hidden causes. table(kind, effects, seed, size, noise="white"); what the causes are: README.md."""
from . import attitude, general, whole_plots
from ._core import Table, build

KINDS = {"attitude": attitude, "whole_plots": whole_plots, "general": general}

__all__ = ["KINDS", "Table", "table"]


def table(kind, effects, seed, size, noise="white"):
    """One laboratory (seed) with the causes named in effects, each of the given size."""
    return build(kind, KINDS[kind], effects, seed, size, noise)
