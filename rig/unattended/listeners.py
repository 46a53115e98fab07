"""The listeners of a session: log, notifications, service manager. The controller sees one observer and never waits for
it.

An error in a listener loses reports, but never ends a run.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rig.drivers.clock import RealClock
from rig.engine.session import Outcome, Progress
from rig.engine.states import AT_POINT, State
from rig.errors import UsageError
from rig.procedures.present.durations import duration
from rig.run_file.chain import Record
from rig.run_file.events.event import Event
from rig.run_file.events.sessions import NotNotified
from rig.unattended.early_look import EarlyLook
from rig.unattended.happenings import Happening, Kind, RunFacts, from_record, one_line
from rig.unattended.logs import Log
from rig.unattended.manager import ServiceManager

if TYPE_CHECKING:  # mail and web are imported only if they are needed
    from rig.unattended.notify.notifier import Failure, Notifier

_PROGRESS_S = 3600.0
_REASONS = 20
_ENDINGS = {
    Outcome.COMPLETE: (Kind.FINISH, "info"),
    Outcome.STOPPED: (Kind.STOP, "info"),
    Outcome.INTERRUPTED: (Kind.INTERRUPT, "warning"),
    Outcome.FAULT: (Kind.ENDED_BY_FAULT, "error"),
    Outcome.UNSAFE: (Kind.ENDED_BY_FAULT, "error"),
}


class Listeners:
    """All listeners of a session, as the controller's observer.

    Args:
        facts: facts about the run; a new run's file is set by `opened`.
        manager: the service manager.

    Attributes:
        facts: facts about the run.
        logs: logs that receive lines.
        notifier: sends messages to people, None if nobody is notified.
        look: traces the run so far in the background.

    """

    def __init__(self, facts: RunFacts, manager: ServiceManager | None = None) -> None:
        self.facts = facts
        self.logs: list[Log] = []
        self.notifier: Notifier | None = None
        self.look = EarlyLook()
        if facts.path is not None:
            self.look.begins(facts.path)
        self._manager = manager or ServiceManager(environment={})
        self._clock = RealClock()
        self._utc_minus_elapsed: float | None = None
        self._phase = ""
        self._tenth = 0
        self._progress_s = 0.0
        self._last: Progress | None = None
        self._failures: deque[Failure] = deque(maxlen=100)
        self._untold: dict[tuple[str, str], Counter[str]] = {}
        self._trouble = ""

    def opened(self, path: Path, run_id: str) -> None:
        """Note that the run file exists."""
        self.facts = replace(self.facts, path=path, run_id=run_id)
        self.look.begins(path)

    def lasts(self) -> None:
        """Note that this process goes on after a run has parked: the service manager is not told that it stops."""
        self._manager.lasts = True

    # --- what the controller calls --------------------------------------------------------------------------------

    def recorded(self, record: Record) -> None:
        """A record was appended."""
        try:
            self._utc_minus_elapsed = record.utc_s - record.elapsed_s
            self.look.recorded(record)
            happening = from_record(record, after_crash=self.facts.after_crash)
            if happening is not None:
                self._spread(happening)
        except Exception as error:  # an error here must not end a run
            self._in_trouble(error)

    def to_note(self) -> Sequence[Event]:
        """Events that the observer wants in the run file; each is returned once: what early looks found, and messages
        that could not be sent.
        """
        noted: list[Event] = [*self.look.to_note()]
        while self._failures:
            failure = self._failures.popleft()
            noted.append(NotNotified(channel=failure.channel, about=str(failure.about), why=one_line(failure.why)))
        return noted

    def progress(self, news: Progress) -> None:
        """Take the sequencer's progress; called at every change of state, and about once a bench second."""
        try:
            self._manager.progress(news)
            self._last = news
            if self.notifier is not None:
                self.notifier.progress(news, self.facts, self._utc_s(news.elapsed_s))
            self._tell_phase(news)
        except Exception as error:
            self._in_trouble(error)

    def ended(self, outcome: Outcome, message: str, *, note: str = "", head: str = "", lost: int = 0) -> None:
        """Report the end of the session, after the safe state.

        Args:
            outcome: how it ended.
            message: reason, "" if none is needed.
            note: further remark: "outside acceptance".
            head: hash of the run file's last record, "" if there is none.
            lost: number of points that were given up for good.

        """
        kind, level = _ENDINGS[outcome]
        news = self._last
        if news is not None and lost:
            self.progress(news._replace(done=news.done - lost))
            news = self._last
        done = "" if news is None else f", {news.done} of {news.total} points in {duration(news.elapsed_s)}"
        text = "; ".join(part for part in (f"{outcome.value}{done}", note, head and f"head {head}", message) if part)
        if self._utc_minus_elapsed is None:  # nothing was done in this session: the run was complete already
            self._manager.ended(text)
            return
        elapsed_s = None if news is None else news.elapsed_s
        utc_s = self._utc_s(elapsed_s)
        self._manager.ended(text)
        unsafe = outcome is Outcome.UNSAFE
        data = {"outcome": outcome.name.lower(), **({"head": head} if head else {})}
        happening = Happening(kind, level, one_line(text), utc_s, elapsed_s, data, unsafe)
        self._spread(happening)

    def failed(self, error: BaseException) -> None:
        """Report that the session could not begin, or ended with an unexpected error."""
        text = f"could not continue: {error or type(error).__name__}"
        self._manager.failed(text)
        happening = Happening(Kind.ENDED_BY_FAULT, "error", one_line(text), self._utc_s(None))
        began = self._utc_minus_elapsed is not None
        if began or (self.facts.served and not isinstance(error, UsageError)):
            self._spread(happening)
        else:  # the person who typed the command sees the message; or another controller continues undisturbed
            self._log(happening)

    def say(self, level: str, text: str) -> None:
        """Write a line to the logs only."""
        self._log(Happening(Kind.LOG, level, one_line(text), self._utc_s(None)))

    def close(self) -> list[str]:
        """Send waiting messages and lines, for a limited time.

        Returns:
            sentences not yet shown on a terminal: messages that reached nobody, lines missing in the log.

        """
        self.look.close()
        if self.notifier is not None:
            self.notifier.close()
        if self._trouble:
            self.say("warning", f"a report failed: {self._trouble}")
        for log in self.logs:
            log.close()
        if any(log.on_stderr for log in self.logs):
            return []
        lost = sum(log.lost for log in self.logs)
        return [*self._not_told(), *([f"{lost} line(s) of the log could not be written"] if lost else [])]

    def _not_told(self) -> list[str]:
        """A channel's failures, one sentence per reason. The run file has those before its last record."""
        told = []
        for (channel, why), counts in list(self._untold.items()):  # a channel's thread may still be running
            about = ", ".join(f"{kind}{f' ({n} times)' if n > 1 else ''}" for kind, n in list(counts.items()))
            told.append(f"{channel} did not receive the message about {about}: {why}")
        return told

    # --- from the channels' threads -------------------------------------------------------------------------------

    def not_told(self, failure: Failure) -> None:
        """Report a message that could not be sent: in the log now, in the run file with its next record."""
        self._failures.append(failure)
        reason = (failure.channel, one_line(failure.why))
        if reason not in self._untold and len(self._untold) >= _REASONS:
            reason = (failure.channel, "other reasons, see the log")
        self._untold.setdefault(reason, Counter())[str(failure.about)] += 1
        self.say("warning", f"{failure.channel} did not receive the message about {failure.about}: {failure.why}")

    def told(self, label: str, headline: str) -> None:
        """Report that a message was sent."""
        self.say("info", f"{label} was told: {headline}")

    # --- spreading ------------------------------------------------------------------------------------------------

    def _spread(self, happening: Happening) -> None:
        self._manager.happened(happening, self.facts)
        self._log(happening)
        if self.notifier is not None:
            self.notifier.happened(happening, self.facts)

    def _log(self, happening: Happening) -> None:
        for log in self.logs:
            log.happened(happening, self.facts)

    def _tell_phase(self, news: Progress) -> None:
        """Lines for changes of state (the states of a point count as one), and for progress from time to time."""
        phase = "observing" if news.state in AT_POINT else str(news.state)
        data = {"state": str(news.state), "done": news.done, "points": news.total}
        if phase != self._phase:
            self._phase = phase
            text = f"{phase}{f': {news.message}' if news.message else ''}"
            self._news(Kind.STATE, text, news, data)
        tenth = 10 * news.done // max(1, news.total)
        due = news.elapsed_s - self._progress_s >= _PROGRESS_S
        if (tenth != self._tenth or due) and news.state not in (State.READY, State.CHECKING):
            self._tenth, self._progress_s = tenth, news.elapsed_s
            left = "" if news.remaining_s is None else f", {duration(news.remaining_s)} left"
            text = f"{news.done} of {news.total} points in {duration(news.elapsed_s)}{left}"
            self._news(Kind.PROGRESS, text, news, {**data, "remaining_s": news.remaining_s})

    def _news(self, kind: Kind, text: str, news: Progress, data: Mapping[str, Any]) -> None:
        self._log(Happening(kind, "info", one_line(text), self._utc_s(news.elapsed_s), news.elapsed_s, data))

    def _utc_s(self, elapsed_s: float | None) -> float:
        """UTC of bench time, from the records: progress has only bench seconds, and a simulated bench has its own
        UTC.
        """
        if elapsed_s is None and self._last is not None and self.facts.simulated:
            elapsed_s = self._last.elapsed_s
        if elapsed_s is None or self._utc_minus_elapsed is None:
            return self._clock.utc()
        return self._utc_minus_elapsed + elapsed_s

    def _in_trouble(self, error: Exception) -> None:
        self._trouble = f"{type(error).__name__}: {error}"
