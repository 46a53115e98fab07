"""The sixteenth set: tables of calibration laboratories in which something happens that nobody wrote down."""

from . import attitude, general, whole_plots

KINDS = {m.__name__.rpartition(".")[2]: m for m in (attitude, whole_plots, general)}


def table(kind, effects, seed, size, noise="white"):
    """A table of a kind, with the named effects, each of the given size; the same for the same arguments."""
    return KINDS[kind].table(effects, seed, size, noise)
