"""Designs: which points to measure, and how precise the calibration will be. Arrays in, dataclasses out.

    factors = [Factor.at([10, 23, 40]), Factor.at([0, 1, 2, 5, 10])]   # or plain lists of levels
    columns = lambda points: ...                                       # (m, k) points -> (m, p) model matrix, any m

    points = grid([f.levels for f in factors])                         # (15, 2), all combinations
    made = central_composite(2, kind="inscribed", centre=4)            # .points coded, .block, .alpha
    points = to_range(made.points, low, high)                          # -1 is low, +1 is high

    plot = plots_by_setting(points, hard=(0,))                         # (15,) from 0, one for each temperature

    design = optimal(factors, columns, 24, names=names, hard=(0,), whole_plots=6, eta=1.0, criterion="D", seed=1)
    design.points, design.whole_plot                                   # (24, 2), (24,) from 0
    design.reached, design.starts                                      # how often the search ended at the best design

    e = evaluate(points, factors, columns, names, whole_plot=plots)    # any design; design.evaluation is the same
    e.undetermined, e.would                                            # terms it does not determine; points that would
    e.stderr, e.correlated(0.9)                                        # in units of sigma; nearly confounded pairs
    e.mean_variance, e.largest_variance, e.profile(0), e.variance(x)   # of predictions, in units of sigma^2
    e.efficiency.d, .a, .g, .i                                         # relative to the best shares of points, 0 to 1
    e.freedom.residual, .whole_plots, .pure_error, .lack_of_fit        # degrees of freedom
    advice(e, ["temperature_degC", "force_kN"])                        # shortcomings in sentences; also of a design

`Factor.at` has levels, `Factor.within` any setting of a range, `Factor.categories` nothing between its levels.
`columns` gets settings in the factors' own units; no coding is needed. `hard` are indices of factors. Errors that a
person can correct are `FitError`. Sources are in the modules; docs/how_to/designs.md has examples.
"""

from rig.fitter.designs.advice import advice
from rig.fitter.designs.classical import CentralComposite, central_composite, grid, plots_by_setting, to_range
from rig.fitter.designs.determined import Freedom
from rig.fitter.designs.evaluate import Efficiencies, Evaluation, evaluate
from rig.fitter.designs.factors import Factor
from rig.fitter.designs.measure import Measure, optimal_measure
from rig.fitter.designs.optimal import Design, optimal
from rig.fitter.designs.region import Region

__all__ = [
    "CentralComposite",
    "Design",
    "Efficiencies",
    "Evaluation",
    "Factor",
    "Freedom",
    "Measure",
    "Region",
    "advice",
    "central_composite",
    "evaluate",
    "grid",
    "optimal",
    "optimal_measure",
    "plots_by_setting",
    "to_range",
]
