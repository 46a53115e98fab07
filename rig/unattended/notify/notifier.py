"""Sending messages to people: choice of channels, limits on the number of messages, repeated attempts.

The sequencer never waits: every channel has a thread of its own. Messages that come too often are held back and
summarised in the next one. The message that ends a session is always sent.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from rig.drivers.clock import Clock, RealClock
from rig.engine.session import Progress
from rig.unattended.happenings import Happening, Kind, RunFacts
from rig.unattended.notify.channels import Send
from rig.unattended.notify.delivery import NotSent, reason
from rig.unattended.notify.message import Message, compose
from rig.unattended.notify.notify_file import NotifySettings, _Channel
from rig.unattended.worker import Worker

_WAITING = 200
_HOUR_S = 3600.0
_REPEATING = frozenset({Kind.FAULT, Kind.WARNING})
_ENDING = frozenset({Kind.FINISH, Kind.STOP, Kind.INTERRUPT, Kind.ENDED_BY_FAULT})
_TOLD = frozenset(Kind) - {Kind.STATE, Kind.PROGRESS, Kind.EVENT, Kind.LOG}

PAUSES_S = (5.0, 30.0, 120.0)
"""Real seconds between attempts at one message; after the last one it is given up."""

CLOSE_S = 30.0
"""Real seconds at the end of a session for unsent messages."""


@dataclass(frozen=True)
class Failure:
    """A message that could not be sent.

    Attributes:
        channel: label of the channel.
        about: subject of the message.
        why: reason in words, without secrets of addresses.

    """

    channel: str
    about: Kind
    why: str


@dataclass
class _Desk:
    """One channel: its thread, its messages of the last hour, and those held back."""

    settings: _Channel
    worker: Worker[Message]
    sent: deque[float] = field(default_factory=deque)
    last: dict[Kind, float] = field(default_factory=dict)
    held_back: Counter[Kind] = field(default_factory=Counter)
    latest: str = ""


class Notifier:
    """Sends messages to people; a listener of a session.

    Args:
        settings: channels and their reports.
        sends: functions that send, by label of the channel; a missing channel is out of order.
        told: called from a channel's thread when a message was sent, with its label and headline.
        failed: called from a channel's thread, or at the end, with every message that could not be sent.
        clock: real time.
        pauses_s: see `PAUSES_S`.

    """

    def __init__(
        self,
        settings: NotifySettings,
        sends: Mapping[str, Send],
        *,
        told: Callable[[str, str], None] = lambda *_: None,
        failed: Callable[[Failure], None] = lambda _: None,
        clock: Clock | None = None,
        pauses_s: Sequence[float] = PAUSES_S,
    ) -> None:
        self._most, self._repeats_s = settings.most_per_hour, settings.repeats_s
        self._clock = clock or RealClock()
        self._told, self._failed = told, failed
        self._pauses_s = tuple(pauses_s)
        self._news: Progress | None = None
        open_ones = [channel for channel in settings.channel if channel.label in sends]
        self._desks = [self._desk(channel, sends[channel.label]) for channel in open_ones]

    def _desk(self, channel: _Channel, send: Send) -> _Desk:
        worker: Worker[Message]

        def deliver(message: Message) -> None:
            self._deliver(channel.label, send, message, worker)

        worker = Worker(f"notify {channel.label}", deliver, _WAITING)
        return _Desk(channel, worker)

    def progress(self, news: Progress, facts: RunFacts, utc_s: float) -> None:
        """Take the progress of the run. Held-back messages are sent when the limit permits it."""
        self._news = news
        for desk in self._desks:
            if desk.held_back and self._may(desk, Kind.WARNING):
                kind = Kind.FAULT if desk.held_back[Kind.FAULT] else Kind.WARNING
                text, desk.latest = desk.latest, ""
                self._post(desk, Happening(kind, "warning", text, utc_s), facts)

    def happened(self, happening: Happening, facts: RunFacts) -> None:
        """Send a report to its channels, now or with the next message."""
        if happening.kind not in _TOLD:
            return
        for desk in self._desks:
            if not desk.settings.wants(happening.kind, facts.bench, simulated=facts.simulated):
                continue
            if self._may(desk, happening.kind):
                self._post(desk, happening, facts)
            else:
                desk.held_back[happening.kind] += 1
                desk.latest = happening.text

    def _may(self, desk: _Desk, kind: Kind) -> bool:
        if kind in _ENDING or kind is Kind.TEST:
            return True
        now = self._clock.now()
        while desk.sent and now - desk.sent[0] >= _HOUR_S:
            desk.sent.popleft()
        if kind in _REPEATING:  # they leave half of the hour's messages for reports that need a person
            recent = any(now - desk.last.get(other, float("-inf")) < self._repeats_s for other in _REPEATING)
            return not recent and len(desk.sent) < self._most // 2
        return len(desk.sent) < self._most

    def _post(self, desk: _Desk, happening: Happening, facts: RunFacts) -> None:
        now = self._clock.now()
        desk.sent.append(now)
        desk.last[happening.kind] = now
        message = compose(happening, facts, self._news)
        if desk.held_back:
            counts = ", ".join(f"{n} x {kind}" for kind, n in desk.held_back.items())
            latest = f"; the latest: {desk.latest}" if desk.latest else ""
            message = replace(message, also=f"not sent one by one: {counts}{latest}")
            desk.held_back.clear()
            desk.latest = ""
        if not desk.worker.put(message):
            self._failed(Failure(desk.settings.label, message.kind, "too many messages wait to be sent"))

    def _deliver(self, label: str, send: Send, message: Message, worker: Worker[Message]) -> None:
        """Send in the channel's thread, with a few more attempts."""
        why = ""
        for pause in (*self._pauses_s, None):
            try:
                send(message)
            except NotSent as error:
                why = str(error)
                if error.permanent:
                    break
            except Exception as error:  # an unexpected error of a library must not end the channel
                why = reason(error)  # the error's text may repeat an address
            else:
                self._told(label, message.headline)
                return
            if pause is not None:
                worker.pause(pause)
        self._failed(Failure(label, message.kind, why))

    @property
    def busy(self) -> bool:
        """Whether messages are waiting."""
        return not all(desk.worker.idle() for desk in self._desks)

    def close(self, within_s: float = CLOSE_S) -> None:
        """Send waiting messages, for a limited time over all channels; those left then have failed."""
        end = self._clock.now() + within_s
        for desk in self._desks:
            desk.worker.finish()
        for desk in self._desks:
            for message in desk.worker.close(max(0.0, end - self._clock.now())):
                self._failed(Failure(desk.settings.label, message.kind, "the session ended before it could be sent"))
