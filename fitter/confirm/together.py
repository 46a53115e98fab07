"""A traced run and further ones as one problem, for comparisons of explanations with any instruments."""

from __future__ import annotations

import itertools
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from rig.fitter.arrays import FloatArray
from rig.fitter.effects.manual_changes import Done
from rig.fitter.linear import orthonormal
from rig.fitter.trace.aliases import NOTHING_LEFT

if TYPE_CHECKING:
    from rig.fitter.confirm.question import Question

Candidates = Sequence[Any]
"""Terms of effects, each of a kind's own class; all have effect, term and sensor."""


RANK = 1e-8
"""Share of the largest singular value below which a direction is undetermined."""
BETWEEN = 1e-3
"""Share of its largest value by which a column differs between groups of readings, if it is not equal in all."""


def solve(columns: FloatArray, outputs: FloatArray) -> FloatArray:
    """(q,) or (q, k) least-squares coefficients of columns (n, q) in any units, of outputs (n,) or (n, k).

    Zero for a zero column.
    """
    length = np.linalg.norm(columns, axis=0)
    length = np.where(length > 0, length, 1.0)
    return np.asarray((np.linalg.lstsq(columns / length, outputs, rcond=1e-10)[0].T / length).T)


def left(columns: FloatArray, outputs: FloatArray) -> FloatArray:
    """(n,) or (n, k) residual of the outputs after fitting `columns` (n, q)."""
    return np.asarray(outputs - columns @ solve(columns, outputs)) if columns.shape[1] else outputs


@dataclass(frozen=True, eq=False)
class Fit:
    """Coefficients of columns that may not all be determined.

    Attributes:
        estimate: (q,) or (q, k) the shortest least-squares solution, for columns of length one.
        spread: (q, r) matrix whose product with r independent standard normal numbers has their covariance.
    """

    estimate: FloatArray
    spread: FloatArray

    @classmethod
    def of(cls, columns: FloatArray, outputs: FloatArray) -> Fit:
        """Least squares of columns (n, q) on outputs (n,) or (n, k), k estimates side by side."""
        length = np.linalg.norm(columns, axis=0)
        length = np.where(length > 0, length, 1.0)
        u, s, vt = np.linalg.svd(columns / length, full_matrices=False)
        kept = s > RANK * s.max(initial=0.0)
        spread = (vt[kept].T / s[kept]) / length[:, None]
        return cls(spread @ (u[:, kept].T @ outputs), spread)


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
class Resized:
    """Columns for the sizes that effects have after a change by a person.

    Attributes:
        of: index of the term of each column.
        raw: (S, n, q) unweighted columns, zero before the change.
    """

    of: tuple[int, ...]
    raw: FloatArray


@dataclass(frozen=True, eq=False)
class Together(ABC):
    """A first run and later ones. "The later run" means all of them.

    Attributes:
        run: (n,) number of the run of each observation: 0 for the first, then in order of time.
        done: changes that a person makes in later runs, with masks over all n observations.
    """

    run: NDArray[np.int64]
    done: tuple[Done, ...] = field(default=(), kw_only=True)

    @cached_property
    def fresh(self) -> NDArray[np.bool_]:
        """(n,) whether an observation is of a later run."""
        return self.run > 0

    @cached_property
    def last(self) -> NDArray[np.bool_]:
        """(n,) whether an observation is of the last run: of a planned one in a forecast."""
        return np.asarray(self.run == self.run.max(initial=0))

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
    def predicted(self) -> NDArray[np.bool_]:
        """(n,) observations of later runs with the parameters of the first one."""
        return self.fresh & (not self.realigned)

    @property
    @abstractmethod
    def own_response(self) -> bool:
        """Whether sensors that nobody moved may have another response in the later run."""

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

    @cached_property
    def own_df(self) -> tuple[int, ...]:
        """Degrees of freedom of the variance of own errors in the first run, for each sensor; 0 without any."""
        out = []
        for i, every in enumerate(self.own):
            groups = [own for own in every if not self.fresh[own.rows[0]]]
            if not groups:
                out.append(0)
                continue
            declared = self.weigh(i, self.declared[i])
            means = np.array([declared[own.rows].mean(0) for own in groups])
            out.append(max(len(groups) - int(np.linalg.matrix_rank(means, tol=1e-6 * np.abs(means).max())), 1))
        return tuple(out)

    @property
    def used_up(self) -> int:
        """Number of groups with own errors in the last run if it has no more of them than the declared model of a
        sensor has coefficients that differ between them; 0 otherwise.
        """
        for i, every in enumerate(self.own):
            means = np.array([self.declared[i][own.rows].mean(0) for own in every if self.last[own.rows[0]]])
            largest = np.max(np.abs(means), axis=0, initial=0.0) if means.size else np.zeros(0)
            varies = largest > 0
            means = means[:, varies] / largest[varies] if means.size else means
            if 0 < len(means) <= np.linalg.matrix_rank(means, tol=BETWEEN):
                return len(means)
        return 0

    @abstractmethod
    def untouched(self, terms: Candidates) -> FloatArray:
        """(S, n, q) unweighted columns of effects as if nobody changed the bench, zero for sensors without the term."""

    def about(self, question: Question) -> tuple[Together, Question]:
        """The runs and a question without sensors that have no part in it; as they are if any may have one."""
        return self, question

    def shapes(self, *, lasting: bool) -> Iterator[tuple[str, FloatArray]]:
        """(S, n, m) smooth unweighted columns over what was recorded in the later run, each place after its name.

        Args:
            lasting: whether those over time and temperature are left out.
        """
        yield from ()

    @abstractmethod
    def only(self, rows: NDArray[np.bool_]) -> Self:
        """These runs with some of the observations only."""

    def raw(self, terms: Candidates) -> FloatArray:
        """(S, n, q) unweighted columns of effects with the sizes of the first run, zero where a person changed them."""
        columns = self.untouched(terms)
        for k, term in enumerate(terms):
            for done in self._on(term):
                columns[:, done.after, k] = 0.0
        return columns

    def resized(self, terms: Candidates) -> Resized:
        """Columns for the sizes after changes by a person, one for each term and change that gives it another size."""
        of: list[int] = []
        masks: list[NDArray[np.bool_]] = []
        for k, term in enumerate(terms):
            changes = self._on(term)
            for number, done in enumerate(changes):
                ended = [later.after for later in changes[number + 1 :]]
                rows = done.after & ~np.logical_or.reduce([np.zeros_like(done.after), *ended])
                if term.effect.influence(done.word) == "resizes" and rows.any():
                    of.append(k)
                    masks.append(rows)
        raw = self.untouched([terms[k] for k in of])
        for column, rows in enumerate(masks):
            raw[:, ~rows, column] = 0.0
        return Resized(tuple(of), raw)

    def _on(self, term: Any) -> list[Done]:
        """Changes that have an influence on a term, in order."""
        own = [done for done in self.done if term.effect.influence(done.word) is not None]
        return sorted(own, key=lambda done: -int(done.after.sum()))

    def resized_columns(self, terms: Candidates) -> FloatArray:
        """(S n, q) those columns, stacked, weighted and with the declared model removed."""
        rest, something = self._left_of(self.resized(terms).raw)
        return np.where(something, rest, 0.0)

    def all_columns_of(self, terms: Candidates) -> FloatArray:
        """(S n, q) columns of effects, also for their sizes after changes by a person."""
        return np.column_stack([self.columns_of(terms), self.resized_columns(terms)])

    def stacked(self, columns: FloatArray) -> FloatArray:
        """(S n, q) columns (S, n, q) of all sensors, stacked and weighted, with the declared model removed."""
        return np.concatenate([self.without_declared(i, self.weigh(i, own)) for i, own in enumerate(columns)])

    @cached_property
    def outputs(self) -> FloatArray:
        """(S n,) outputs, stacked and weighted, with the declared model removed."""
        return self.stacked(self.raw_outputs[:, :, None])[:, 0]

    def columns_of(self, terms: Candidates) -> FloatArray:
        """(S n, q) columns of effects, likewise; zero if next to nothing of one remains."""
        rest, something = self._left_of(self.raw(terms))
        return np.where(something, rest, 0.0)

    def leverage(self, rows: NDArray[np.bool_]) -> float:
        """Degrees of freedom used by the declared model of all sensors in some of the observations."""
        return float(sum(np.sum(basis[rows] ** 2) for basis in self._bases))

    def columns_in(self, terms: Candidates, where: NDArray[np.bool_]) -> FloatArray:
        """(S n, q) columns of effects in some of the observations, zero in the others."""
        rest, something = self._left_of(self.raw(terms) * where[:, None])
        return np.where(something, rest, 0.0)

    @property
    def shifts(self) -> FloatArray:
        """(S n, S k) a separate offset of each sensor in each of k later runs."""
        each = (np.eye(int(self.run.max(initial=0)) + 1)[self.run])[:, 1:]
        fresh = np.einsum("nk,ij->injk", each, np.eye(len(self.sensors)))
        return self.stacked(fresh.reshape(len(self.sensors), self.run.size, -1))

    @property
    def again(self) -> FloatArray:
        """(S n, q) the declared model of each sensor, in each later run only; not in the first of those there are."""
        masks = [self.predicted & (self.run == k) for k in np.unique(self.run)[1:]]
        blocks = []
        for own, rows in itertools.product(enumerate(self.declared), masks):
            block = np.zeros((len(self.sensors), self.run.size, own[1].shape[1]))
            block[own[0]] = own[1] * rows[:, None]
            blocks.append(block)
        if not blocks:
            return np.zeros((self.outputs.size, 0))
        rest, something = self._left_of(np.concatenate(blocks, axis=2))
        return np.asarray(rest[:, something])

    def weigh(self, i: int, columns: FloatArray) -> FloatArray:
        """(n, q) columns of sensor `i` in units of its error, with own errors of groups weighted down."""
        weighed = columns / self.sigma[i][:, None]
        for own in self.own[i]:
            part = weighed[own.rows]
            weighed[own.rows] = part - own.basis @ ((1.0 - own.kept)[:, None] * (own.basis.T @ part))
        return np.asarray(weighed)

    def _left_of(self, raw: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
        """(S n, q) unweighted columns (S, n, q), as `stacked`; (q,) whether more than rounding remains of each."""
        weighed = [self.weigh(i, own) for i, own in enumerate(raw)]
        rest = np.concatenate([self.without_declared(i, own) for i, own in enumerate(weighed)])
        whole = np.sqrt(sum(np.sum(own**2, axis=0) for own in weighed))
        return rest, np.asarray(np.linalg.norm(rest, axis=0) > NOTHING_LEFT * whole)

    def without_declared(self, i: int, weighed: FloatArray) -> FloatArray:
        """(n, q) weighted columns of sensor `i`, with the declared model removed."""
        basis = self._bases[i]
        return np.asarray(weighed - basis @ (basis.T @ weighed))

    @cached_property
    def _bases(self) -> tuple[FloatArray, ...]:
        return tuple(orthonormal(self.weigh(i, own)) for i, own in enumerate(self.declared))
