"""Rotations of NASA/TP-1999-209835, appendix A, as 3x3 matrices.

Left-hand rotations of coordinates: a vector's components in the turned frame are matrix times components in the
previous frame. Matrices are tuples of rows and vectors tuples, since a simulated reading rotates a handful of vectors
and an array library costs more than the arithmetic. Angles are in radians.
"""

from __future__ import annotations

from math import cos, sin

Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]

GRAVITY: Vector = (0.0, 0.0, -1.0)
"""Gravity in the laboratory's axes, in g; z points up (appendix A, figure A1)."""


def pitch_matrix(angle: float) -> Matrix:
    """T_alpha, eq. (110): rotation about the y axis."""
    c, s = cos(angle), sin(angle)
    return ((c, 0.0, -s), (0.0, 1.0, 0.0), (s, 0.0, c))


def roll_matrix(angle: float) -> Matrix:
    """T_R, eq. (111): rotation about the x axis."""
    c, s = cos(angle), sin(angle)
    return ((1.0, 0.0, 0.0), (0.0, c, s), (0.0, -s, c))


def yaw_matrix(angle: float) -> Matrix:
    """T_Y, eq. (112): rotation about the z axis."""
    c, s = cos(angle), sin(angle)
    return ((c, s, 0.0), (-s, c, 0.0), (0.0, 0.0, 1.0))


def apply(matrix: Matrix, vector: Vector) -> Vector:
    """Matrix times column vector."""
    (a, b, c), (d, e, f), (g, h, i) = matrix
    x, y, z = vector
    return (a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z)


def turned_gravity(pitch: float, roll: float) -> Vector:
    """`GRAVITY` in axes turned by pitch, then by roll: T_R T_alpha times it, multiplied out."""
    z = -cos(pitch)
    return (sin(pitch), sin(roll) * z, cos(roll) * z)


def compose(second: Matrix, first: Matrix) -> Matrix:
    """Matrix of the rotation `first` followed by `second`: their product, `second` on the left."""
    columns = tuple(zip(*first, strict=True))
    rows = [tuple(sum(p * q for p, q in zip(row, column, strict=True)) for column in columns) for row in second]
    return (_vector(rows[0]), _vector(rows[1]), _vector(rows[2]))


def _vector(row: tuple[float, ...]) -> Vector:
    x, y, z = row
    return (x, y, z)


def dot(u: Vector, v: Vector) -> float:
    """Scalar product."""
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
