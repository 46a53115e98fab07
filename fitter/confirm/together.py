"""Two runs as one problem: what a comparison of explanations needs, whatever the instruments are."""

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
"""Terms of effects, each of a kind's own class; the classes meet in effect, term and sensor."""


def solve(columns: FloatArray, outputs: FloatArray) -> FloatArray:
    """(q,) least-squares coefficients of columns (n, q) in whatever units; zero for a column that is zero."""
    length = np.linalg.norm(columns, axis=0)
    length = np.where(length > 0, length, 1.0)
    return np.asarray(np.linalg.lstsq(columns / length, outputs, rcond=1e-10)[0] / length)


def left(columns: FloatArray, outputs: FloatArray) -> FloatArray:
    """(n,) what `columns` (n, q) leave of the outputs."""
    return np.asarray(outputs - columns @ solve(columns, outputs)) if columns.shape[1] else outputs


@dataclass(frozen=True, eq=False)
class Own:
    """What a group of observations (a replication, a whole plot) has of its own.

    Attributes:
        rows: the observations.
        basis: (m, q) orthonormal directions of it, in units of the error.
        kept: (q,) by how much what lies along them is weighed down.

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
    """A first run and what came later.

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
        """Degrees of freedom the error is known with."""

    @property
    @abstractmethod
    def realigned(self) -> bool:
        """Whether the first run does not say what the declared model's parameters are in the later one."""

    @property
    @abstractmethod
    def loose(self) -> FloatArray:
        """(n, l) what is the later run's own and taken from it when it is predicted; none, a zero, or an alignment."""

    @property
    def raw_outputs(self) -> FloatArray:
        """(S, n) outputs as they were read."""
        return np.stack([self.data.outputs[s] for s in self.sensors])

    @property
    @abstractmethod
    def sigma(self) -> FloatArray:
        """(S, n) standard deviation of a reading."""

    @property
    @abstractmethod
    def slope(self) -> FloatArray:
        """(S,) output per unit of what is inferred from it: V/g, or mV/psi."""

    @property
    @abstractmethod
    def declared(self) -> tuple[FloatArray, ...]:
        """For each sensor (n, d) the declared model."""

    @property
    @abstractmethod
    def own(self) -> tuple[tuple[Own, ...], ...]:
        """For each sensor what replications or whole plots have of their own."""

    @abstractmethod
    def raw(self, terms: Candidates) -> FloatArray:
        """(S, n, q) columns of effects as they are, zero for the sensors that a term does not concern."""

    @abstractmethod
    def only(self, rows: NDArray[np.bool_]) -> Self:
        """The same with some of the observations."""

    def stacked(self, columns: FloatArray) -> FloatArray:
        """(S n, q) weighed, the declared model taken out: columns (S, n, q) of all sensors under one another."""
        return np.concatenate([self.without_declared(i, self.weigh(i, own)) for i, own in enumerate(columns)])

    @cached_property
    def outputs(self) -> FloatArray:
        """(S n,) the outputs so."""
        return self.stacked(self.raw_outputs[:, :, None])[:, 0]

    def columns_of(self, terms: Candidates) -> FloatArray:
        """(S n, q) the columns of effects so; zero where next to nothing is left of one."""
        raw = self.raw(terms)
        rest = self.stacked(raw)
        return np.where(self._something_left(raw, rest), rest, 0.0)

    def leverage(self, rows: NDArray[np.bool_]) -> float:
        """Degrees of freedom that the declared model of all sensors takes from some of the observations."""
        return float(sum(np.sum(basis[rows] ** 2) for basis in self._bases))

    def columns_in(self, terms: Candidates, where: NDArray[np.bool_]) -> FloatArray:
        """(S n, q) the columns of effects as they are in some of the observations, zero in the others."""
        raw = self.raw(terms) * where[:, None]
        rest = self.stacked(raw)
        return np.where(self._something_left(raw, rest), rest, 0.0)

    @property
    def shifts(self) -> FloatArray:
        """(S n, S) an offset of its own for the later run, of each sensor."""
        fresh = np.einsum("n,ij->inj", self.fresh.astype(np.float64), np.eye(len(self.sensors)))
        return self.stacked(fresh)

    @property
    def again(self) -> FloatArray:
        """(S n, q) the declared model of each sensor in the later run alone."""
        widths = [own.shape[1] for own in self.declared]
        raw = np.zeros((len(self.sensors), self.fresh.size, sum(widths)))
        start = 0
        for i, own in enumerate(self.declared):
            raw[i, :, start : start + widths[i]] = own * self.fresh[:, None]
            start += widths[i]
        rest = self.stacked(raw)
        return np.asarray(rest[:, self._something_left(raw, rest)])

    def weigh(self, i: int, columns: FloatArray) -> FloatArray:
        """(n, q) columns of sensor `i` in units of its error, what groups have of their own weighed down."""
        weighed = columns / self.sigma[i][:, None]
        for own in self.own[i]:
            part = weighed[own.rows]
            weighed[own.rows] = part - own.basis @ ((1.0 - own.kept)[:, None] * (own.basis.T @ part))
        return np.asarray(weighed)

    def _something_left(self, raw: FloatArray, rest: FloatArray) -> NDArray[np.bool_]:
        """(q,) whether more than rounding is left of columns, (S, n, q) as they are and (S n, q) stacked."""
        whole = np.sqrt(sum(np.sum(self.weigh(i, own) ** 2, axis=0) for i, own in enumerate(raw)))
        return np.asarray(np.linalg.norm(rest, axis=0) > NOTHING_LEFT * whole)

    def without_declared(self, i: int, weighed: FloatArray) -> FloatArray:
        """(n, q) weighed columns of sensor `i`, the declared model taken out."""
        basis = self._bases[i]
        return np.asarray(weighed - basis @ (basis.T @ weighed))

    @cached_property
    def _bases(self) -> tuple[FloatArray, ...]:
        return tuple(orthonormal(self.weigh(i, own)) for i, own in enumerate(self.declared))
