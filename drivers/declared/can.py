"""CAN messages, as an instrument's file and its DBC have them: signals that are heard, commands that are sent.

A reading is in a frame that began after it was asked for. A state (setpoint, output, arrived or not, a check) may be in
the newest frame, unless a command was sent since, whose effect that frame cannot show yet.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Container, Iterator, Mapping, Sequence
from functools import partial

from cantools.database.can import Message, Signal
from cantools.database.errors import DecodeError, EncodeError
from cantools.database.namedsignalvalue import NamedSignalValue

from rig.contracts.declared import dbc
from rig.contracts.declared.exchanges import Ask, Check, Tell
from rig.contracts.declared.forms import Form
from rig.contracts.declared.frames import REMOTE, shown_id
from rig.contracts.declared.instrument import Instrument
from rig.contracts.declared.wire import Identity
from rig.drivers.clock import Clock
from rig.drivers.declared.talk import NOTHING, Answer, Holes, Talk
from rig.drivers.errors import InstrumentError, LimitError, NoReply
from rig.drivers.scpi import agrees
from rig.drivers.wires import Wires

_PERIODS = 3  # a frame that is under way, one that is lost, and one more
_FRAME_S = 0.005  # chosen: a frame takes 1 ms at 125 kbit/s, and an adapter some more
_AWAY_S = 0.05  # chosen: who has not listened for so long does not know when a waiting frame came

Number = NamedSignalValue | float


class CanTalk(Talk):
    """An instrument with CAN messages.

    Args:
        table: its file.
        name: the bench's name for it.
        address: CAN address.
        parameters: by name.
        wires: where to open it.
        clock: bench time.

    Raises:
        Unreachable: the bus cannot be opened, or another instrument on it has the same identifiers.
    """

    def __init__(
        self,
        table: Instrument,
        name: str,
        address: str,
        parameters: Mapping[str, str | float],
        wires: Wires,
        clock: Clock,
    ) -> None:
        self.line = wires.can(address, name)
        super().__init__(table, clock, self.line.where)
        self._parameters = parameters
        self._plus = int(parameters[table.wire.identifiers_plus]) if table.wire.identifiers_plus else 0
        self._dbc = dbc.read_dbc(table.wire.dbc)
        self._readings = {id(ask) for place, ask in table.asks() if place.endswith((".reading", ".confirm"))}
        self._heard: dict[str, tuple[float, Number]] = {}  # by signal: when it came, and what it is
        self._counts: dict[tuple[str, frozenset[str]], float] = {}
        self._sent: dict[str, dict[str, float | str]] = {}  # signals of each message as sent last
        self._ours = False  # whether a frame is heard while we listen, so that it came now
        self._listened = self._told = self._swept = -math.inf
        self._used: dict[str, float] = {}  # when the frame came that has answered a question for a signal
        reading_s = table.reader.reading_s if table.reader is not None else 0.0
        self._reading_s = max(reading_s, _FRAME_S)
        self._owed = False  # whether an answer may still come
        self._misfit, self._repeated = "", 0
        for message in {one.name: one for one in self._awaited()}.values():
            self.line.listen(self._id(message), partial(self._hear, message))

    def _awaited(self) -> Iterator[Message]:
        """Messages with a signal that the file asks for."""
        paths = [path for _, ask in self.table.asks() for path in (ask.ask, ask.status, getattr(ask, "serial", None))]
        paths += [dbc.told(answer)[0] for _, tell in self.table.tells() for answer in tell.answer]
        for path in (*paths, self.table.errors.ask):
            if path is not None:
                yield self._place(path)[0]

    def _place(self, path: str) -> dbc.Place:
        return dbc.find_signal(self._dbc, "", path)

    def _id(self, message: Message) -> int:
        return dbc.can_id(message) + self._plus

    def _period_s(self, message: Message) -> float:
        return message.cycle_time / 1000.0 if message.cycle_time else self.table.wire.period_s

    def _hear(self, message: Message, data: bytes) -> None:
        if not self._ours:  # it came at some time since we listened last
            return
        try:
            if len(data) < message.length:
                raise DecodeError(f"{len(data)} bytes instead of {message.length}")
            values: Mapping[str, Number] = message.decode(data[: message.length])  # type: ignore[assignment]  # no container
        except (DecodeError, KeyError) as error:  # a group of a multiplexed message that the DBC does not have
            self._misfit = f"{dbc.frame_name(message, self._plus)} {data.hex()} does not fit the DBC ({error})"
            return
        count = values.get(self.table.wire.counter)
        if count is not None:
            kind = message.name, frozenset(values)  # each group of a multiplexed message has its own counter
            if self._counts.get(kind) == float(_plain(count)):
                self._repeated += 1
                return
            self._counts[kind] = float(_plain(count))
        now = self.clock.now()
        self._heard |= {f"{message.name}.{name}": (now, value) for name, value in values.items()}

    def _pump(self, seconds: float) -> bool:
        self._ours = True
        try:
            return self.line.pump(seconds)
        finally:
            self._ours = False
            self._listened = self.clock.now()

    def _caught_up(self) -> None:
        """Discard what came while nobody listened."""
        if self.clock.now() - self._listened > _AWAY_S:
            self._heard.clear()
            self.line.flush()
            self._listened = self.clock.now()

    def _await(self, paths: Sequence[str], since: float, seconds: float, what: str = "") -> list[Number]:
        """Values of signals that came since a time. Raises `NoReply`."""
        end = max(since, self.clock.now()) + seconds + self.clock.grace()
        self._repeated, self._misfit = 0, ""
        self.line.heard.clear()
        while missing := [path for path in paths if path not in self._heard or self._heard[path][0] < since]:
            left = end - self.clock.now()
            if left <= 0:
                raise self._silent(missing, what)
            self._pump(left)
        return [self._heard[path][1] for path in paths]

    def _silent(self, paths: Sequence[str], what: str) -> NoReply:
        names = " and ".join(dict.fromkeys(dbc.frame_name(self._place(path)[0], self._plus) for path in paths))
        why = (
            "is it powered, terminated, and set to these identifiers and bit rate? "
            "A message that comes more rarely needs period_s"
        )
        if self._repeated:
            why = f"{self._repeated} frames repeat their {self.table.wire.counter}: it hangs; switch it off and on"
        others = ", ".join(shown_id(one) for one in sorted(self.line.heard))
        there = f" (heard instead: {others})" if others else " (nothing is heard on this bus)"
        return NoReply(f"{self.where}{what}: no frame {names} came{there}; {self._misfit or why}")

    def once(self, ask: Ask, holes: Holes = NOTHING, timeout_s: float | None = None, *, repeat: bool = True) -> Answer:
        """The value of a signal. Raises `NoReply`, `BadReply`, `InstrumentError`."""
        self.paced()
        paths = [path for path in (ask.ask, ask.status, getattr(ask, "serial", None)) if path is not None]
        messages = [self._place(path)[0] for path in paths]
        seconds = (timeout_s or ask.timeout_s or self.table.wire.timeout_s) + _PERIODS * max(
            map(self._period_s, messages)
        )
        self._caught_up()
        if ask.request is not None:
            return self._meaning(ask, paths, self._requested(ask, paths, holes, seconds, repeat=repeat), holes)
        now = self.clock.now()
        if id(ask) in self._readings:
            begun, used = max(self._swept, self._told), self._used.get(paths[0], -math.inf)
            since = begun + self._reading_s if begun > used else max(now, used) + self._reading_s
        else:  # the frame under way while a command comes does not know of it
            period_s = max(map(self._period_s, messages))
            since = max(now - period_s, self._told + period_s + self.clock.grace())
        found = self._await(paths, since, seconds)
        self._used[paths[0]] = self._heard[paths[0]][0]
        return self._meaning(ask, paths, found, holes)

    def _forget(self, paths: Container[str]) -> None:
        """Take what has come so far for no answer to what is sent next."""
        while self._pump(0.0):
            pass
        self._heard = {path: one for path, one in self._heard.items() if path not in paths}

    def _requested(
        self, ask: Ask, paths: Sequence[str], holes: Holes, seconds: float, *, repeat: bool
    ) -> Sequence[Number]:
        """Values that are sent on request. Raises `NoReply`."""
        for last in (False, True) if repeat else (True,):
            if self._owed:  # it would pass for the answer to this one
                end = self.clock.now() + self.table.wire.timeout_s
                while (left := end - self.clock.now()) > 0:
                    self._pump(left)
                self._owed = False
            self._forget(paths)
            if ask.request == dbc.REMOTELY:
                for message in {one.name: one for one, _ in map(self._place, paths)}.values():
                    self.line.send(self._id(message) | REMOTE, bytes(message.length))
            else:
                self._send(ask.request or "", holes)
            try:
                return self._await(paths, -math.inf, seconds, f", asked by {ask.request!r}")
            except NoReply:
                self._owed = True
                if last:
                    raise
        raise AssertionError

    def _meaning(self, ask: Ask, paths: Sequence[str], found: Sequence[Number], holes: Holes) -> Answer:
        """The meaning of an answer. Raises `BadReply`, `InstrumentError`."""
        of = dict(zip(paths, found, strict=True))
        _, signal = self._place(paths[0])
        word, number = _word(found[0]), _plain(found[0])
        if ask.status is None:
            meaning = self.meant(ask, word, number)
        elif not (meaning := self.meant(ask, _word(of[ask.status]), _plain(of[ask.status]))):
            known = ", ".join({**self.table.words, **ask.words})
            raise self.bad(ask, f"{ask.status} = {of[ask.status]}", f"one of the words {known}")
        named = isinstance(found[0], NamedSignalValue)
        number = number * signal.scale + signal.offset if named else number
        if ask.asks_bit:
            meaning = meaning or ask.of_bit(number)
        if not meaning and not named and not self._possible(signal, number):
            low, high = dbc.span(signal)
            raise self.bad(ask, word, f"a number from {low:g} to {high:g}, as the DBC has it")
        if id(ask) in self._readings and not meaning and not named and self._at_an_end(signal, number):
            meaning = "overload"
        if any("{channel}" in form for form in ask.answer) and word != holes["channel"]:
            raise self.bad(ask, word, f"channel {holes['channel']}")
        serial = getattr(ask, "serial", None)
        fields = {"value": word} | ({"serial": f"{_plain(of[serial]):.0f}"} if serial is not None else {})
        quantity = math.nan if named and not isinstance(ask, Check | Identity) else ask.quantity(number)
        return Answer(fields, quantity, meaning, word)

    @staticmethod
    def _possible(signal: Signal, number: float) -> bool:
        low, high = dbc.span(signal)
        return math.isfinite(number) and low - 1e-9 <= number <= high + 1e-9

    @staticmethod
    def _at_an_end(signal: Signal, number: float) -> bool:
        """Whether a number is the last that a signal can have, which is what is sent beyond it, too."""
        low, high = dbc.span(signal)
        return number >= high - 1e-9 or (low < 0 and number <= low + 1e-9)

    def tell(self, tell: Tell, holes: Holes = NOTHING, *, checked: bool = True) -> None:
        """Send a message. Never repeated, unless the file says that it is cyclic. Raises `InstrumentError`."""
        self.paced()
        self._caught_up()
        answers = [dbc.told(answer) for answer in tell.answer]
        self._forget(dict(answers))
        line = self._send(tell.tell or "", holes)
        if answers:
            paths = list(dict(answers))
            found = self._await(paths, -math.inf, self.table.wire.timeout_s, f", after {line!r}")
            for path, value in zip(paths, found, strict=True):
                right = [word for other, word in answers if other == path]
                if not any(str(value) == word or agrees(word, _plain(value)) for word in right):
                    self._refused(line, path, value)
        self.waits(tell)
        if checked:
            self.raise_errors(line)

    def _refused(self, line: str, path: str, value: Number) -> None:
        code = f"{_plain(value):.9g}"
        text = self.table.errors.codes.get(code, f"it refuses ({path} = {value})")
        raise InstrumentError(f"{self.where}, after {line!r},", int(_plain(value)), text)

    def assume(self, tells: Sequence[Tell]) -> None:
        """Take commands as sent: those whose effect was read."""
        for tell in tells:
            with contextlib.suppress(KeyError):  # one with a value, which is not known
                name, values, _ = self._filled(tell.tell or "", NOTHING)
                self._sent[name] = {**values, **self._sent.get(name, {})}

    def _filled(self, line: str, holes: Holes) -> tuple[str, dict[str, float | str], str]:
        text = Form(line).filled(self._parameters).write(holes)
        name, signals = dbc.command(text)
        message = self._dbc.get_message_by_name(name)
        words = {signal.name: dbc.words_of(signal) for signal in message.signals}
        return name, {key: one if one in words[key] else float(one) for key, one in signals.items()}, text

    def _send(self, line: str, holes: Holes) -> str:
        """Send a command with the signals that it names, and the others as they were sent last. Raises `LimitError`."""
        name, values, text = self._filled(line, holes)
        message = self._dbc.get_message_by_name(name)
        state = self._sent[name] = {**self._sent.get(name, {}), **values}
        try:
            data = message.encode(dict(_complete(message, state)))
        except (EncodeError, KeyError, OverflowError) as error:
            raise LimitError(f"{self.where}: {text!r} does not fit into its message: {error}") from None
        if period_s := self.table.wire.cyclic.get(name, 0.0):
            self.line.repeat(self._id(message), data, period_s)
        else:
            self.line.send(self._id(message), data)
        self._told = self.clock.now()
        return text

    def raise_errors(self, line: str = "") -> None:
        """Look at the signal for errors. Raises `InstrumentError`."""
        errors = self.table.errors
        if errors.ask is None:
            return
        message, _ = self._place(errors.ask)
        period_s = self._period_s(message)
        self._caught_up()
        seconds = self.table.wire.timeout_s + _PERIODS * period_s
        since = max(self.clock.now() - period_s, self._told + period_s + self.clock.grace())
        (found,) = self._await([errors.ask], since, seconds)
        raw, where = _plain(found), f"{self.where}, after {line!r}," if line else self.where
        if errors.bits:
            words = [text for bit, text in errors.bits.items() if int(raw) >> int(bit) & 1]
            if words:
                raise InstrumentError(where, int(raw), " and ".join(words))
        elif not (str(found) == errors.none or agrees(errors.none, raw)):
            text = errors.codes.get(f"{raw:.9g}") or errors.codes.get(str(found)) or f"{errors.ask} = {found}"
            raise InstrumentError(where, int(raw), text)

    def sweep(self) -> None:
        """Frames that begin from now on count, for all channels."""
        self._caught_up()
        self._swept = self.clock.now()

    def renew(self) -> None:
        """Begin anew: the instrument may have been off."""
        self._heard.clear()

    def close(self) -> None:
        """Release the bus; idempotent."""
        self.line.close()


def _plain(value: Number) -> float:
    """A value as number; of a word that on the wire."""
    return float(value.value if isinstance(value, NamedSignalValue) else value)


def _word(value: Number) -> str:
    """A value as it is shown: its word, or its number."""
    return str(value) if isinstance(value, NamedSignalValue) else f"{value:.9g}"


def _complete(message: Message, state: Mapping[str, float | str]) -> Iterator[tuple[str, float | str]]:
    """Values of all signals of the group of a message that a state selects."""
    done: dict[str, int] = {}
    waiting = list(message.signals)
    while waiting:
        later = []
        for signal in waiting:
            selector = signal.multiplexer_signal
            if selector is not None and selector not in done:
                later.append(signal)
                continue
            if selector is not None and done[selector] not in (signal.multiplexer_ids or []):
                continue
            value = state.get(signal.name, _initial(signal))
            if signal.is_multiplexer:
                raw = dbc.words_of(signal)[value] if isinstance(value, str) else (value - signal.offset) / signal.scale
                done[signal.name] = round(raw)
            yield signal.name, value
        if len(later) == len(waiting):
            return
        waiting = later


def _initial(signal: Signal) -> float:
    """Value of a signal before anything was sent: that of the DBC, or the nearest to 0 that it can have."""
    if signal.initial is not None:
        return float(signal.initial)  # type: ignore[arg-type]  # scaled, no word
    low, high = dbc.span(signal)
    return min(max(0.0, low), high)
