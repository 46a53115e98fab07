"""A split-plot design: checked and decomposed once, then fitted to any number of responses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.errors import FitError
from rig.fitter.split_plot.batch import SplitPlotBatch
from rig.fitter.split_plot.fit import SplitPlotFit
from rig.fitter.split_plot.grouping import Nesting, Variances
from rig.fitter.split_plot.nested import NestedProfile
from rig.fitter.split_plot.plan import Precision, forecast
from rig.fitter.split_plot.profile import Profile
from rig.fitter.split_plot.spectrum import FixedPart, Spectrum

EPS = float(np.finfo(float).eps)

NEXT_TO_NOTHING = 0.01
"""Share of every whole plot outside the columns below which the error between whole plots is taken up by these."""

BATCH = 2048
"""Number of responses processed together, by the size of the cache."""


class SplitPlotDesign:
    """Columns of a model, and the whole plots its readings belong to.

    Attributes:
        whole_plots: (W,) identities, ascending.
        replicates: (R,) identities, ascending; None without replications.
        nesting: the columns, and the grouping of readings.
    """

    def __init__(
        self,
        columns: ArrayLike,
        whole_plot: ArrayLike,
        names: Sequence[str],
        *,
        replicate: ArrayLike | None = None,
    ) -> None:
        """Check and decompose.

        Args:
            columns: (n, k).
            whole_plot: (n,) identity of each reading's whole plot: any integers, in any order.
            names: of the k columns, used in results and messages.
            replicate: (n,) identity of each reading's replication, for whole plots nested in replications with their
                own error.

        Raises:
            RankError: the columns are not independent.
            ValueError: shapes differ, a value is not finite or not whole, or a whole plot lies in two replications.
        """
        matrix = _finite("columns", columns, 2)
        n, k = matrix.shape
        if len(names) != k:
            raise ValueError(f"{k} columns were given for {len(names)} names")
        self.whole_plots, index = _identities("whole_plot", whole_plot, n)
        self.replicates: IntArray | None = None
        replicate_of: IntArray | None = None
        if replicate is not None:
            self.replicates, of_reading = _identities("replicate", replicate, n)
            replicate_of = np.zeros(len(self.whole_plots), np.int64)
            replicate_of[index] = of_reading
            torn = self.whole_plots[index[replicate_of[index] != of_reading]]
            if torn.size:
                raise FitError(f"whole plot {torn[0]} has readings in more than one replication")
        self.nesting = Nesting(FixedPart.of(matrix, tuple(names)), index, replicate_of)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns."""
        return self.nesting.fixed.names

    @property
    def n(self) -> int:
        """Number of readings."""
        return len(self.nesting.whole_plot)

    def fit(self, y: ArrayLike) -> SplitPlotFit:
        """Fit one response (n,).

        Raises:
            ValueError: `y` is not (n,) finite numbers, the design cannot tell its errors apart, or readings of one
                whole plot show no error at all.

        """
        response = _finite("y", y, 1)
        in_x, in_z, rest = self._parts(response)
        wholeplot, replicate = self._ratios(response, in_z, rest)
        structure = self.nesting.structure(Variances(1.0, wholeplot, replicate))
        spectrum = structure.spectrum
        if spectrum is not self.nesting.wholeplot_spectrum:
            in_x, in_z, rest = spectrum.parts(response)
        shrunk = in_z / (1.0 + structure.ratio * spectrum.xi)
        subplot = float(rest @ rest + in_z @ shrunk) / spectrum.fixed.df
        variances = Variances(subplot, subplot * wholeplot, None if replicate is None else subplot * replicate)
        at_zero = [kind for kind, ratio in (("whole-plot", wholeplot), ("replication", replicate)) if ratio == 0.0]
        return SplitPlotFit(
            names=self.names,
            coefficients=spectrum.coefficients(in_x, in_z, structure.ratio),
            variances=variances,
            reml_loglik=float(_log_likelihood(spectrum, np.array(structure.ratio), np.array(subplot))),
            notes=tuple(f"the {kind} variance is estimated at zero; the fit is without it" for kind in at_zero),
            whole_plots=self.whole_plots,
            replicates=self.replicates,
            y=response,
            nesting=self.nesting,
            structure=replace(structure, variances=structure.variances * subplot),
        )

    def expected_errors(self, wholeplot: float, rng: np.random.Generator) -> FloatArray:
        """(n,) errors outside the columns of which a fit estimates one for the subplot variance, and `wholeplot`.

        Every eigenvector of the whole plots has its expected square, and the remainder of the readings its expected sum
        of squares, in a direction that is drawn: so the restricted likelihood is highest at these variances.
        """
        spectrum = self.nesting.wholeplot_spectrum
        signs = np.where(np.arange(len(spectrum.xi)) % 2 == 0, 1.0, -1.0)
        between = spectrum.left @ (signs * np.sqrt(1.0 + wholeplot * spectrum.xi))
        rest = spectrum.parts(rng.normal(size=self.n))[2]
        return np.asarray(between + rest * np.sqrt(spectrum.rest_df) / np.linalg.norm(rest))

    def fit_many(self, ys: ArrayLike) -> SplitPlotBatch:
        """Fit m responses, the columns of (n, m) `ys`, each alone.

        Raises:
            ValueError: as `fit`; or the design has replications, whose two ratios need `fit` response by response.

        """
        if self.replicates is not None:
            raise ValueError(
                "with replications fit the responses one by one: the design shares its set-up between them"
            )
        responses = _finite("ys", ys, 2)
        spectrum = self.nesting.wholeplot_spectrum
        m = responses.shape[1]
        coefficients, subplot, ratio = np.empty((m, len(self.names))), np.empty(m), np.empty(m)
        for start in range(0, m, BATCH):
            part = slice(start, start + BATCH)
            in_x, in_z, rest = self._parts(responses[:, part])
            squares, rest_ss = in_z**2, np.einsum("nm,nm->m", rest, rest)
            ratio[part] = self._profile.maximise_many(squares, rest_ss)
            grown = 1.0 + np.multiply.outer(spectrum.xi, ratio[part])
            subplot[part] = (rest_ss + np.sum(squares / grown, axis=0)) / spectrum.fixed.df
            coefficients[part] = spectrum.coefficients(in_x, in_z, ratio[part]).T
        return SplitPlotBatch(coefficients, subplot, ratio, _log_likelihood(spectrum, ratio, subplot), spectrum)

    def precision(
        self, sigma_wholeplot: float, sigma_subplot: float, sigma_replicate: float | None = None
    ) -> Precision:
        """Standard errors and degrees of freedom of the design for these standard deviations.

        Raises:
            ValueError: a standard deviation is negative or not finite, that of the subplot error is zero, or one is
                given for replications and there are none.
        """
        given = [sigma_wholeplot, sigma_subplot, sigma_replicate or 0.0]
        if not np.all(np.isfinite(given)) or min(given) < 0.0 or sigma_subplot == 0.0:
            raise FitError("standard deviations must be finite and not negative, and the subplot's above zero")
        if sigma_replicate and self.replicates is None:
            raise FitError("a standard deviation is given for replications, but the design has none")
        variances = Variances(sigma_subplot**2, sigma_wholeplot**2, (sigma_replicate or 0.0) ** 2)
        missing = self._not_estimable or (self._replicates_not_estimable if sigma_replicate else None)
        return forecast(self.nesting, variances, estimable=missing is None)

    def _parts(self, responses: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """`Spectrum.parts` of (n,) or (n, m) responses, checked to be usable."""
        if len(responses) != self.n:
            raise ValueError(f"y has {len(responses)} readings, the design {self.n}")
        missing = self._not_estimable or self._replicates_not_estimable
        if missing is not None:
            raise FitError(missing)
        parts = self.nesting.wholeplot_spectrum.parts(responses)
        size, scatter = (np.einsum("n...,n...->...", each, each) for each in (responses, parts[2]))
        if np.any(scatter <= (30.0 * EPS) ** 2 * size):
            raise FitError("readings within whole plots show no error beyond rounding: there is nothing to estimate")
        return parts

    def _ratios(self, response: FloatArray, in_z: FloatArray, rest: FloatArray) -> tuple[float, float | None]:
        if self.replicates is not None:
            return self._nested_profile.maximise(response)
        return self._profile.maximise(in_z**2, float(rest @ rest)), None

    @cached_property
    def _profile(self) -> Profile:
        spectrum = self.nesting.wholeplot_spectrum
        return Profile(spectrum.xi, spectrum.fixed.df)

    @cached_property
    def _nested_profile(self) -> NestedProfile:
        wholeplot, replicate = self.nesting.wholeplot_spectrum, self.nesting.replicate_spectrum
        return NestedProfile(wholeplot, replicate, wholeplot.left.T @ self.nesting.replicate_indicators)

    @cached_property
    def _not_estimable(self) -> str | None:
        """Reason why the errors cannot be separated, if any."""
        fixed, spectrum = self.nesting.fixed, self.nesting.wholeplot_spectrum
        k, count = len(fixed.names), len(self.whole_plots)
        if fixed.df <= 0:
            return f"{self.n} readings leave nothing to estimate the error of {k} coefficients from"
        if count == 1:
            return "all readings are in one whole plot: the error between whole plots cannot be estimated"
        if count == self.n:
            return "every whole plot has a single reading: whole-plot and subplot error cannot be told apart"
        if len(spectrum.xi) == 0:
            return f"the columns use up all {count} whole plots: the error between whole plots cannot be estimated"
        left = spectrum.right**2 @ spectrum.all_xi / np.bincount(self.nesting.whole_plot)
        if left.max() < NEXT_TO_NOTHING:
            return (
                f"the columns use up nearly all of {count} whole plots, as of a measured setting that scatters a bit: "
                f"the error between whole plots cannot be estimated; more whole plots are needed, or fewer terms"
            )
        if spectrum.rest_df == 0:
            return "the columns leave no degrees of freedom within whole plots: the subplot error cannot be estimated"
        return None

    @cached_property
    def _replicates_not_estimable(self) -> str | None:
        """Why the error between replications cannot be estimated; None if it can."""
        if self.replicates is None:
            return None
        between = len(self.nesting.replicate_spectrum.xi)
        if between == 0:
            return "the columns leave no degrees of freedom between replications: their error cannot be estimated"
        if between == len(self.nesting.wholeplot_spectrum.xi):
            return "no degrees of freedom are left between whole plots of one replication: leave replications out"
        return None


def fit_split_plot(
    columns: ArrayLike,
    y: ArrayLike,
    whole_plot: ArrayLike,
    names: Sequence[str],
    *,
    replicate: ArrayLike | None = None,
) -> SplitPlotFit:
    """Fit y = X b + whole-plot error + subplot error by REML; see `SplitPlotDesign` and its `fit`."""
    return SplitPlotDesign(columns, whole_plot, names, replicate=replicate).fit(y)


def plan_precision(
    columns: ArrayLike,
    whole_plot: ArrayLike,
    sigma_wholeplot: float,
    sigma_subplot: float,
    names: Sequence[str],
    *,
    replicate: ArrayLike | None = None,
    sigma_replicate: float | None = None,
) -> Precision:
    """Standard error of each term for errors of the given size, in units of y; see `SplitPlotDesign.precision`."""
    design = SplitPlotDesign(columns, whole_plot, names, replicate=replicate)
    return design.precision(sigma_wholeplot, sigma_subplot, sigma_replicate)


def _log_likelihood(spectrum: Spectrum, ratio: FloatArray, subplot: FloatArray) -> FloatArray:
    """(m,) restricted log-likelihood at its maximum over the subplot variance."""
    df = spectrum.fixed.df
    log_det = np.sum(np.log1p(np.multiply.outer(spectrum.xi, ratio)), axis=0) + spectrum.fixed.log_det
    return np.asarray(-0.5 * (df * (np.log(2.0 * np.pi * subplot) + 1.0) + log_det))


def _finite(name: str, values: ArrayLike, dimensions: int) -> FloatArray:
    array = np.array(values, np.float64)  # a copy, because results refer to it
    if array.ndim != dimensions:
        raise ValueError(f"{name}: {dimensions} dimensions are needed, not {array.ndim}")
    if not np.isfinite(array).all():
        raise FitError(f"{name}: a value is not finite (row {np.argwhere(~np.isfinite(array))[0][0]})")
    return array


def _identities(name: str, values: ArrayLike, count: int) -> tuple[IntArray, IntArray]:
    """Distinct identities, ascending, and each reading's position among them."""
    given = np.asarray(values)
    if given.shape != (count,):
        raise ValueError(f"{name}: {count} identities are needed, not an array of shape {given.shape}")
    with np.errstate(invalid="ignore"):
        whole = given.astype(np.int64)
    if not np.array_equal(whole, given):
        raise FitError(f"{name}: identities must be whole numbers")
    identities, index = np.unique(whole, return_inverse=True)
    return identities, index.astype(np.int64)
