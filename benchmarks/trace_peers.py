"""What people would use instead of `rig trace`: five methods behind one signature, for `bench_trace_peers`.

Each takes columns and a response from which the declared model has been projected out, and gives back which columns it
keeps and what it predicts. A method whose package is not installed is left out and named in `ABSENT`.
"""

import warnings
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import version

import numpy as np
from scipy.stats import pearsonr

from proving.strangers.columns import Products, stepwise

PACKAGES = ("numpy", "scipy", "sklearn", "pysindy", "pygam", "gplearn")
DISTRIBUTION = {"sklearn": "scikit-learn"}


def _installed(package):
    try:
        import_module(package)
    except ImportError:
        return None
    return version(DISTRIBUTION.get(package, package))


VERSIONS = {package: _installed(package) for package in PACKAGES}
ABSENT = [package for package, number in VERSIONS.items() if number is None]


SHORTEST = 0.01
"""LassoCV's least penalty over its largest; its own 0.001 changes nothing here but takes five times as long."""


@dataclass
class Answer:
    """What a method makes of a case.

    Attributes:
        kept: indices of the columns, or of the terms, that it keeps.
        fitted: (n,) what it adds to the declared model's prediction.

    """

    kept: list[int]
    fitted: np.ndarray


def standardised(columns, y):
    """Columns of unit rms, and the response over its rms."""
    rms = np.sqrt(np.mean(columns**2, axis=0))
    return columns / np.where(rms > 0, rms, 1.0), y / np.sqrt(np.mean(y**2))


def refitted(columns, y, kept):
    """(n,) least squares on the columns kept."""
    if not kept:
        return np.zeros(len(y))
    picked = columns[:, kept]
    return picked @ np.linalg.lstsq(picked, y, rcond=1e-10)[0]


def stepwise_bic(columns, y, fold):
    """Forward one column at a time while BIC falls, each time followed by backward."""
    kept = stepwise(Products.of(columns, y))
    return Answer(kept, refitted(columns, y, kept))


def lasso_cv(columns, y, fold):
    """scikit-learn's LassoCV: 100 penalties, the one of least error on whole folds left out."""
    return _lasso(columns, y, fold, one_se=False)


def lasso_one_se(columns, y, fold):
    """LassoCV with the largest penalty within one standard error of the least error, as books advise for selection."""
    return _lasso(columns, y, fold, one_se=True)


def _lasso(columns, y, fold, *, one_se):
    from sklearn.linear_model import Lasso, LassoCV

    x, unit = standardised(columns, y)
    splits = [(np.flatnonzero(fold != f), np.flatnonzero(fold == f)) for f in np.unique(fold)]
    model = LassoCV(cv=splits, fit_intercept=False, eps=SHORTEST).fit(x, unit)
    coefficients = model.coef_
    if one_se:
        alpha = max(model.alphas_[_as_good(model.mse_path_)])
        coefficients = Lasso(alpha=alpha, fit_intercept=False).fit(x, unit).coef_
    return Answer(np.flatnonzero(coefficients).tolist(), x @ coefficients * np.sqrt(np.mean(y**2)))


def stlsq(columns, y, fold):
    """PySINDy's STLSQ; its threshold the highest within one standard error of the least error on folds left out.

    The ridge inside is a tenth of the columns' squared length: at its own 0.05 it comes apart over columns as alike as
    those of a constant that is searched.
    """
    from pysindy import STLSQ

    x, unit = standardised(columns, y)
    thresholds, alpha = np.geomspace(0.02, 0.3, 5), 0.1 * len(y)
    errors = np.ones((len(thresholds), int(fold.max()) + 1))
    for f in np.unique(fold):
        inside, outside = fold != f, fold == f
        for i, threshold in enumerate(thresholds):
            model = STLSQ(threshold=threshold, alpha=alpha, max_iter=20).fit(x[inside], unit[inside, None])
            errors[i, f] = np.mean((unit[outside] - x[outside] @ model.coef_[0]) ** 2)
    chosen = thresholds[np.flatnonzero(_as_good(errors)).max()]
    coefficients = STLSQ(threshold=chosen, alpha=alpha, max_iter=20).fit(x, unit[:, None]).coef_[0]
    return Answer(np.flatnonzero(coefficients).tolist(), x @ coefficients * np.sqrt(np.mean(y**2)))


def _as_good(errors):
    """Settings (rows) whose mean error over folds (columns) is within one standard error of the least."""
    mean, se = errors.mean(axis=1), errors.std(axis=1) / np.sqrt(errors.shape[1])
    least = int(np.argmin(mean))
    return mean <= mean[least] + se[least]


def gam(variables, y, fold):
    """pyGAM: a spline for every variable, a line where it has few values, a surface for the first two if asked.

    Smoothing by its own grid search; a term counts as found where its p, times the number of terms, is below 5 %.
    """
    from pygam import LinearGAM, f, l, s, te

    x, kinds = variables
    of = {"spline": s, "line": l, "factor": f}
    terms = None
    for i, kind in enumerate(kinds):
        term = te(i - 1, i, n_splines=8) if kind == "surface" else of[kind](i)
        terms = term if terms is None else terms + term
        if kind == "surface":
            terms += of["spline"](i)
    model = LinearGAM(terms).gridsearch(x, y, progress=False)
    p = np.array(model.statistics_["p_values"][: len(model.terms) - 1])  # the last is the intercept
    return Answer(np.flatnonzero(p * len(p) < 0.05).tolist(), model.predict(x) - np.mean(y))


def symbolic(variables, y, fold):
    """gplearn: 1,000 expressions, 20 generations. Counts as found if it says something of a fold it has not seen."""
    from gplearn.genetic import SymbolicRegressor

    x, unit = standardised(variables[0] - variables[0].mean(axis=0), y)
    inside = fold != fold.max()
    model = SymbolicRegressor(
        population_size=1000,
        generations=20,
        function_set=("add", "sub", "mul", "sin", "cos"),
        metric="pearson",
        parsimony_coefficient=0.005,
        p_crossover=0.7,
        max_samples=0.9,
        random_state=0,
    ).fit(x[inside], unit[inside])
    shape = model.predict(x)
    if not np.ptp(shape[~inside]) or pearsonr(shape[~inside], unit[~inside]).pvalue > 0.05:
        return Answer([], np.zeros(len(y)))
    line = np.column_stack([np.ones(len(y)), shape])
    return Answer([0], line @ np.linalg.lstsq(line, y, rcond=None)[0])


ON_COLUMNS = {
    "stepwise, BIC": (stepwise_bic, None),
    "LassoCV": (lasso_cv, "sklearn"),
    "LassoCV, one standard error": (lasso_one_se, "sklearn"),
    "PySINDy STLSQ": (stlsq, "pysindy"),
}
ON_VARIABLES = {"GAM (pyGAM)": (gam, "pygam"), "symbolic (gplearn)": (symbolic, "gplearn")}


def answer(method, *arguments):
    """Run a method without its warnings: none of them stops it, and there are thousands."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return method(*arguments)
