"""table(kind, effects, seed, size, noise): one calibration run with hidden error sources."""
from . import attitude, general, whole_plots
from .common import Made  # noqa: F401

KINDS = {"attitude": attitude, "whole_plots": whole_plots, "general": general}


def table(kind, effects, seed, size, noise="white"):
    return KINDS[kind].table(tuple(effects), int(seed), float(size), noise)
