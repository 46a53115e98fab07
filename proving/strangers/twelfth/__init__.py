"""Simulated calibration tables with hidden causes."""
from . import attitude, general, whole_plots
from .common import finish, stream

KINDS = {"attitude": attitude, "whole_plots": whole_plots, "general": general}


def table(kind, effects, seed, size, noise="white"):
    module = KINDS[kind]
    if noise not in module.NOISES:
        raise ValueError("no such noise: %s" % noise)
    if isinstance(effects, str):
        effects = [effects]
    for name in effects:
        if name not in module.EFFECTS:
            raise ValueError("no such effect: %s" % name)
    lab = module.laboratory(stream(kind, seed, "laboratory"))
    return finish(kind, lab, module, list(effects), seed, size, noise)
