"""The sixth set of hidden physics: attitude sensors, whole plots, general tables. See README.md."""
from . import attitude, general, whole_plots
from ._core import Table, build

KINDS = {"attitude": attitude, "whole_plots": whole_plots, "general": general}


def table(kind, effects, seed, size, noise="white"):
    """A table of a kind with the named effects (none: a null), each of `size` standard deviations."""
    if kind not in KINDS:
        raise ValueError("no such kind: %r" % (kind,))
    return build(kind, KINDS[kind], effects, seed, float(size), noise)
