"""State of a run: the lines that `rig status RUN` prints, and its JSON.

Lines about acceptance: `rig/runs/accepted.py`; the list of a folder: `rig/cli/status.py`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.markup import escape

from rig.drivers.clock import RealClock
from rig.engine.early_warning import warnings_in
from rig.engine.time_left import left_when_resumed_s
from rig.errors import RigError
from rig.procedures.present.as_json import finite
from rig.procedures.present.blocks import Block, Line, simulated_mark
from rig.procedures.present.durations import duration
from rig.procedures.present.shell import shell_word
from rig.run_file.events.bench import Fault
from rig.run_file.live import asked_by_hand, done_command, read_live, settling_now, silent_s
from rig.run_file.read.safe_opening import sensible
from rig.run_file.state.elsewhere import goes_on_in
from rig.run_file.verify.verification import CUT_SHORT, glance
from rig.runs.accepted import Acceptance
from rig.runs.plans import has_plan, stored_plan

if TYPE_CHECKING:
    from rig.run_file.chain import Record
    from rig.run_file.damage.audit import Finding
    from rig.run_file.events.by_hand import DoneByHand
    from rig.run_file.read.reader import RunReader
    from rig.run_file.state.state import RunState

_FAULTS_TOLD, _QUIET_S = 5, 60.0
"""Latest faults that are listed; silence of a controller that is worth a word (it signs every few seconds)."""
VERIFIED = 100_000
"""Maximum number of records of a run that is verified for its status: about two seconds."""


@dataclass(frozen=True)
class Status:
    """State of a run.

    Attributes:
        path: the run file.
        state: state by its records.
        told: the JSON of `rig status --json`.
        acceptance: acceptance of a complete run.
        wrong: defect of the file; None if there is none, or it was not verified.
        other: the file in which it continues.
    """

    path: Path
    state: RunState
    told: Mapping[str, Any]
    acceptance: Acceptance
    wrong: Finding | None
    other: Path | None

    @property
    def broken(self) -> bool:
        """Whether the file was edited or damaged, not only truncated."""
        return self.wrong is not None and self.wrong.where not in CUT_SHORT

    def to_json(self) -> dict[str, Any]:
        """The JSON of `rig status --json`."""
        found: dict[str, Any] = finite(self.told)
        return found

    def blocks(self) -> Iterable[Block]:
        """Lines for people."""
        with sensible(self.path):
            return list(self._blocks())

    def _blocks(self) -> Iterator[Block]:
        told, state, running = self.told, self.state, self.told["running"]
        what, where, name = (escape(str(one)) for one in (told["procedure"], told["bench"], self.path))
        yield Line(f"{simulated_mark(state.simulated)}[bold]{what}[/] on {where}: {escape(told['state'])}")
        left = "" if told["remaining_s"] is None else f", {duration(told['remaining_s'])} left"
        if left and not running:
            left = f", about {duration(told['remaining_s'])} left once it is resumed"
        yield Line(f"  {told['accepted']} of {told['points']} points in {duration(told['elapsed_s'])}{left}")
        by = f" by {escape(', '.join(state.operators))}" if state.operators else ""
        yield Line(f"  {told['sessions']} session(s){by}, last record {told['last_record_utc']}")
        yield Line(f"  head {told['head']} of {told['records']} records")
        yield from self.acceptance.blocks("  ")
        yield from self._whole(name)
        for index, why in told["skipped"].items():
            yield Line(f"  [yellow]point {index} skipped:[/] {escape(why)}")
        for number, why in told["whole_plots_lost"].items():
            yield Line(f"  [yellow]whole plot {number} was lost and measured again:[/] {escape(why)}")
        if told["kept_of_lost"]:
            yield Line(f"  readings kept of lost whole plots, as rows of their own in tables: {told['kept_of_lost']}")
        for words in told["warnings"]:
            yield Line(f"  [bold yellow]warning:[/] {escape(words)}")
        yield from self._faults()
        if told["message"]:
            yield Line(f"  {escape(told['message'])}")
        for one in told["settling"]:
            yield Line(f"  settling: {escape(_settling(one))}")
        yield from self._way_forward(name)

    def _whole(self, name: str) -> Iterator[Block]:
        """Lines about the integrity of the file."""
        if self.wrong is not None and not self.broken:
            again = "rig resume measures again what is gone"
            yield Line(f"  [bold yellow]cut short:[/] {escape(str(self.wrong))}; {again}")
        elif self.wrong is not None:
            trust = f"Do not trust these figures; rig verify {escape(shell_word(self.path))} lists all defects"
            yield Line(f"  [bold red]NOT WHOLE:[/] edited or damaged: {escape(str(self.wrong))}. {trust}")
        elif self.told["whole"] is None:
            yield Line(
                f"  not verified, {self.told['records']} records need some time: rig verify "
                f"{escape(shell_word(self.path))}"
            )

    def _faults(self) -> Iterator[Block]:
        """Faults so far, decisions about them, and persistent problems."""
        state = self.state
        if state.decisions:
            counts = ", ".join(f"{decision} {count}x" for decision, count in state.decisions.items())
            yield Line(f"  [yellow]faults and decisions:[/] {escape(counts)}")
            for record in list(state.faults)[-_FAULTS_TOLD:]:
                yield Line(f"    {escape(f'{duration(record.elapsed_s)}: {record.sentence()}')}")
        if self.told["running"] or state.ended is not None:
            return
        for words in state.left_on:
            yield Line(f"  [bold yellow]left on:[/] {escape(words)}")
        if state.last_fault:
            yield Line(f"  [red]last fault:[/] {escape(state.last_fault)}")
        if state.unsafe:
            yield Line(f"  [bold red]NOT in its safe state:[/] {escape('; '.join(state.unsafe))}")

    def _way_forward(self, name: str) -> Iterator[Block]:
        state, running = self.state, self.told["running"]
        quiet_s = silent_s(self.path, RealClock().utc()) if running else 0.0
        if quiet_s > _QUIET_S:
            yield Line(f"  [bold yellow]no sign of life from its controller for {duration(quiet_s)}[/]")
        if self.other is not None:
            yield Line("  [bold yellow]it was moved or replaced during the run, which continues in another file[/]")
        elif state.rescued:
            lost = f"continues in {escape(state.rescued)}, which does not exist: look for it before you resume here"
            yield Line(f"  [bold yellow]{lost}[/]")
        if not running and state.ended is None and not self.broken:
            yield Line(f"  continue with: rig resume {escape(shell_word(self.other or self.path))}")


def status_of(run_file: Path) -> Status:
    """State of a run, running or not. Raises `UsageError` or `RunFileError` if it cannot be read."""
    with sensible(run_file):
        return _status(run_file)


def _status(run_file: Path) -> Status:
    reader, state, wrong, looked = glance(run_file, VERIFIED)
    with reader:
        run = reader.about()
        count, head = reader.head()
        other = goes_on_in(reader, state)
        said = read_live(run_file)
        running, live = said is not None, said or {}
        settling = _settling_now(reader, live) if running else []
        broken = wrong is not None and wrong.where not in CUT_SHORT
        remaining_s = live.get("remaining_s") if running or broken else _left_when_resumed_s(reader, state, run_file)
    summary: dict[str, Any] = {
        "run_id": state.run_id,
        "simulated": state.simulated,
        "procedure": run.procedure or "",
        "bench": run.bench or "",
        "state": live["state"] if running else state.ended or state.rested,
        "running": running,
        "points": state.points,
        "accepted": len(state.accepted),
        "skipped": {str(k): v for k, v in state.skipped.items()},
        "sessions": state.sessions,
        "operators": state.operators,
        "elapsed_s": live.get("elapsed_s", state.elapsed_s),
        "remaining_s": remaining_s,
        "last_record_utc": datetime.fromtimestamp(state.utc_s, UTC).isoformat(timespec="seconds"),
        "last_fault": state.last_fault,
        "decisions": state.decisions,
        "faults": [_fault(record) for record in state.faults],
        "safe": state.safe,
        "left_on": state.left_on,
        "message": f"{live.get('message', '')} {live.get('detail', '')}".strip() if running else "",
        "settling": settling,
        "to_do": _to_do(live, run_file),
        "by_hand": [_done(event) for _, event in sorted(state.by_hand.items())],
        "warnings": warnings_in(run_file),
        "whole_plots_lost": {str(k): v for k, v in state.lost.items()},
        "kept_of_lost": state.kept,
        "records": count,
        "head": head.hex(),
        "whole": False if wrong else True if looked else None,
        "finding": str(wrong) if wrong else "",
        "goes_on_in": str(other) if other else None,
    }
    judged = state.ended == "complete" and state.accepted and not broken
    acceptance = Acceptance.of_run(run_file) if judged else Acceptance()
    summary["acceptance"] = acceptance.to_json()
    return Status(run_file, state, summary, acceptance, wrong, other)


def _settling_now(reader: RunReader, live: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The quantities that the run waits for: name, unit, instrument, value, target, band, outcome, seconds waited."""
    found = settling_now(live, reader.factors() if live.get("settling") else ())
    last = [one.pop("samples")[-1:] for one in found]
    return [{**one, "value": sample[0][1] if sample else None} for one, sample in zip(found, last, strict=True)]


def _settling(one: Mapping[str, Any]) -> str:
    """A quantity that settles, in a line."""
    by = f" ({one['by']})" if one["by"] not in ("", one["name"]) else ""
    now = "not read yet" if one["value"] is None else f"reads {one['value']:.6g}"
    waited = "" if one["for_s"] is None else f", for {duration(one['for_s'])}"
    return f"{one['name']}{by} {now}, {one['target']:g} within {one['band']:g} {one['unit']} is asked{waited}"


def _to_do(live: Mapping[str, Any], run_file: Path) -> dict[str, Any] | None:
    """The step by hand that the run waits for; None if there is none."""
    asked = asked_by_hand(live)
    if asked is None:
        return None
    command = done_command(run_file, asked.value)
    return {"step": asked.step, "of": asked.of, "say": asked.say, "value": asked.value or None, "command": command}


def _done(event: DoneByHand) -> dict[str, Any]:
    stated = {} if event.number is None else {event.value: event.number}
    about = {"step": event.step, "change": event.change, "say": event.say}
    return {**about, "who": event.who, "waited_s": event.waited_s, **stated}


def _left_when_resumed_s(reader: RunReader, state: RunState, run_file: Path) -> float | None:
    """Expected remaining time of an interrupted run, seconds; None if unknown."""
    if state.ended is not None or not has_plan(reader):
        return None
    try:
        plan = stored_plan(reader, run_file, None)
        return left_when_resumed_s(reader, state, plan.run_list, plan.procedure.conduct, plan.bench)
    except RigError:
        return None  # defects of the file are reported elsewhere


def _fault(record: Record) -> dict[str, Any]:
    event = record.event
    assert isinstance(event, Fault)
    about = {"elapsed_s": record.elapsed_s, "point": record.run_index}
    return about | {"message": event.message, "decision": event.decided}
