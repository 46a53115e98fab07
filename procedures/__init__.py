"""What to run: experimental designs, the order they are run in, and the run list that results.

Nothing here talks to an instrument. A procedure is expanded once, before anything moves, into a `RunList`: every
point of the run, in order. The run list is hashed and stored; the run is the run list carried out.
"""

from procedures.designs import Design, fraction, grid, tumble
from procedures.orders import Visit, random_order, serpentine
from procedures.pitch_roll import PitchRollProcedure
from procedures.run_list import Factor, Point, RunList, Settle, rows_sha256
from procedures.whole_plot import FACTORS as WHOLE_PLOT_FACTORS
from procedures.whole_plot import WholePlotProcedure

Procedure = PitchRollProcedure | WholePlotProcedure
"""A checked `procedure.toml` of any kind."""

__all__ = [
    "WHOLE_PLOT_FACTORS",
    "Design",
    "Factor",
    "PitchRollProcedure",
    "Point",
    "Procedure",
    "RunList",
    "Settle",
    "Visit",
    "WholePlotProcedure",
    "fraction",
    "grid",
    "random_order",
    "rows_sha256",
    "serpentine",
    "tumble",
]
