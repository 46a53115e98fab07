"""Significance of candidates in a whole-plot run, and what else explains as much."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rig.fitter import ties
from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.trace.aliases import DELTA, PER_COLUMN, Products, Rival, best_first, rivals, simplest
from rig.fitter.trace.chance import ALPHA
from rig.fitter.trace.engine.beside import Coefficient, View, White
from rig.fitter.trace.engine.judge import TableJudge
from rig.fitter.trace.engine.sensors import RunJudge
from rig.fitter.trace.signs import SURE, Impossible
from rig.fitter.trace.whitened import Whitened
from rig.procedures.pressure.trace.posed import candidate, engine_of, white_of
from rig.procedures.pressure.trace.problem import Problem

NOTHING_LEFT = 0.02
"""Minimum remaining share of a candidate beside the others: above the scatter of temperature readbacks about their
setting.
"""


@dataclass(frozen=True, eq=False)
class WholePlotJudge(RunJudge):
    """A `rig.fitter.trace.search.Judge` of whole-plot runs.

    Attributes:
        problem: the run.
        estimates: fits known so far: `estimate`.
    """

    problem: Problem
    estimates: dict[Any, Any] = field(default_factory=dict)
    _white: dict[bytes, White] = field(default_factory=dict)
    _tables: dict[int, tuple[TableJudge, IntArray]] = field(default_factory=dict)

    @classmethod
    def of(cls, problem: Problem, known: WholePlotJudge | None = None) -> WholePlotJudge:
        """The judge of a run, given one of the same run with other weights, if any."""
        return cls(problem.candidates, *engine_of(problem, known), problem)

    def unit(self, j: int) -> tuple[int, ...]:
        """Every candidate separately."""
        return (j,)

    def refined(self, chosen: tuple[int, ...]) -> WholePlotJudge:
        """Unchanged: searched constants are those of the catalogue."""
        return self

    def part(self, rest: Problem, kept: IntArray, chosen: Iterable[int]) -> WholePlotJudge:
        """The same for the `rest` of the run, of the rows `kept`."""
        return replace(self.rows(kept, chosen), problem=rest, estimates={}, _white={}, _tables={})

    def table(self, i: int) -> tuple[TableJudge, IntArray]:
        """Transducer `i` by itself, with all candidates that concern it, and their numbers in the run."""
        if len(self.alone) == 1:
            return self.alone[0], self.own[0]
        if i not in self._tables:
            sensors = (None, self.problem.sensors[i])
            numbers = np.array([j for j, c in enumerate(self.candidates) if c.sensor in sensors], np.int64)
            own = tuple(candidate(self.problem, int(j), self.problem.raw[i][:, [j]]) for j in numbers)
            self._tables[i] = TableJudge(replace(self.alone[i].problem, candidates=own)), numbers
        return self._tables[i]

    def in_table(self, i: int, chosen: Iterable[int]) -> tuple[int, ...]:
        """Those of some candidates that concern transducer `i`, by their number there."""
        numbers = self.table(i)[1].tolist()
        return tuple(numbers.index(j) for j in chosen if j in numbers)

    def held(self, chosen: Iterable[int]) -> FloatArray:
        """(S, n) outputs; readings that stand alone beside those `chosen` are reduced to three standard deviations."""
        chosen = tuple(chosen)
        every = range(len(self.problem.sensors))
        return np.stack([self.table(i)[0].held(self.in_table(i, chosen)) for i in every])

    def white(self, chosen: Sequence[int]) -> White:
        """The run over the likeliest errors beside those `chosen`."""
        covariances, held = self.likeliest(chosen), self.held(chosen)
        key = covariances.tobytes() + held.tobytes()
        if key not in self._white:
            self._white.clear()
            self._white[key] = white_of(replace(self.problem, outputs=held), covariances)
        return self._white[key]

    def coefficients(self, chosen: Sequence[int]) -> dict[int, Coefficient]:
        """Coefficients of the `chosen` candidates, each beside all others."""
        return self.white(chosen).coefficients(chosen)

    def forbidden(self, chosen: tuple[int, ...]) -> tuple[Impossible, ...]:
        """Candidates that are significant beside those `chosen`, except for their required sign: the clearest of each
        effect and transducer.
        """
        if not np.any(self.signs):
            return ()
        value, error = self.white(chosen).alone(chosen)
        clearest: dict[tuple[str, str | None], int] = {}
        wrong = np.flatnonzero(self.signs * value < -SURE * error)
        for j in wrong[ties.descending(np.abs(value[wrong] / error[wrong]))].tolist():
            clearest.setdefault((self.candidates[j].effect.name, self.candidates[j].sensor), j)
        found = (j for j in clearest.values() if self.p_unsigned(chosen, j) <= ALPHA)
        return tuple(Impossible(j, float(value[j]), float(error[j])) for j in found)

    def lead(self, explanations: Sequence[Rival]) -> Rival:
        """The simplest of the indistinguishable ones; a suspected one leads only if there is no other."""
        suspected = {c.effect.name for c in self.candidates if c.effect.on_suspicion}
        return simplest([r for r in explanations if r.alias and r.effect not in suspected] or explanations)

    def rivals(self, chosen: tuple[int, ...], effect: str) -> tuple[Rival, ...]:
        """All explanations for the terms of `effect` among `chosen`."""
        return self._rivals(chosen, effect, np.inf)

    def alike(self, chosen: tuple[int, ...], effect: str) -> tuple[Rival, ...]:
        """The same without most that are not aliases."""
        return self._rivals(chosen, effect, DELTA)

    def products(self, chosen: Sequence[int], rest: Sequence[int], able: NDArray[np.bool_] | None = None) -> Products:
        """Products of columns beside the `rest`, over the errors beside those `chosen`; of those `able` (J,) alone."""
        white = self.white(chosen)
        view = white.view(None, rest, white.view(None, chosen).sigma)
        every = range(len(self.candidates)) if able is None else np.flatnonzero(able).tolist()
        columns = view.of(every, range(len(self.problem.sensors))).reshape(*view.outputs.shape, -1)
        return Products.of(Whitened(view.outputs, columns), None, (np.array(every, np.int64), len(self.candidates)))

    def _rivals(self, chosen: tuple[int, ...], effect: str, within: float) -> tuple[Rival, ...]:
        every = self.candidates
        group = tuple(j for j in chosen if every[j].effect.name == effect)
        rest = tuple(j for j in chosen if j not in group)
        line = any(every[j].sensor is None for j in group)
        sensors = self.problem.sensors if line else {str(every[j].sensor) for j in group}
        white = self.white(chosen)
        mine = np.array([c.sensor is None or c.sensor in sensors for c in every])
        able = mine & (self._plausible(*white.alone(rest)) | np.isin(np.arange(len(every)), group))
        able &= self._left(white.view(None, rest, white.view(None, chosen).sigma))
        searched = {e.name for c in every if (e := c.effect).searched and (len(sensors) == 1 or not c.sensor)}
        products = replace(self.products(chosen, rest, able), signs=self.signs)
        own = self._tried(Rival(effect, group, 0.0, effect in searched))
        found = rivals(every, products, group, rest, sensors, searched=searched, within=within + own)
        price = np.array([rival.sigmas**2 + self._tried(rival) for rival in found])
        least = min(p for p, rival in zip(price.tolist(), found, strict=True) if not rival.refused)
        price = np.sqrt(np.maximum(price, least) - least)
        return best_first([replace(one, sigmas=float(own)) for one, own in zip(found, price.tolist(), strict=True)])

    def _tried(self, rival: Rival) -> float:
        """Price of a searched constant in addition to a column's price: the best of m columns gains 2 ln m by
        chance.
        """
        gained = 2.0 * float(np.log(self._values[rival.terms[0]]))
        return max(gained - PER_COLUMN * rival.searched, 0.0)

    @cached_property
    def _values(self) -> IntArray:
        """(J,) number of searched values of a candidate's constant; one without such a constant."""
        each = zip(self.candidates, self.problem.judged_at, strict=True)
        kind = [(c.effect.name, c.sensor, level) for c, level in each]
        count = Counter(kind)
        return np.array([count[k] if c.effect.searched else 1 for c, k in zip(self.candidates, kind, strict=True)])

    def _plausible(self, value: FloatArray, error: FloatArray) -> NDArray[np.bool_]:
        """(J,) candidates whose coefficient may have a possible size, or certainly has an impossible sign: those are
        refused by name.
        """
        most = np.array([c.effect.at_most for c in self.candidates], np.float64)
        return np.asarray((np.abs(value) - SURE * error <= most) | (self.signs * value < -SURE * error))

    @cached_property
    def signs(self) -> FloatArray:
        """(J,) physical sign of each candidate's coefficient; 0 if both are possible. A line's error is one of
        pressure, independent of sensitivities; a transducer's own is relative to its output.
        """
        return np.array([c.effect.sign(c.term.name) for c in self.candidates], np.float64)

    def _left(self, view: View) -> NDArray[np.bool_]:
        """(J,) candidates that have a sufficient remainder beside the model."""
        every, sensors = range(len(self.candidates)), range(len(self.problem.sensors))
        length = np.linalg.norm(view.white.beside[1] / view.sigma[:, None], axis=0)
        return np.asarray(np.linalg.norm(view.of(every, sensors), axis=0) > NOTHING_LEFT * length)
