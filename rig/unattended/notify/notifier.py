"""Who is told of what, how often, and what becomes of what could not be sent.

The sequencer hands over and never waits: every channel has a thread of its own. What comes too often is held back
and told together with the next message; the message that ends a session always goes out.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from drivers.clock import Clock, RealClock
from rig.engine.session import Progress
from rig.unattended.happenings import Happening, Kind, RunFacts
from rig.unattended.notify.channels import Send
from rig.unattended.notify.delivery import NotSent, reason
from rig.unattended.notify.message import Message, compose
from rig.unattended.notify.settings import NotifySettings, _Channel
from rig.unattended.worker import Worker

_WAITING = 200
_HOUR_S = 3600.0
_REPEATING = frozenset({Kind.FAULT, Kind.WARNING})
_ENDING = frozenset({Kind.FINISH, Kind.STOP, Kind.INTERRUPT, Kind.ENDED_BY_FAULT})
_TOLD = frozenset(Kind) - {Kind.STATE, Kind.PROGRESS, Kind.EVENT, Kind.LOG}

PAUSES_S = (5.0, 30.0, 120.0)
"""Real seconds between attempts at one message; after the last it is given up."""

CLOSE_S = 30.0
"""Real seconds at the end of a session for what has not been sent yet."""


@dataclass(frozen=True)
class Failure:
    """A message that somebody did not get.

    Attributes:
        channel: its label.
        about: what the message was about.
        why: in words, without addresses' secrets.

    """

    channel: str
    about: Kind
    why: str


@dataclass
class _Desk:
    """One channel: its thread, what it sent in the last hour, and what it holds back."""

    settings: _Channel
    worker: Worker[Message]
    sent: deque[float] = field(default_factory=deque)
    last: dict[Kind, float] = field(default_factory=dict)
    held_back: Counter[Kind] = field(default_factory=Counter)
    latest: str = ""


class Notifier:
    """Tells people; a listener of a session.

    Args:
        settings: who is told of what.
        sends: what sends over each channel, by label; a channel that is not here is out of order.
        told: called from a channel's thread when a message went out, with its label and headline.
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
        """How far the run is. What was held back is told once there is room for it again."""
        self._news = news
        for desk in self._desks:
            if desk.held_back and self._may(desk, Kind.WARNING):
                kind = Kind.FAULT if desk.held_back[Kind.FAULT] else Kind.WARNING
                text, desk.latest = desk.latest, ""
                self._post(desk, Happening(kind, "warning", text, utc_s), facts)

    def happened(self, happening: Happening, facts: RunFacts) -> None:
        """Tell whoever wants to know, now or with the next message."""
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
        if kind in _REPEATING:  # they leave half of the hour's messages to what a person is waited for
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
            message = replace(message, also=f"not told one by one: {counts}{latest}")
            desk.held_back.clear()
            desk.latest = ""
        if not desk.worker.put(message):
            self._failed(Failure(desk.settings.label, message.kind, "too many messages wait to be sent"))

    def _deliver(self, label: str, send: Send, message: Message, worker: Worker[Message]) -> None:
        """In the channel's thread: send, and try again a few times."""
        why = ""
        for pause in (*self._pauses_s, None):
            try:
                send(message)
            except NotSent as error:
                why = str(error)
                if error.permanent:
                    break
            except Exception as error:  # a library's surprise must not end the channel
                why = reason(error)  # its own words may repeat an address
            else:
                self._told(label, message.headline)
                return
            if pause is not None:
                worker.pause(pause)
        self._failed(Failure(label, message.kind, why))

    @property
    def busy(self) -> bool:
        """Whether something waits to be sent."""
        return not all(desk.worker.idle() for desk in self._desks)

    def close(self, within_s: float = CLOSE_S) -> None:
        """Send what waits, for a limited time over all channels; what is left then has failed."""
        end = self._clock.now() + within_s
        for desk in self._desks:
            desk.worker.finish()
        for desk in self._desks:
            for message in desk.worker.close(max(0.0, end - self._clock.now())):
                self._failed(Failure(desk.settings.label, message.kind, "the session ended before it could be sent"))
