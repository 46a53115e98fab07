"""Split plots: readings that share the error of their whole plot, fitted by restricted maximum likelihood.

    fit = fit_split_plot(columns, y, whole_plot, names)
    fit.coefficients, fit.kenward_roger().stderr, fit.df, fit.sigma_wholeplot

If many responses share one design, decompose it once: `SplitPlotDesign(...).fit(y)`, `.fit_many(ys)`.
"""

from rig.fitter.split_plot.batch import SplitPlotBatch
from rig.fitter.split_plot.design import SplitPlotDesign, fit_split_plot, plan_precision
from rig.fitter.split_plot.fit import SplitPlotFit
from rig.fitter.split_plot.grouping import Variances
from rig.fitter.split_plot.kenward_roger import KenwardRoger, ScaledF
from rig.fitter.split_plot.plan import Precision

__all__ = [
    "KenwardRoger",
    "Precision",
    "ScaledF",
    "SplitPlotBatch",
    "SplitPlotDesign",
    "SplitPlotFit",
    "Variances",
    "fit_split_plot",
    "plan_precision",
]
