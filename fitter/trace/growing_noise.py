"""Noise that changes with the reading or another recorded quantity: detected beside the effects, used for weights."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.least import least
from rig.fitter.linear import orthonormal
from rig.fitter.trace.chance import ALPHA, COUNTED

STEEPEST = 1e3
"""Growth per unit of the driver relative to the noise at zero below which it is negligible."""


@dataclass(frozen=True)
class Noise:
    """Standard deviation of a reading over a driver x, sd = a (1 + c x), or over its distance from a middle.

    Attributes:
        at_zero: a.
        per_unit: a c.
        stderr: of both, from the curvature of the likelihood; about 20 % too small, because residuals are dependent.
            NaN if the rows do not determine them.
        p: probability of such a relation between squared residual and driver by chance.
        middle: value of the driver that distances are from; None for the driver itself.
    """

    at_zero: float
    per_unit: float
    stderr: tuple[float, float]
    p: float
    middle: float | None = None

    def sd(self, driver: FloatArray) -> FloatArray:
        """(n,) standard deviation at these values of the driver, in units of the reading."""
        return self.at_zero + self.per_unit * _distance(driver, self.middle)


def noise_of(residual: FloatArray, left: FloatArray, driver: FloatArray, middle: float | None = None) -> Noise:
    """Estimate how noise grows with a driver.

    The test regresses squared residuals on the driver and studentises by their own scatter (Koenker, J. Econometrics 17
    (1981) 107), so that long tails are not taken for growth. The size maximises the normal likelihood.

    Args:
        residual: (n,) of one response.
        left: (n,) share of a reading's variance in its residual.
        driver: (n,) variable on which it may depend.
        middle: value of the driver, if the noise may depend on the distance from it.
    """
    squares, driver = _squares(residual, left), _distance(driver, middle)
    if np.ptp(squares) <= 0.0 or np.ptp(driver) <= 0.0:
        return Noise(float(np.sqrt(squares.mean())), 0.0, (0.0, 0.0), 1.0, middle)
    chance = _chance(squares, driver)
    highest, share = float(driver.max()), left / left.sum()

    def deviance(slope: float) -> float:
        shape = 1.0 + slope * driver
        return float(np.log(share @ (squares / shape**2)) + 2.0 * share @ np.log(shape))

    # by the logarithm of the ratio of the noise at the highest value to that at zero
    best = least(lambda u: deviance(float(np.expm1(u)) / highest), -2.0, float(np.log1p(STEEPEST)))
    slope = float(np.expm1(best.x)) / highest
    at_zero = float(np.sqrt(share @ (squares / (1.0 + slope * driver) ** 2)))
    sd = at_zero * (1.0 + slope * driver)
    told = 2.0 * left / sd**2
    try:
        spread = np.diag(np.linalg.inv([[told.sum(), told @ driver], [told @ driver, (told * driver) @ driver]]))
    except np.linalg.LinAlgError:  # all noise is at one value of the driver
        spread = np.full(2, np.nan)
    return Noise(at_zero, at_zero * slope, (float(np.sqrt(spread[0])), float(np.sqrt(spread[1]))), chance, middle)


FEWEST, FEWEST_OF_LEVEL = 20, 6
"""Minimum number of rows, and of rows of a level on average."""
FACTOR = 1.3
"""Minimum ratio of the largest to the smallest standard deviation for weights."""
LIKE_ALL = 4.0
"""Number of rows by which each level's variance is drawn to that of all rows."""


@dataclass(frozen=True)
class Growth:
    """Dependence of a row's standard deviation on a variable, or on its distance from the middle.

    Attributes:
        driver: the variable; "fitted" for the fitted response.
        span: values of the driver between which it was estimated.
        noise: units of the response, over the driver from 0 to 1 over its span, or over its distance from the middle of
            the span.
        p: family-wise, over all drivers.
    """

    driver: str
    span: tuple[float, float]
    noise: Noise
    p: float

    def sd(self, values: FloatArray) -> FloatArray:
        """(n,) standard deviation at values of the driver."""
        return np.maximum(self.noise.sd(_scaled(values, self.span)), 1e-6 * self.noise.at_zero)

    @property
    def ends(self) -> FloatArray:
        """(2,) standard deviation at the lowest value or in the middle, and at the highest value."""
        return self.noise.sd(np.array([self.noise.middle or 0.0, 1.0]))

    def told(self, where: str, scale: float = 1.0, unit: str = "") -> tuple[dict[str, float], str]:
        """Standard deviations at both ends of `where`, or in its middle and at its ends; and these in words."""
        (low, high), (first, last) = self.span, self.ends.tolist()
        ends = f"{low:.4g} and {high:.4g}", f"{(low + high) / 2.0:.4g}"
        at, to = (f"{low:.4g}", f"{high:.4g}") if self.noise.middle is None else ends[::-1]
        size = f"sd {scale * first:.3g}{unit} at {where} {at}, {scale * last:.3g}{unit} at {to}"
        return {f"sd at {at}": first, f"sd at {to}": last}, size


@dataclass(frozen=True, eq=False)
class OfLevels:
    """A standard deviation for the rows of each level of a group.

    Attributes:
        driver: the group.
        of_level: (levels,) units of the response.
        p: family-wise, over all drivers.
    """

    driver: str
    of_level: FloatArray
    p: float

    def sd(self, level: IntArray) -> FloatArray:
        """(n,) standard deviation of rows of these levels."""
        return np.asarray(self.of_level[level])

    @property
    def ends(self) -> FloatArray:
        """(2,) the smallest and the largest of them."""
        return np.array([self.of_level.min(), self.of_level.max()])


def growth_of(
    left: FloatArray,
    kept: FloatArray,
    drivers: Mapping[str, FloatArray],
    groups: Mapping[str, IntArray] | None = None,
    sensors: int = 1,
) -> Growth | OfLevels | None:
    """The driver with the most significant relation to the noise; None if there is none.

    Args:
        left: (n,) residual with the effects, units of the response, unweighted.
        kept: (n,) share of a row's variance in its residual.
        drivers: (n,) variables on which it may depend, as a line or by the distance from the middle.
        groups: (n,) level of each row, from 0, in groups whose levels may differ.
        sensors: of the run, each of which is asked.
    """
    if len(left) < FEWEST or not np.any(left):
        return None
    squares = _squares(left, kept)
    spans = {name: (float(v.min()), float(v.max())) for name, v in drivers.items()}
    over = {(name, middle): _scaled(v, spans[name]) for name, v in drivers.items() for middle in _middles(v)}
    among = {name: v for name, v in (groups or {}).items() if _few(v)}
    chances = {(name, middle): _chance(squares, _distance(x, middle)) for (name, middle), x in over.items()}
    of_groups = {name: _chance(squares, v[:, None] == np.unique(v)[1:]) for name, v in among.items()}
    every = [*chances.values(), *of_groups.values()]
    least, count = min(every, default=1.0), len(every) * sensors / COUNTED
    if not every or least * count > ALPHA:
        return None
    found: Growth | OfLevels
    # The first of equal ones: a setting and the output fitted over it alone differ by rounding.
    equal = least * (1.0 + 1e-9)
    name = next((one for one, chance in of_groups.items() if chance <= equal), "")
    if name:
        found = OfLevels(name, _of_levels(squares, among[name]), least * count)
    else:
        name, middle = best = next(one for one, chance in chances.items() if chance <= equal)
        found = Growth(name, spans[name], noise_of(left, kept, over[best], middle), least * count)
    return found if found.ends.max() > FACTOR * found.ends.min() else None


def _middles(v: FloatArray) -> tuple[float | None, ...]:
    """Where distances may be from, over the span: nothing over a constant, nowhere over two values."""
    if np.ptp(v) <= 1e-9 * np.max(np.abs(v)):
        return ()
    return (None, 0.5) if np.unique(v).size > 2 else (None,)


def _few(level: IntArray) -> bool:
    return 1 < np.unique(level).size <= level.size // FEWEST_OF_LEVEL


def _of_levels(squares: FloatArray, level: IntArray) -> FloatArray:
    """(levels,) standard deviation of each, from squares (n,) drawn a little to those of all."""
    own = np.bincount(level, squares) + LIKE_ALL * squares.mean()
    return np.asarray(np.sqrt(own / (np.bincount(level) + LIKE_ALL)))


def _scaled(values: FloatArray, span: tuple[float, float]) -> FloatArray:
    """(n,) values, from 0 to 1 over a span."""
    return (values - span[0]) / (span[1] - span[0])


def _distance(values: FloatArray, middle: float | None) -> FloatArray:
    return values if middle is None else np.abs(values - middle)


def _squares(residual: FloatArray, left: FloatArray) -> FloatArray:
    return np.asarray(residual**2 / np.maximum(left, 0.1))


def _chance(squares: FloatArray, drivers: NDArray[Any]) -> float:
    """P of Koenker's test of drivers (n,) or (n, d)."""
    x = drivers.reshape(len(squares), -1) - drivers.mean(axis=0)
    about = squares - squares.mean()
    basis, total = orthonormal(x), float(about @ about)
    if total <= 0.0 or not basis.shape[1]:
        return 1.0
    return float(special.chdtrc(basis.shape[1], len(squares) * float(np.sum((basis.T @ about) ** 2)) / total))
