"""Two runs as one problem, for comparisons of explanations with any instruments."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from fitter.arrays import FloatArray
from fitter.linear import orthonormal
from fitter.trace.aliases import NOTHING_LEFT

Candidates = Sequence[Any]
"""Terms of effects, each of a kind's own class; all have effect, term and sensor."""


def solve(columns: FloatArray, outputs: FloatArray) -> FloatArray:
    """(q,) least-squares coefficients of columns (n, q) in any units; zero for a zero column."""
    length = np.linalg.norm(columns, axis=0)
    length = np.where(length > 0, length, 1.0)
    return np.asarray(np.linalg.lstsq(columns / length, outputs, rcond=1e-10)[0] / length)


def left(columns: FloatArray, outputs: FloatArray) -> FloatArray:
    """(n,) residual of the outputs after fitting `columns` (n, q)."""
    return np.asarray(outputs - columns @ solve(columns, outputs)) if columns.shape[1] else outputs


@dataclass(frozen=True, eq=False)
class Own:
    """Own error of a group of observations (a replication, a whole plot).

    Attributes:
        rows: the observations.
        basis: (m, q) its orthonormal directions, in units of the error.
        kept: (q,) weights of components along them.
    """

    rows: NDArray[np.int64]
    basis: FloatArray
    kept: FloatArray

    @classmethod
    def of(cls, rows: NDArray[np.int64], columns: FloatArray) -> Own:
        """Columns (m, q) whose coefficients are random with variance one, in units of the error."""
        u, s, _ = np.linalg.svd(columns, full_matrices=False)
        return cls(rows, u, 1.0 / np.sqrt(1.0 + s**2))


@dataclass(frozen=True, eq=False)
class Together(ABC):
    """A first run and a later one.

    Attributes:
        fresh: (n,) whether an observation is of the later run.
    """

    fresh: NDArray[np.bool_]

    @property
    @abstractmethod
    def data(self) -> Any:
        """Observations of both runs."""

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the S outputs."""
        return tuple(self.data.outputs)

    @property
    @abstractmethod
    def df(self) -> int:
        """Degrees of freedom of the error's estimate."""

    @property
    @abstractmethod
    def realigned(self) -> bool:
        """Whether the first run does not determine the declared model's parameters in the later one."""

    @property
    @abstractmethod
    def loose(self) -> FloatArray:
        """(n, l) the later run's own parameters, estimated from it for its prediction: none, a zero, or an
        alignment.
        """

    @property
    def raw_outputs(self) -> FloatArray:
        """(S, n) measured outputs."""
        return np.stack([self.data.outputs[s] for s in self.sensors])

    @property
    @abstractmethod
    def sigma(self) -> FloatArray:
        """(S, n) standard deviation of a reading."""

    @property
    @abstractmethod
    def slope(self) -> FloatArray:
        """(S,) output per unit of the inferred quantity: V/g, or mV/psi."""

    @property
    @abstractmethod
    def declared(self) -> tuple[FloatArray, ...]:
        """(n, d) columns of the declared model, for each sensor."""

    @property
    @abstractmethod
    def own(self) -> tuple[tuple[Own, ...], ...]:
        """Own errors of replications or whole plots, for each sensor."""

    @abstractmethod
    def raw(self, terms: Candidates) -> FloatArray:
        """(S, n, q) unweighted columns of effects, zero for sensors without the term."""

    @abstractmethod
    def only(self, rows: NDArray[np.bool_]) -> Self:
        """The same with some of the observations."""

    def stacked(self, columns: FloatArray) -> FloatArray:
        """(S n, q) columns (S, n, q) of all sensors, stacked and weighted, with the declared model removed."""
        return np.concatenate([self.without_declared(i, self.weigh(i, own)) for i, own in enumerate(columns)])

    @cached_property
    def outputs(self) -> FloatArray:
        """(S n,) outputs, stacked and weighted, with the declared model removed."""
        return self.stacked(self.raw_outputs[:, :, None])[:, 0]

    def columns_of(self, terms: Candidates) -> FloatArray:
        """(S n, q) columns of effects, likewise; zero if next to nothing of one remains."""
        raw = self.raw(terms)
        rest = self.stacked(raw)
        return np.where(self._something_left(raw, rest), rest, 0.0)

    def leverage(self, rows: NDArray[np.bool_]) -> float:
        """Degrees of freedom used by the declared model of all sensors in some of the observations."""
        return float(sum(np.sum(basis[rows] ** 2) for basis in self._bases))

    def columns_in(self, terms: Candidates, where: NDArray[np.bool_]) -> FloatArray:
        """(S n, q) columns of effects in some of the observations, zero in the others."""
        raw = self.raw(terms) * where[:, None]
        rest = self.stacked(raw)
        return np.where(self._something_left(raw, rest), rest, 0.0)

    @property
    def shifts(self) -> FloatArray:
        """(S n, S) a separate offset of each sensor in the later run."""
        fresh = np.einsum("n,ij->inj", self.fresh.astype(np.float64), np.eye(len(self.sensors)))
        return self.stacked(fresh)

    @property
    def again(self) -> FloatArray:
        """(S n, q) the declared model of each sensor, in the later run only."""
        widths = [own.shape[1] for own in self.declared]
        raw = np.zeros((len(self.sensors), self.fresh.size, sum(widths)))
        start = 0
        for i, own in enumerate(self.declared):
            raw[i, :, start : start + widths[i]] = own * self.fresh[:, None]
            start += widths[i]
        rest = self.stacked(raw)
        return np.asarray(rest[:, self._something_left(raw, rest)])

    def weigh(self, i: int, columns: FloatArray) -> FloatArray:
        """(n, q) columns of sensor `i` in units of its error, with own errors of groups weighted down."""
        weighed = columns / self.sigma[i][:, None]
        for own in self.own[i]:
            part = weighed[own.rows]
            weighed[own.rows] = part - own.basis @ ((1.0 - own.kept)[:, None] * (own.basis.T @ part))
        return np.asarray(weighed)

    def _something_left(self, raw: FloatArray, rest: FloatArray) -> NDArray[np.bool_]:
        """(q,) whether more than rounding remains of columns, (S, n, q) unweighted and (S n, q) stacked."""
        whole = np.sqrt(sum(np.sum(self.weigh(i, own) ** 2, axis=0) for i, own in enumerate(raw)))
        return np.asarray(np.linalg.norm(rest, axis=0) > NOTHING_LEFT * whole)

    def without_declared(self, i: int, weighed: FloatArray) -> FloatArray:
        """(n, q) weighted columns of sensor `i`, with the declared model removed."""
        basis = self._bases[i]
        return np.asarray(weighed - basis @ (basis.T @ weighed))

    @cached_property
    def _bases(self) -> tuple[FloatArray, ...]:
        return tuple(orthonormal(self.weigh(i, own)) for i, own in enumerate(self.declared))
