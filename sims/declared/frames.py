"""Twin of a declared instrument with CAN messages: those that its file asks for, and those that it sends.

Its DBC is read by a reader of its own (`rig.sims.wires.dbc`), not by that of the driver.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import partial
from math import inf, isnan
from typing import Any, NamedTuple

from rig.contracts.declared.exchanges import Ask, Check, Tell
from rig.contracts.declared.forms import Form
from rig.contracts.declared.frames import REMOTE
from rig.sims.declared.behaviour import OVERLOAD, Behaviour, Refused, Said
from rig.sims.physics import WorldError
from rig.sims.twin import Accuracy
from rig.sims.wires.can_line import Transmit
from rig.sims.wires.dbc import DbcMessage, DbcSignal, read_dbc
from rig.sims.world import Timer, World

_REPLY_S = 0.001  # from a message to its answer [?]
_MISSED, _MISSED_S = 5, 2.0
"""Periods, and seconds at least, without a cyclic command after which the instrument switches off, as many do [?]."""
_PART = re.compile(r" *([A-Za-z_]\w*) *= *(.*?) *")


class _Command(NamedTuple):
    """A message that it obeys.

    Attributes:
        place: its place in the file.
        what: it there; a question, if the message asks for something.
        fixed: values of signals by which it is known.
        holes: signals with a value to take, by the name of the value.
    """

    place: str
    what: Ask | Tell
    fixed: Mapping[str, float]
    holes: Mapping[str, str]


class FramesTwin(Behaviour):
    """The twin; see `rig.sims.twin.CanTwin`."""

    def __init__(self, name: str, options: Mapping[str, object], world: World, plant: Any, serial: str) -> None:
        self._messages = read_dbc(self.table.wire.dbc)
        for path in (path for _, ask in self.table.asks() for path in _paths(ask)):
            message, _, signal = path.partition(".")
            if signal not in self._messages[message].signals:
                raise WorldError(f"{name}: the simulated instrument cannot read {path} of its DBC")
        plus = self.table.wire.identifiers_plus
        self._plus = int(str(options.get(plus, self.table.parameters[plus]))) if plus else 0
        self._parameters = {key: str(options.get(key, default)) for key, default in self.table.parameters.items()}
        self._asks: dict[str, list[tuple[str, Ask]]] = {}  # questions by signal
        self._status: dict[str, list[Ask]] = {}
        self._meanings: dict[int, str] = {}  # of the latest reading, by its question
        self._commands: dict[str, list[_Command]] = {}
        self._remote: dict[str, str] = {}  # messages that are asked for by remote frames, with a place in the file
        for place, ask in self.table.asks():
            self._asks.setdefault(ask.ask or "", []).append((place, ask))
            if ask.status is not None:
                self._status.setdefault(ask.status, []).append(ask)
            if ask.request == "remote":
                self._remote |= {path.partition(".")[0]: place for path in _paths(ask)}
            elif ask.request is not None:
                self._known(place, ask, ask.request)
        for place, tell in self.table.tells():
            self._known(place, tell, tell.tell or "")
        self._digits = {getattr(ask, "serial", None) for _, ask in self.table.asks()} - {None}
        self._counts: dict[tuple[str, float | None], int] = {}
        self._seen: dict[str, bytes] = {}
        self._watch: dict[str, Timer] = {}
        self._spoken: dict[str, float] = {}
        self._tx: Transmit | None = None
        self._heard_until, self._session = -inf, 0
        super().__init__(name, options, world, plant, serial)

    def _known(self, place: str, what: Ask | Tell, line: str) -> None:
        text = Form(line).filled(self._parameters).text
        name, _, rest = text.partition(":")
        fixed, holes = {}, {}
        for part in filter(None, rest.split(",")):
            found = _PART.fullmatch(part)
            assert found is not None
            if "{" in found[2]:
                holes[found[1]] = next(iter(Form(found[2]).fields))
            else:
                fixed[found[1]] = self._number(self._messages[name.strip()].signals[found[1]], found[2])
        self._commands.setdefault(name.strip(), []).append(_Command(place, what, fixed, holes))

    @staticmethod
    def _number(signal: DbcSignal, word: str) -> float:
        """The value that a word, or a number, is."""
        for number, name in signal.names.items():
            if name == word:
                return number * signal.factor + signal.offset
        return float(word)

    def switch_on(self) -> None:
        """State at power-on: it knows no command, and sends."""
        super().switch_on()
        self._session += 1
        self._seen.clear()
        for timer in self._watch.values():
            timer.cancel()
        if self._tx is not None:
            self._speak()

    def accuracy(self, channel: str, unit: str) -> Accuracy:
        """Accuracy of readings of an input: half the step of the coarsest signal, and its noise."""
        reader = self.table.reader
        assert reader is not None
        read = [reader.reading, *(one.reading for one in reader.channels.values())]
        steps = [abs(ask.scale) * self._signal(ask.ask or "").factor for ask in read if ask is not None]
        return Accuracy(6.0 * reader.noise + 1e-9, max(steps) / 2)

    def _signal(self, path: str) -> DbcSignal:
        message, _, signal = path.partition(".")
        return self._messages[message].signals[signal]

    # --- what it sends by itself

    def connected(self, tx: Transmit, seconds: float) -> None:
        """Somebody listens, for so long at least: it sends its messages."""
        self._heard_until = self.world.now() + seconds
        if tx != self._tx or not self._spoken:
            self._tx = tx
            self._speak()

    def _speak(self) -> None:
        """Begin to send every message that is not asked for."""
        self._session += 1
        self._spoken.clear()
        for name in dict.fromkeys(path.partition(".")[0] for path in self._unasked()):
            self._spoken[name] = self.world.now()
            period_s = self._messages[name].cycle_s or self.table.wire.period_s
            self.world.call_in(period_s, partial(self._say, name, period_s, self._session))

    def _unasked(self) -> Iterator[str]:
        """Signals of messages that it sends by itself."""
        for asked in self._asks.values():
            for _, ask in asked:
                yield from _paths(ask) if ask.request is None else ()
        if self.table.errors.ask is not None:
            yield self.table.errors.ask

    def _say(self, name: str, period_s: float, session: int) -> None:
        if session != self._session or self._tx is None:
            return
        if self.world.now() > self._heard_until:  # it goes on when somebody listens again
            self._spoken.clear()
            self._session += 1
            return
        self._send(self._messages[name], self._tx)
        self.world.call_in(period_s, partial(self._say, name, period_s, session))

    def _send(self, message: DbcMessage, tx: Transmit) -> None:
        """Send a message; of a multiplexed one every group that the file asks for."""
        name = next(key for key, one in self._messages.items() if one is message)
        every = {one.group: False for one in message.signals.values() if one.group is not None}
        for key, one in message.signals.items():
            if one.group is not None and self._is_asked(f"{name}.{key}"):
                every[one.group] = True
        asked: list[int | None] = [group for group in sorted(every) if every[group]]
        for group in asked or [min(every, default=None)]:
            tx(message.can_id + self._plus, message.pack(dict(self._values(name, message, group))))

    def _is_asked(self, path: str) -> bool:
        return path in self._asks or path in self._status or path in self._digits or path == self.table.errors.ask

    def _values(self, name: str, message: DbcMessage, group: float | None) -> Iterator[tuple[str, float]]:
        last = [key for key in message.signals if f"{name}.{key}" in self._status]  # a status is that of its reading
        for key in (*(key for key in message.signals if key not in last), *last):
            path, signal = f"{name}.{key}", message.signals[key]
            if signal.group not in (None, group):
                continue
            if signal.multiplexor and group is not None:
                yield key, float(group)
            elif key == self.table.wire.counter:
                count = self._counts[name, group] = self._counts.get((name, group), 0) + 1
                yield key, (count % (1 << signal.bits)) * signal.factor + signal.offset
            elif path in self._digits:
                yield key, float(int("".join(c for c in self.serial if c.isdigit()) or 0) % (1 << signal.bits))
            elif path in self._status:
                ask = self._status[path][0]
                yield key, self._worded(ask, signal, self._meanings.get(id(ask), "stable"))
            elif path == self.table.errors.ask:
                yield key, self._error(signal)
            elif path in self._asks:
                yield key, self._shown(*self._asked(path), signal)
            else:
                yield key, 0.0

    def _asked(self, path: str) -> tuple[str, Ask]:
        """The question for a signal: the identity, if nothing else asks for it."""
        every = self._asks[path]
        return next((one for one in every if one[0] != "identity"), every[0])

    def _shown(self, place: str, ask: Ask, signal: DbcSignal) -> float:
        """The value of a signal that the file asks for."""
        try:
            said = self.answers(place, ask, {})
        except Refused:
            return 0.0
        self._meanings[id(ask)] = said.meaning
        if ask.asks_bit:
            return ask.with_bit(said.meaning)
        words = set({**self.table.words, **ask.words}.values())
        by_word = isnan(said.value) or said.meaning == "overload" or place.endswith((".output", ".settled"))
        if by_word and said.meaning in words and ask.status is None:
            return self._worded(ask, signal, said.meaning)
        if isinstance(ask, Check):
            return self._checks(ask, signal, said)
        if isnan(said.value):
            return self._text(signal, said.meaning)
        if abs(said.value) < OVERLOAD / 2:
            return ask.shown(said.value)
        return signal.span[said.value > 0]

    def _checks(self, ask: Check, signal: DbcSignal, said: Said) -> float:
        """The right answer to a check, or another one that the signal can have."""
        right = self._number(signal, ask.is_) if isinstance(ask.is_, str) else ask.is_
        if self._answers_right(ask, said):
            return right
        step = signal.factor if not signal.is_float else 1.0
        return right + step if signal.raw(right + step) != signal.raw(right) else right - step

    @staticmethod
    def _answers_right(ask: Check, said: Said) -> bool:
        if isinstance(ask.is_, str):
            return ask.is_ in (said.meaning, *said.fields.values())
        return said.value == ask.quantity(ask.is_)

    def _text(self, signal: DbcSignal, text: str) -> float:
        try:
            return self._number(signal, text or "0")
        except ValueError:
            return 0.0

    def _worded(self, ask: Ask, signal: DbcSignal, meaning: str) -> float:
        """The value of the word with a meaning; of an overload without one, that of an error."""
        words = {**self.table.words, **ask.words}
        for wanted in (meaning, "error", "stable"):
            known = [word for word, one in words.items() if one.partition(":")[0] == wanted]
            known.sort(key=lambda word: word not in signal.names.values() and not word.lstrip("+-").isdecimal())
            if known:
                return self._text(signal, known[0])
        return 0.0

    def _error(self, signal: DbcSignal) -> float:
        errors = self.table.errors
        if not self.queue:
            return 0.0 if errors.bits else self._number(signal, errors.none)
        return (
            float(1 << int(next(iter(errors.bits))))
            if errors.bits
            else self._number(signal, next(iter(errors.codes), "1"))
        )

    # --- what it is sent

    def on_frame(self, can_id: int, data: bytes, tx: Transmit) -> None:
        """Take a frame from the bus; its own frames go to `tx` later."""
        if can_id & REMOTE:
            for name, place in self._remote.items():
                if self._messages[name].can_id + self._plus == can_id & ~REMOTE:
                    self.world.call_in(self.takes_s(place) or _REPLY_S, partial(self._reply, name, tx))
            return
        for name, commands in self._commands.items():
            message = self._messages[name]
            if message.can_id + self._plus != can_id or len(data) < message.length:
                continue
            self._watched(name)
            before = self._seen.get(name) if name in self.table.wire.cyclic else None
            if before != data:  # otherwise once more what it does already
                self._seen[name] = data
                self._obey(commands, message, message.unpack(data), message.unpack(before) if before else {}, tx)

    def _watched(self, name: str) -> None:
        """Switch off if a command does not come again that has to."""
        source, period_s = self.table.source, self.table.wire.cyclic.get(name)
        if period_s is None or source is None or not source.off:
            return
        if name in self._watch:
            self._watch[name].cancel()
        self._watch[name] = self.world.timer_in(max(_MISSED * period_s, _MISSED_S), partial(self._missed, name))

    def _missed(self, name: str) -> None:
        self._seen.pop(name, None)
        self.quantity.off(self.world.now())

    def _obey(
        self,
        commands: list[_Command],
        message: DbcMessage,
        values: Mapping[str, float],
        before: Mapping[str, float],
        tx: Transmit,
    ) -> None:
        """Carry out the commands that a message is; of a cyclic one those whose signals have changed."""
        group = next((round(values[key]) for key, one in message.signals.items() if one.multiplexor), None)
        asked: dict[str, float] = {}
        for command in commands:
            names = (*command.fixed, *command.holes)
            if any(message.signals[key].group not in (None, group) for key in names):
                continue
            if any(abs(values[key] - wanted) > 1e-9 for key, wanted in command.fixed.items()):
                continue
            if not before or any(values[key] != before[key] for key in names):
                if isinstance(command.what, Tell):
                    self._carry_out(command.place, command.what, self._brought(command, message, values), tx)
                else:
                    asked |= {path.partition(".")[0]: self.takes_s(command.place) for path in _paths(command.what)}
        for name, takes_s in asked.items():
            self.world.call_in(takes_s or _REPLY_S, partial(self._reply, name, tx))

    @staticmethod
    def _brought(command: _Command, message: DbcMessage, values: Mapping[str, float]) -> dict[str, float | str]:
        """Values that a command brings."""
        holes: dict[str, float | str] = {}
        for key, hole in command.holes.items():
            named = message.signals[key].names.get(round(values[key]), f"{values[key]:.9g}")
            holes[hole] = named if hole == "channel" else values[key]
        return holes

    def _carry_out(self, place: str, what: Tell, holes: Mapping[str, float | str], tx: Transmit) -> None:
        try:
            self.does(place, what, holes)
            self.queue.clear()
            refused = False
        except Refused:
            self.queue.append("unknown")
            refused = True
        for answer in what.answer:
            path, _, word = (part.strip() for part in answer.partition("="))
            value = self._number(self._signal(path), word)
            self.world.call_in(_REPLY_S, partial(self._acknowledge, path, value + refused, tx))

    def _reply(self, name: str, tx: Transmit) -> None:
        self._send(self._messages[name], tx)

    def _acknowledge(self, path: str, value: float, tx: Transmit) -> None:
        name, _, key = path.partition(".")
        message = self._messages[name]
        tx(message.can_id + self._plus, message.pack({**message.group_of(key), key: value}))


def _paths(ask: Ask) -> Iterator[str]:
    """Signals that a question needs."""
    yield from (path for path in (ask.ask, ask.status, getattr(ask, "serial", None)) if path is not None)
