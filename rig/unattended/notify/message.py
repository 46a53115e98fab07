"""A message to a person: event, place, time, progress, next step. It is the same on every channel."""

from __future__ import annotations

import platform
from dataclasses import dataclass
from datetime import UTC, datetime

from rig.engine.session import Progress
from rig.procedures.column_names import spelled
from rig.procedures.present.durations import duration
from rig.procedures.present.shell import shell_word
from rig.run_file.events.by_hand import AskedByHand, AskedToRead, AskedToSet
from rig.run_file.live import done_command
from rig.unattended.happenings import Happening, Kind, RunFacts, one_line

HEADLINES = {
    Kind.START: "a session began",
    Kind.CRASH: "goes on after a crash or power cut",
    Kind.HOLD: "held",
    Kind.FAULT: "fault, the run goes on",
    Kind.WARNING: "warning, the run goes on",
    Kind.ENDED_BY_FAULT: "ended by a fault",
    Kind.STOP: "stopped on request",
    Kind.INTERRUPT: "interrupted",
    Kind.FINISH: "finished",
    Kind.LOOP: "decided by itself",
    Kind.TEST: "a test message",
    Kind.DUE: "calibrations are due",
}
_AGAIN = (
    " systemd tries again by itself in a minute, five times in six hours at most; if no other message comes, it has "
    "given up and needs you."
)
_ASKED = "waits for a person's hand"
_LONGEST = 2000
URGENT = frozenset({Kind.HOLD, Kind.ENDED_BY_FAULT})
PLACEHOLDERS = ("event", "headline", "message", "what", "where", "when", "progress", "next", "run")
"""Permitted names in `{...}` in `notify.toml`."""


@dataclass(frozen=True)
class Message:
    """A message.

    Attributes:
        kind: kind of its report.
        headline: one line, for subjects and small screens.
        what: what happened.
        where: bench and machine.
        when: UTC and local time.
        progress: progress of the run, "" if unknown.
        next_step: what to do.
        run: the run file, "" if there is none.
        also: summary of messages that were not sent separately, "" if none.
        urgent: whether somebody should come.

    """

    kind: Kind
    headline: str
    what: str
    where: str
    when: str
    progress: str
    next_step: str
    run: str
    also: str = ""
    urgent: bool = False

    @property
    def text(self) -> str:
        """The message as lines."""
        lines = [
            ("What", self.what),
            ("Where", self.where),
            ("When", self.when),
            ("Progress", self.progress),
            ("What next", self.next_step),
            ("Also", self.also),
            ("Run file", self.run),
        ]
        return "\n".join(f"{name + ':':<11}{text}" for name, text in lines if text) + "\n"

    def placeholders(self) -> dict[str, str]:
        """Values for `{...}` in commands and bodies of webhooks, by `PLACEHOLDERS`."""
        return {
            "event": self.kind.value,
            "headline": self.headline,
            "message": self.text,
            "what": self.what,
            "where": self.where,
            "when": self.when,
            "progress": self.progress,
            "next": self.next_step,
            "run": self.run,
        }


def compose(happening: Happening, facts: RunFacts, news: Progress | None) -> Message:
    """A report as a message."""
    mark = "SIMULATED " if facts.simulated else ""
    who = facts.bench or "rig"
    asked = isinstance(happening.event, AskedByHand | AskedToSet | AskedToRead)
    headline = f"{mark}{who}: {_ASKED if asked else HEADLINES[happening.kind]}"
    if happening.unsafe:
        headline = f"{mark}{who}: FAULT, AND NOT SAFE"
    return Message(
        kind=happening.kind,
        headline=one_line(headline),
        what=mark + happening.text[:_LONGEST],
        where=one_line(f"bench {facts.bench}, procedure {facts.procedure}, machine {platform.node()}"),
        when=when(happening.utc_s),
        progress="" if news is None else _progress(news, happening),
        next_step=_next(happening, facts),
        run="" if facts.path is None else one_line(str(facts.path.absolute())),
        urgent=happening.kind in URGENT or happening.unsafe,
    )


def when(utc_s: float) -> str:
    """2026-01-15 02:13 UTC (03:13 CET)."""
    utc = datetime.fromtimestamp(utc_s, UTC)
    local = utc.astimezone()
    here = "" if local.utcoffset() == utc.utcoffset() else f" ({local:%H:%M} {local.tzname()})"
    return f"{utc:%Y-%m-%d %H:%M} UTC{here}"


def _progress(news: Progress, happening: Happening) -> str:
    text = f"{news.done} of {news.total} points in {duration(news.elapsed_s)}"
    over = happening.kind in (Kind.FINISH, Kind.STOP, Kind.INTERRUPT, Kind.ENDED_BY_FAULT)
    if news.remaining_s is None or over:
        return text
    return f"{text}, about {duration(news.remaining_s)} left"


def _by_hand(asked: AskedByHand, run: str) -> str:
    """The next step of a person, and the consequence if nobody does it."""
    value = f", where V is {asked.value}" if asked.value else ""
    late = f"After {duration(asked.timeout_s)} it parks; rig resume {shell_word(run)} then asks again."
    return f"Do it, then: {done_command(run, asked.value)}{value}. rig release does not count as done. {late}"


def _to_set(asked: AskedToSet, run: str) -> str:
    """The next step of a person who sets a factor, and the consequence if nobody does it."""
    late = f"After {duration(asked.timeout_s)} it parks; rig resume {shell_word(run)} then asks again."
    return f"Do it, then: {done_command(run, '')}, with --value V if {asked.factor} is known exactly as V. {late}"


def _to_read(asked: AskedToRead, run: str) -> str:
    """The next step of a person who reads, and the consequence if nobody does it."""
    late = f"After {duration(asked.timeout_s)} it parks; rig resume {shell_word(run)} then asks again."
    where = f"where V is the reading in {spelled(asked.unit)}; rig status says what is wanted next"
    return f"Read it, then: {done_command(run, asked.column)}, {where}. {late}"


def _next(happening: Happening, facts: RunFacts) -> str:
    run = "RUN" if facts.path is None else one_line(str(facts.path.absolute()))
    if happening.unsafe:
        return f"Go and look at the bench now: not everything is in its safe state. Then: rig resume {shell_word(run)}"
    again = _AGAIN if facts.served else ""
    if isinstance(happening.event, AskedToSet):
        return _to_set(happening.event, run)
    if isinstance(happening.event, AskedToRead):
        return _to_read(happening.event, run)
    if isinstance(happening.event, AskedByHand):
        return _by_hand(happening.event, run)
    match happening.kind:
        case Kind.HOLD:
            return (
                f"Look at the bench, then: rig release {shell_word(run)} (or rig stop "
                f"{shell_word(run)} to park it). It waits."
            )
        case Kind.ENDED_BY_FAULT:
            where = f"then: rig resume {shell_word(run)}" if facts.path else "then start again"
            return f"Remove the cause, {where}.{again}"
        case Kind.STOP | Kind.INTERRUPT:
            return f"When ready: rig resume {shell_word(run)}"
        case Kind.FINISH:
            return f"rig fit {shell_word(run)}; rig trace {shell_word(run)} --report night.html"
        case Kind.FAULT | Kind.WARNING:
            return (
                f"Nothing has to be done now. rig status {shell_word(run)} shows more; rig hold "
                f"{shell_word(run)} makes it wait."
            )
        case Kind.CRASH:
            return (
                f"Nothing has to be done; find out why the machine or the program went down. rig "
                f"status {shell_word(run)}"
            )
        case _:
            return "Nothing has to be done."
