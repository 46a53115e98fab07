"""The point of a curve that is nearest to each row, of all its branches, in standard uncertainties.

Newton's method from the measured abscissa ends on the branch where it starts. Here the interval that must hold the
nearest point is searched as a whole: a point of the curve that is nearer than the best one so far has an abscissa
within `u_x` times the distance of that one. Every change of sign of the derivative between two nodes is a minimum.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rig.fitter import ties
from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.nonlinear.curve import Curve, Each

_PASSES, _QUARTER = 8, 0.25
_STEPS, _NEAR, _LAST = 100, 1e-10, 1e-15
"""How near in standard uncertainties of the abscissa: a squared distance is then exact within rounding."""
_ROUGH_STEPS = 2
_WIDER = 1.0 + 1e-9
_BLOCK = 20_000
"""Rows at once: memory does not grow with the table."""


def _nodes(count: int) -> FloatArray:
    """Nodes of the interval from -1 to 1, closer to each other near the measured abscissa."""
    even = np.linspace(-1.0, 1.0, count)
    return np.asarray(np.sign(even) * even**2)


_FINE, _COARSE = _nodes(33), _nodes(17)


@dataclass(frozen=True, eq=False)
class Measured:
    """Measured points and a curve.

    Attributes:
        curve: of k parameters.
        b: (k,) parameters, or (n, k): those of each row.
        table: (n,) columns by name.
        name: of the column with errors.
        y: (n,) response.
        u_x: (n,) standard uncertainty of the column; rows with zero stay where they are.
        u_y: (n,) standard uncertainty of the response, above zero.
    """

    curve: Curve
    b: FloatArray
    table: Mapping[str, FloatArray]
    name: str
    y: FloatArray
    u_x: FloatArray
    u_y: FloatArray

    def nearest(self, guess: FloatArray | None = None, *, rough: bool = False) -> tuple[FloatArray, FloatArray]:
        """(n,) abscissas of the nearest points, and (n,) their squared distances.

        A row at whose measured abscissa the curve has no value stays there, at an infinite distance.

        Args:
            guess: (n,) abscissas to begin with; the nearer they are to the result, the quicker.
            rough: quickly: a distance is not below the least one, and may be a little above it.
        """
        xi, square = self.table[self.name].copy(), np.empty(len(self.y))
        for first in range(0, len(xi), _BLOCK):
            rows = np.arange(first, min(first + _BLOCK, len(xi)))
            square[rows] = self._squares(rows, xi[rows])
            if guess is not None:
                self._lower(rows[np.isfinite(square[rows])], guess, xi, square)
            rows = rows[(self.u_x[rows] > 0.0) & (square[rows] > 0.0) & np.isfinite(square[rows])]
            self._search(rows, xi, square, _COARSE if rough else _FINE)
            rows = rows[square[rows] > 0.0]
            if rough:
                self._few_steps(rows, xi, square)
            elif rows.size:
                self._improve(rows, xi, square)
        return xi, square

    def residuals(self, xi: FloatArray) -> FloatArray:
        """(n,) distances of the points at abscissas (n,), with the sign of the response less the curve."""
        each, left = self._left(np.arange(len(xi)), xi)
        with np.errstate(all="ignore"):
            slope = each.slope(self.name)
            aside = np.where(self.u_x > 0.0, (self.table[self.name] - xi) / self.u_x, 0.0)
            # On a steep curve the response's part is lost in rounding: the sign is that of the abscissa's part there.
            sign = np.where(np.abs(slope) * self.u_x > self.u_y, -aside * np.sign(slope), left)
            return np.asarray(np.copysign(np.hypot(aside, left), sign))

    def columns(self, xi: FloatArray) -> FloatArray:
        """(n, k) derivatives of minus the residuals at the nearest points, by the parameters."""
        each, _ = self._left(np.arange(len(xi)), xi)
        with np.errstate(all="ignore"):
            return each.rows() / np.hypot(self.u_y, each.slope(self.name) * self.u_x)[:, None]

    def _lower(self, rows: IntArray, there: FloatArray, xi: FloatArray, square: FloatArray) -> None:
        """Replace `xi` and `square` of these rows where the point at `there` (n,) is nearer."""
        squares = self._squares(rows, there[rows])
        better = squares < square[rows]
        xi[rows[better]], square[rows[better]] = there[rows[better]], squares[better]

    def _search(self, rows: IntArray, xi: FloatArray, square: FloatArray, share: FloatArray) -> None:
        """Replace `xi` and `square` of these rows by the nearest node.

        A nearer node makes the interval smaller, and then its nodes are closer to each other.
        """
        for _ in range(_PASSES):
            if not rows.size:
                break
            nodes = self._nodes(rows, square, share)
            squares = self._squares(np.repeat(rows, share.size), nodes.ravel()).reshape(nodes.shape)
            best = ties.highest_of_each(-squares.T, 0.0)[:, None]
            lowest = np.take_along_axis(squares, best, 1)[:, 0]
            better, far = lowest < square[rows], lowest < _QUARTER * square[rows]
            xi[rows[better]] = np.take_along_axis(nodes, best, 1)[better, 0]
            square[rows[better]] = lowest[better]
            rows = rows[far]

    def _few_steps(self, rows: IntArray, xi: FloatArray, square: FloatArray) -> None:
        """Gauss-Newton steps from the nearest nodes, where they come nearer."""
        for _ in range(_ROUGH_STEPS):
            if not rows.size:
                break
            each, left = self._left(rows, xi[rows])
            with np.errstate(all="ignore"):
                slope = each.slope(self.name) * self.u_x[rows] / self.u_y[rows]
                aside = (self.table[self.name][rows] - xi[rows]) / self.u_x[rows]
                there = xi.copy()
                there[rows] += self.u_x[rows] * (aside + slope * left) / (1.0 + slope**2)
            self._lower(rows, there, xi, square)

    def _nodes(self, rows: IntArray, square: FloatArray, share: FloatArray) -> FloatArray:
        """(rows, nodes) abscissas in the interval that holds the nearest point."""
        half = self.u_x[rows] * np.sqrt(square[rows]) * _WIDER
        return np.asarray(self.table[self.name][rows, None] + half[:, None] * share)

    def _improve(self, rows: IntArray, xi: FloatArray, square: FloatArray) -> None:
        """Replace `xi` and `square` of these rows where a minimum in the interval is lower."""
        nodes = self._nodes(rows, square, _FINE)
        falls = self._falls(np.repeat(rows, _FINE.size), nodes.ravel()).reshape(nodes.shape)
        i, j = np.nonzero((falls[:, :-1] < 0.0) & (falls[:, 1:] >= 0.0))
        if not i.size:
            return
        found = self._between(rows[i], nodes[i, j], nodes[i, j + 1], falls[i, j], falls[i, j + 1])
        squares = self._squares(rows[i], found)
        order = np.lexsort((squares, i))
        first = order[np.r_[True, np.diff(i[order]) > 0]]  # the lowest of each row
        better = first[squares[first] < square[rows[i[first]]]]
        xi[rows[i[better]]], square[rows[i[better]]] = found[better], squares[better]

    def _between(
        self, rows: IntArray, low: FloatArray, high: FloatArray, fall: FloatArray, rise: FloatArray
    ) -> FloatArray:
        """Where the derivative is zero, between two abscissas at which it is negative and not negative.

        Chandrupatla's method (Advances in Engineering Software 28, 1997): inverse quadratic interpolation where it is
        safe, otherwise bisection.
        """
        # a is the last abscissa, b the other end of the bracket, c the one before; all have one place per bracket.
        a, b, fa, fb = low.copy(), high.copy(), fall.copy(), rise.copy()
        c, fc = b.copy(), fb.copy()
        near = _NEAR * self.u_x[rows] + _LAST * np.abs(self.table[self.name][rows])
        with np.errstate(all="ignore"):
            share = np.where(np.isfinite(fa / (fa - fb)), np.clip(fa / (fa - fb), 0.05, 0.95), 0.5)
            active = np.flatnonzero(fb != 0.0)
            a[fb == 0.0] = b[fb == 0.0]
            for _ in range(_STEPS):
                if not active.size:
                    break
                i = active
                at = a[i] + share[i] * (b[i] - a[i])
                f = self._falls(rows[i], at)
                same = (f < 0.0) == (fa[i] < 0.0)
                c[i], fc[i] = np.where(same, a[i], b[i]), np.where(same, fa[i], fb[i])
                b[i], fb[i] = np.where(same, b[i], a[i]), np.where(same, fb[i], fa[i])
                a[i], fa[i] = at, f
                width = np.abs(b[i] - a[i])
                least = near[i] / width
                part, fell = (a[i] - b[i]) / (c[i] - b[i]), (fa[i] - fb[i]) / (fc[i] - fb[i])
                quadratic = fa[i] / (fb[i] - fa[i]) * fc[i] / (fb[i] - fc[i]) + (c[i] - a[i]) / (b[i] - a[i]) * fa[
                    i
                ] / (fc[i] - fa[i]) * fb[i] / (fc[i] - fb[i])
                safe = (fell**2 < part) & ((1.0 - fell) ** 2 < 1.0 - part) & np.isfinite(quadratic)
                share[i] = np.clip(np.where(safe, quadratic, 0.5), np.minimum(least, 0.5), np.maximum(1.0 - least, 0.5))
                active = i[(f != 0.0) & (2.0 * least < 1.0)]
        return np.where(np.abs(fb) < np.abs(fa), b, a)

    def _squares(self, rows: IntArray, xi: FloatArray) -> FloatArray:
        """Squared distances of the points of the curve at abscissas; infinite where it has no value."""
        _, left = self._left(rows, xi)
        with np.errstate(all="ignore"):
            aside = np.where(
                xi == self.table[self.name][rows], 0.0, (xi - self.table[self.name][rows]) / self.u_x[rows]
            )
            squares = np.asarray(aside**2 + left**2)
        return np.where(np.isnan(squares), np.inf, squares)

    def _falls(self, rows: IntArray, xi: FloatArray) -> FloatArray:
        """Half of the derivatives of the squared distances by the abscissas."""
        each, left = self._left(rows, xi)
        with np.errstate(all="ignore"):
            aside = (xi - self.table[self.name][rows]) / self.u_x[rows] ** 2
            return np.asarray(aside - left * each.slope(self.name) / self.u_y[rows])

    def _left(self, rows: IntArray, xi: FloatArray) -> tuple[Each, FloatArray]:
        """The curve at abscissas, and the responses less its values in standard uncertainties."""
        table = {name: column[rows] for name, column in self.table.items()}
        table[self.name] = xi
        each = Each(self.curve, self.b if self.b.ndim == 1 else self.b[rows], table)
        with np.errstate(all="ignore"):
            return each, np.asarray((self.y[rows] - each.value()) / self.u_y[rows])
