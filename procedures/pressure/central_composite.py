"""Central composite designs in two factors, for the temperatures of a split plot."""

from __future__ import annotations

from math import sqrt


def spherical(factorial: int, axial_first: int, axial_second: int, centre: int) -> list[tuple[float, float]]:
    """Spherical central composite design in two coded factors: every outer point at distance 1 from the centre.

    Args:
        factorial: number of repeats of each of the four factorial points.
        axial_first: number of repeats of each of the two axial points of the first factor.
        axial_second: the same for the second factor.
        centre: number of repeats of the centre.

    Returns:
        Coded pairs; -1 and 1 are a factor's extremes, which its axial points reach (Myers and Montgomery, Response
        Surface Methodology, chapter 7, with axial distance sqrt(2) scaled to 1).
    """
    c = sqrt(0.5)
    corners = [(x, y) for x in (-c, c) for y in (-c, c)]
    first, second = [(-1.0, 0.0), (1.0, 0.0)], [(0.0, -1.0), (0.0, 1.0)]
    return factorial * corners + axial_first * first + axial_second * second + centre * [(0.0, 0.0)]
