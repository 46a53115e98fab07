"""Simulated calibration tables with hidden physical causes: three kinds of laboratory."""
from . import attitude, common, general, whole_plots

KINDS = {"attitude": attitude, "whole_plots": whole_plots, "general": general}


def table(kind, effects, seed, size, noise="white"):
    return common.make(kind, KINDS[kind], effects, seed, size, noise)
