"""Proposing a run: its dry run on the twins, and a proposal with all bytes that decide the real one."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from rig.drivers.clock import Clock
from rig.engine.early_warning import warnings_in
from rig.engine.safe_state import outputs_on
from rig.engine.session import Progress, Signals
from rig.errors import ConfigurationError, UsageError
from rig.instruments.guarded import watch_readbacks
from rig.instruments.opening import Bench
from rig.lab import Laboratory, laboratory_in
from rig.lab.laboratory import Proposal
from rig.lab.proposals import propose as write
from rig.run_file.events.laboratory import Proposed
from rig.runs.controller import Result, Site, opened, start_run
from rig.runs.plans import Plan, load_plan
from rig.who import Operator

FOLDER = "proposals"
_MOST_TEXT = 8 << 20


@dataclass
class Extremes:
    """Lowest and highest values that were read back, and what stays on at the end.

    Attributes:
        reached: (low, high) by quantity with unit.
        left_on: sentences.
    """

    reached: dict[str, tuple[float, float]]
    left_on: list[str] = field(default_factory=list)

    def add(self, quantity: str, value: float) -> None:
        """Take a value."""
        low, high = self.reached.get(quantity, (value, value))
        self.reached[quantity] = min(low, value), max(high, value)


def proposed(
    procedure: Path, bench: Path, by: Operator, *, why: str = "", on_progress: Callable[[Progress], None]
) -> Proposal:
    """Run a procedure dry, and propose it.

    Args:
        procedure: the procedure file.
        bench: the bench file, in a laboratory with people. `world.toml` beside it is the truth of the dry run.
        by: who proposes it.
        why: reason.
        on_progress: called with the progress of the dry run.

    Raises:
        ConfigurationError: a file is wrong.
        UsageError: the bench is in no laboratory with people.
    """
    laboratory = laboratory_in(bench.parent)
    laboratory.note_changes(by)
    plan = load_plan(procedure, bench)
    if sum(map(len, plan.documents.values())) > _MOST_TEXT:
        raise UsageError(
            f"{procedure} and the files with it have more than {_MOST_TEXT >> 20} MB: propose less at once"
        )
    world = bench.with_name("world.toml")
    rehearsed = load_plan(procedure, bench, dry=True, world=world if world.exists() else None)
    if any(plan.documents[name] != rehearsed.documents.get(name) for name in plan.documents):
        raise ConfigurationError(f"{procedure} or {bench} changed meanwhile: propose them again")
    return write(laboratory, _proposal(laboratory, plan, _rehearsal(laboratory, rehearsed, by, on_progress), by, why))


def _rehearsal(
    laboratory: Laboratory, plan: Plan, by: Operator, on_progress: Callable[[Progress], None]
) -> dict[str, Any]:
    """The dry run, and what it came to."""
    extremes = Extremes(dict(plan.run_list.extremes()))

    @contextlib.contextmanager
    def watched(plan: Plan, **how: Any) -> Iterator[tuple[Bench, Clock, str]]:
        with opened(plan, **how) as (bench, clock, boot):
            for instrument in bench.instruments.values():
                watch_readbacks(instrument, extremes.add)
            yield bench, clock, boot
            extremes.left_on = outputs_on(bench, bench.instruments)

    result = start_run(
        plan,
        laboratory.folder / FOLDER,
        signals=Signals(),
        announce=lambda _: None,
        on_progress=on_progress,
        site=replace(Site(), opened=watched),
        by=by,
    )
    return _told(result, extremes, plan)


def _told(result: Result, extremes: Extremes, plan: Plan) -> dict[str, Any]:
    state = result.state
    return {
        "outcome": result.outcome.value,
        "message": result.message,
        "hours": round(state.elapsed_s / 3600.0, 3),
        "points": state.points,
        "observed": len(state.accepted),
        "extremes": {name: [round(low, 6), round(high, 6)] for name, (low, high) in sorted(extremes.reached.items())},
        "left_on": extremes.left_on,
        "warnings": list(warnings_in(result.path)),
        "steps_by_hand": len(plan.run_list.steps),
        "world": "world.toml" in plan.documents,
        "file": f"{FOLDER}/{result.path.name}",
        "head": result.head,
    }


def _proposal(laboratory: Laboratory, plan: Plan, dry: dict[str, Any], by: Operator, why: str) -> Proposed:
    assert plan.path is not None
    procedure, bench = (_within(laboratory, path) for path in (plan.path, plan.bench_path))
    return Proposed(
        number=0,
        procedure=procedure,
        bench=bench,
        documents=dict(plan.documents),
        run_list=plan.run_list.sha256(),
        dry=dry,
        why=why,
        who=by.name,
        who_by=by.by,
    )


def _within(laboratory: Laboratory, path: Path | None) -> str:
    """A path in the laboratory's folder, or an absolute one."""
    assert path is not None
    absolute = path.absolute()
    return str(absolute.relative_to(laboratory.folder) if absolute.is_relative_to(laboratory.folder) else absolute)
