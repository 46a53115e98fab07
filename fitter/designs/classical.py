"""Grids and central composite designs.

G. E. P. Box and K. B. Wilson, J. R. Statist. Soc. B 13 (1951) 1; G. E. P. Box and J. S. Hunter, Ann. Math. Statist. 28
(1957) 195 for rotatability and orthogonal blocks; NIST/SEMATECH e-Handbook of Statistical Methods, 5.3.3.6.1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.errors import FitError

Kind = Literal["circumscribed", "face-centred", "inscribed"]
Alpha = Literal["rotatable", "orthogonal-blocks", "spherical"]

LARGEST_CUBE = 10
"""Largest number of factors in a cube, 1024 points."""


def grid(levels: Sequence[ArrayLike]) -> FloatArray:
    """(n, k) all combinations of the levels of k factors, in the order as written; the last factor changes fastest."""
    return np.array(list(product(*[np.asarray(each, np.float64).tolist() for each in levels])), np.float64)


def to_range(coded: FloatArray, low: ArrayLike, high: ArrayLike) -> FloatArray:
    """(n, k) settings of coded points: -1 is `low` and +1 is `high` of each factor.

    Axial points of a circumscribed design lie outside: with `low` and `high` as hard limits, use an inscribed one.
    """
    low, high = np.asarray(low, np.float64), np.asarray(high, np.float64)
    return np.asarray(0.5 * (low + high) + 0.5 * (high - low) * coded)


def plots_by_setting(points: FloatArray, hard: Sequence[int]) -> IntArray:
    """(n,) whole plots of a design in which every combination of hard factors' settings is set once.

    Args:
        points: (n, k).
        hard: indices of hard-to-change factors; without any all points are in one whole plot.
    """
    return np.asarray(np.unique(points[:, list(hard)], axis=0, return_inverse=True)[1].reshape(-1), np.int64)


@dataclass(frozen=True, eq=False)
class CentralComposite:
    """A central composite design, in coded units.

    Attributes:
        points: (n, k), block by block: the cube and its centre points, then the axial points and theirs.
        block: (n,) block of each point, from 0; all 0 if blocks were not asked for.
        alpha: distance of axial points from the centre over that of a cube's face.
    """

    points: FloatArray
    block: IntArray
    alpha: float


def central_composite(
    factors: int,
    *,
    kind: Kind = "circumscribed",
    alpha: Alpha | float = "rotatable",
    centre: tuple[int, int] | int = (0, 4),
    half: bool = False,
    blocks: Literal[1, 2, 3] = 1,
) -> CentralComposite:
    """Cube, axial points and centre points for a quadratic model.

    Args:
        factors: number k of factors, from 2.
        kind: "circumscribed" has the cube at +-1 and axial points at +-alpha; "inscribed" is the same over alpha, so
            that no point is outside +-1; "face-centred" has alpha = 1.
        alpha: "rotatable" is F^(1/4) for F points of the cube, which makes the variance of a prediction depend on the
            distance from the centre alone; "orthogonal-blocks" makes block effects and coefficients independent;
            "spherical" is sqrt(k); or a number.
        centre: number of centre points with each block of the cube and with the axial points; one number is that with
            the axial points.
        half: use half of the cube, the last factor being the product of the others; from 5 factors on, where it still
            determines all products of two factors.
        blocks: 2 separates cube and axial points; 3 also divides the cube by the sign of the product of all factors,
            from 3 factors on.

    Raises:
        FitError: the combination does not exist; the message says why.
    """
    counts = (0, centre) if isinstance(centre, int) else centre
    _check(factors, half, blocks, counts)
    cube = np.array(list(product((-1.0, 1.0), repeat=factors - half)))
    if half:
        cube = np.column_stack([cube, np.prod(cube, axis=1)])
    parts = [cube]
    if blocks == 3:
        sign = np.prod(cube, axis=1)
        parts = [cube[sign > 0], cube[sign < 0]]
    distance = 1.0 if kind == "face-centred" else _distance(alpha, parts, counts)
    axial = distance * np.stack([np.eye(factors), -np.eye(factors)], axis=1).reshape(-1, factors)
    groups = [*[_with_centre(part, counts[0]) for part in parts], _with_centre(axial, counts[1])]
    points = np.vstack(groups)
    if kind == "inscribed":
        points = points / max(distance, 1.0)
    block = np.repeat(np.arange(len(groups)), [len(group) for group in groups])
    return CentralComposite(points, np.asarray(block if blocks > 1 else 0 * block, np.int64), float(distance))


def _check(factors: int, half: bool, blocks: int, centre: tuple[int, int]) -> None:
    if not 2 <= factors <= LARGEST_CUBE:
        raise FitError(f"a central composite design has 2 to {LARGEST_CUBE} factors, not {factors}")
    if half and factors < 5:
        raise FitError(f"half a cube of {factors} factors does not determine their products; use the whole cube")
    if blocks == 3 and (half or factors < 3):
        raise FitError("the cube is divided into two blocks only if it is whole and has three factors or more")
    if min(centre) < 0:
        raise FitError("the number of centre points is negative")


def _distance(alpha: Alpha | float, cube: list[FloatArray], centre: tuple[int, int]) -> float:
    """Distance of the axial points, in units of that of the cube's faces."""
    size, factors = sum(map(len, cube)), cube[0].shape[1]
    if alpha == "rotatable":
        return float(size**0.25)
    if alpha == "spherical":
        return float(np.sqrt(factors))
    if alpha == "orthogonal-blocks":
        # every block has the same mean square of each factor (Box and Hunter 1957, section 8)
        per_block = len(cube[0])
        return float(np.sqrt(factors * (1 + centre[1] / (2 * factors)) / (1 + centre[0] / per_block)))
    if not (isinstance(alpha, int | float) and np.isfinite(alpha) and alpha > 0):
        raise FitError(f"alpha is a positive number or one of rotatable, orthogonal-blocks and spherical, not {alpha}")
    return float(alpha)


def _with_centre(points: FloatArray, count: int) -> FloatArray:
    return np.vstack([points, np.zeros((count, points.shape[1]))])
