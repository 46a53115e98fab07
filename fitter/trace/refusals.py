"""Causes that the data ask for and physics forbids: they are named, and refused."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Protocol

from fitter.trace.aliases import Named, Rival
from fitter.trace.signs import Impossible, Refused, refused


class SignedJudge(Protocol):
    """What is asked of a judge, whatever its strata are."""

    @property
    def problem(self) -> Any:
        """The run: it has `sensors`."""

    @property
    def candidates(self) -> Sequence[Named]:
        """All there are."""

    def alone(self, chosen: tuple[int, ...]) -> Sequence[Impossible]:
        """Candidates that stand out beside those `chosen`, but for the sign that they would need."""


def refusals(
    judge: SignedJudge,
    chosen: tuple[int, ...],
    classes: Mapping[str, Sequence[Rival]],
    slopes: Mapping[str, float],
) -> tuple[Refused, ...]:
    """Every cause that was refused for its sign, each once a sensor or set of sensors: first those for which another
    was named, then those that still stand out beside what was found.

    Args:
        judge: after the search.
        chosen: what was found.
        classes: all explanations of each effect found, by its name.
        slopes: output of each sensor per unit of what is measured, as sizes are told with it: V/g, mV/psi.

    """
    out: dict[tuple[str, tuple[str, ...]], Refused] = {}
    for instead_of, found in _wrong(judge, chosen, classes):
        term: Any = judge.candidates[found.candidate]
        concerned = tuple(judge.problem.sensors) if term.sensor is None else (term.sensor,)
        one = refused(term, found, instead_of, slopes, concerned)
        out.setdefault((one.effect, one.sensors), one)
    return tuple(out.values())


def _wrong(
    judge: SignedJudge, chosen: tuple[int, ...], classes: Mapping[str, Sequence[Rival]]
) -> Iterator[tuple[str, Impossible]]:
    for name, explanations in classes.items():
        for rival in explanations:
            yield from ((name, found) for found in rival.refused)
    named = {judge.candidates[j].effect.name for j in chosen}
    for found in judge.alone(chosen):
        if judge.candidates[found.candidate].effect.name not in named:  # else another value of its constant
            yield "", found
