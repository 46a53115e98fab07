"""Traces of several runs of one bench: what comes back in the others is of the bench, what does not is of its run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from rich.markup import escape

from rig.fitter.confirm import Confirmation
from rig.fitter.confirm.judgement import Returns
from rig.procedures.present.blocks import Block, Grid, Line
from rig.verbs.confirm.answers import judge, listed
from rig.verbs.confirm.first import First, open_asked


@dataclass(frozen=True, eq=False)
class Returning:
    """An effect that the traces of some runs found, held against each of the other runs.

    Attributes:
        effect: name in the trace of the first of them.
        found_in: numbers of the runs whose trace found it or a cause that looks alike, from 0.
        said: by number of each other run than the first of these, what it says.
        causes: explanations that no run excludes; "" where together they exclude all.
        excluded: explanations that the first of these runs alone leaves, and others exclude.
        sizes: by number of a run, the size that its own trace gives, by sensor.
    """

    effect: str
    found_in: tuple[int, ...]
    said: Mapping[int, Returns]
    causes: tuple[str, ...]
    excluded: tuple[str, ...]
    sizes: Mapping[int, Mapping[str, str]]

    @property
    def sentence(self) -> str:
        """The answers of all runs in a sentence."""
        name = " or ".join(self.causes or (self.effect,))
        in_run = {said: [i for i, one in self.said.items() if one == said] for said in _SAID}
        more = f" Together they exclude {listed(self.excluded)}." if self.excluded and self.causes else ""
        if not self.causes:
            more = " No cause of its class explains all of them: it is another, or several."
        if in_run["other size"]:
            return (
                f"{name} is in {_runs((*self.found_in, *in_run['shown']))} and has another size in "
                f"{_runs(in_run['other size'])}: it changes between runs.{more}"
            )
        if in_run["shown"]:
            told = f"{name} is in {_runs((*self.found_in, *in_run['shown']))}"
            if in_run["absent"]:
                return f"{told} and is absent in {_runs(in_run['absent'])}: it comes and goes with the bench.{more}"
            return f"{told}: it is of the bench or of the sensors.{more}"
        if in_run["absent"]:
            return f"{name} is of {_runs(self.found_in)}: {_runs(in_run['absent'])} would show it, and do not.{more}"
        return f"{name}: {_runs(in_run['unknown'])} cannot tell whether it comes back: too short, or other settings."

    def to_json(self, paths: Sequence[Path]) -> dict[str, Any]:
        """JSON values for `rig trace --json`."""
        return {
            "effect": self.effect,
            "found_in": [str(paths[i]) for i in self.found_in],
            "said": {str(paths[i]): said for i, said in self.said.items()},
            "causes": list(self.causes),
            "excluded": list(self.excluded),
            "sizes": {str(paths[i]): dict(sizes) for i, sizes in self.sizes.items()},
            "sentence": self.sentence,
        }


@dataclass(frozen=True, eq=False)
class Several:
    """Traced runs of one bench.

    Attributes:
        runs: in order of time.
    """

    runs: tuple[First, ...]

    @cached_property
    def returning(self) -> tuple[Returning, ...]:
        """Every effect that a trace found, once. Raises `UsageError`, as for `judge`."""
        classes: list[tuple[int, str, set[str], list[int]]] = []
        for i, first in enumerate(self.runs):
            for question in first.questions:
                alike = {member.effect for member in question.members if not member.near}
                same = next((one for one in classes if i not in one[3] and one[2] & alike), None)
                if same is None:
                    classes.append((i, question.effect, alike, [i]))
                else:
                    same[3].append(i)
        judged = {
            (i, k): {one.effect: one for one in judge(first, other.path, anywhen=True).answers}
            for i, first in enumerate(self.runs)
            if any(i == one[0] for one in classes)
            for k, other in enumerate(self.runs)
            if k != i
        }
        return tuple(
            self._returning(name, alike, found, {k: answers[name] for (j, k), answers in judged.items() if j == i})
            for i, name, alike, found in classes
        )

    def _returning(
        self, name: str, alike: set[str], found: Sequence[int], answers: Mapping[int, Confirmation]
    ) -> Returning:
        said = {k: _said(answer) for k, answer in answers.items()}
        left = set(alike)
        for k, answer in answers.items():
            if said[k] == "shown":
                left &= {one.effect for one in answer.members if one.returns == "shown" and one.holds} or left
        sizes = {
            k: {outcome.sensor: one.size for outcome in self.runs[k].traced.outcomes for one in outcome.named
                if one.effect in alike}
            for k in found
        }  # fmt: skip
        order = sorted(alike, key=lambda effect: (effect != name, effect))
        return Returning(
            effect=name,
            found_in=tuple(found),
            said=said,
            causes=tuple(effect for effect in order if effect in left),
            excluded=tuple(effect for effect in order if effect not in left),
            sizes=sizes,
        )

    def to_json(self) -> dict[str, Any]:
        """JSON values for `rig trace --json`: of each run, and what comes back."""
        paths = [one.path for one in self.runs]
        return {
            "runs": {str(one.path): one.traced.to_json() for one in self.runs},
            "returning": [one.to_json(paths) for one in self.returning],
        }

    def blocks(self) -> Iterator[Block]:
        """Findings of every run in a line a sensor, then what comes back."""
        for number, one in enumerate(self.runs, start=1):
            yield Line(f"[bold]run {number}[/] {escape(str(one.path))}")
            for outcome in one.traced.outcomes:
                named = ", ".join(found.effect for found in outcome.named) or "no effect"
                yield Line(f"  {escape(outcome.sensor)}: [bold]{outcome.verdict}[/]: {escape(named)}", wrapped=True)
        yield Line()
        if not self.returning:
            yield Line("the trace of no run has an effect: there is nothing that could come back")
            return
        table = Grid(("effect", *(f"run {number}" for number in range(1, len(self.runs) + 1))))
        for each in self.returning:
            cells = ("found" if i in each.found_in else each.said[i] for i in range(len(self.runs)))
            table.add_row(escape(each.effect), *cells)
        yield table
        for each in self.returning:
            yield Line(f"  {escape(each.sentence)}", wrapped=True)
            for i, sizes in each.sizes.items():
                yield Line(f"    run {i + 1}: {escape('; '.join(f'{s} {size}' for s, size in sizes.items()))}")


_SAID: tuple[Returns, ...] = ("shown", "other size", "absent", "unknown")


def _said(answer: Confirmation) -> Returns:
    """Answer for the explanation that is seen best; a misfit by what else the other run has does not count."""
    return min((member.returns for member in answer.members), key=_SAID.index)


def _runs(numbers: Sequence[int]) -> str:
    every = [str(number + 1) for number in sorted(set(numbers))]
    return f"run{'s' * (len(every) > 1)} {listed(every)}"


def several(paths: Sequence[Path], given: Mapping[str, Any]) -> Several:
    """Trace runs of one bench.

    Args:
        paths: two run files or more, in any order.
        given: options of `rig trace`.

    Raises:
        UsageError: one is no run file, or cannot be traced.
    """
    return Several(
        tuple(sorted((open_asked(path, {"quick": False, **given}) for path in paths), key=lambda one: one.began_utc_s))
    )
