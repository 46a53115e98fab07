"""Causes that the data suggest but physics forbids: they are named, and refused."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Protocol

from rig.fitter.trace.aliases import Named, Rival
from rig.fitter.trace.signs import Impossible, Refused, refused


class SignedJudge(Protocol):
    """Requirements on a judge, for any strata."""

    @property
    def problem(self) -> Any:
        """The run, with its `sensors`."""

    @property
    def candidates(self) -> Sequence[Named]:
        """All candidates."""

    def forbidden(self, chosen: tuple[int, ...]) -> Sequence[Impossible]:
        """Candidates that are significant beside those `chosen`, except for their required sign."""


def refusals(
    judge: SignedJudge,
    chosen: tuple[int, ...],
    classes: Mapping[str, Sequence[Rival]],
    slopes: Mapping[str, float],
) -> tuple[Refused, ...]:
    """Every cause refused for its sign, once per sensor or set of sensors: first those replaced by another, then those
    still significant beside the findings.

    Args:
        judge: after the search.
        chosen: the findings.
        classes: all explanations of each effect found, by its name.
        slopes: output of each sensor per unit of the measured quantity, for sizes: V/g, mV/psi.
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
    for found in judge.forbidden(chosen):
        if judge.candidates[found.candidate].effect.name not in named:  # otherwise another value of its constant
            yield "", found
