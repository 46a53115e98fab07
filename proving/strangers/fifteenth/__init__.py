"""Calibration tables of laboratories with hidden causes. table(kind, effects, seed, size, noise)."""

from . import attitude, general, whole_plots

KINDS = {"attitude": attitude, "whole_plots": whole_plots, "general": general}


def table(kind, effects, seed, size, noise="white"):
    return KINDS[kind].table(effects, seed, size, noise)
