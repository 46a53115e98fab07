"""Common parts of simulated SCPI instruments: syntax, error queue, status registers, remote and local.

Paths that continue after a semicolon are from SCPI-1999; the common commands and the status byte are from IEEE 488.2.
"""

from __future__ import annotations

import inspect
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache, partial
from typing import Any, ClassVar

from rig.sims.faults import Kind
from rig.sims.faults.instrument_faults import ERROR_QUEUE
from rig.sims.twin import Medium, Role
from rig.sims.twins.scpi_syntax import Command, ScpiError, mask, split_outside, switch
from rig.sims.world import World

DEVICE_CLEAR = 0x03
"""Ctrl-C stands for GPIB's device clear on a serial line (34401A manual)."""

OPC, QUERY_ERROR, DEVICE_ERROR, EXECUTION_ERROR, COMMAND_ERROR, POWER_ON = 1, 4, 8, 16, 32, 128
"""Bits of the standard event register."""

_COMMAND_S = 0.003  # time for one command [?]

_ERRORS = {
    -103: "Invalid separator",
    -104: "Data type error",
    -108: "Parameter not allowed",
    -109: "Missing parameter",
    -113: "Undefined header",
    -121: "Invalid character in number",
    -211: "Trigger ignored",
    -213: "Init ignored",
    -214: "Trigger deadlock",
    -221: "Settings conflict",
    -222: "Data out of range",
    -224: "Illegal parameter value",
    -230: "Data stale",
}


class Wait(Exception):
    """A command that cannot be answered yet; it is tried again after `seconds`."""

    def __init__(self, seconds: float) -> None:
        super().__init__(seconds)
        self.seconds = seconds


COMMON = (
    Command("*IDN", query="ask_identity", local=True),
    Command("*RST", set="reset", local=True),
    Command("*CLS", set="clear_status", local=True),
    Command("*ESE", set="set_event_enable", query="ask_event_enable", local=True),
    Command("*ESR", query="ask_events", local=True),
    Command("*SRE", set="set_service_enable", query="ask_service_enable", local=True),
    Command("*STB", query="ask_status_byte", local=True),
    Command("*PSC", set="set_power_on_clear", query="ask_power_on_clear", local=True),
    Command("*OPC", set="note_completion", query="ask_completion", local=True),
    Command("*WAI", set="wait_for_completion", local=True),
    Command("SYSTem:ERRor", query="ask_error", local=True),
    Command("SYSTem:VERSion", query="ask_version", local=True),
    Command("SYSTem:REMote", set="go_remote", local=True),
    Command("SYSTem:RWLock", set="go_remote", local=True),
    Command("SYSTem:LOCal", set="go_local", local=True),
    Command("STATus:QUEStionable[:EVENt]", query="ask_questionable"),
    Command("STATus:QUEStionable:ENABle", set="set_questionable_enable", query="ask_questionable_enable"),
    Command("STATus:PRESet", set="preset_status"),
)


@lru_cache(maxsize=1024)
def _parameters(method: Callable[..., Any]) -> tuple[int, float]:
    """Minimum and maximum number of parameters of a method besides `self`."""
    kinds = list(inspect.signature(method).parameters.values())[1:]
    fewest = sum(p.kind is p.POSITIONAL_OR_KEYWORD and p.default is p.empty for p in kinds)
    return fewest, float("inf") if any(p.kind is p.VAR_POSITIONAL for p in kinds) else len(kinds)


_Unit = tuple[str, str]
"""One command of a line: its header in upper case, and its parameters."""

_Found = tuple[Command, str, list[str]]
"""Row of a command, name of its method, and its parameters."""


@lru_cache(maxsize=4096)
def _units(line: str) -> tuple[_Unit, ...]:
    parts = (unit.strip().partition(" ") for unit in split_outside(line.strip(), ";"))
    return tuple((header.upper(), rest.strip()) for header, _, rest in parts)


class ScpiTwin:
    """An instrument that takes lines of SCPI commands over a serial line.

    Subclasses give the command table, the identity, `reset` and `busy_for`. Commands are executed in order; a command
    that has to wait (FETC? during a measurement) delays later ones.

    Args:
        name: the bench's name for it.
        world: virtual time.
        baud: symbols per second of its line.
        frame: its line's data bits, parity, stop bits.
    """

    wire: ClassVar[Medium] = "serial"
    roles: ClassVar[frozenset[Role]]
    faults: ClassVar[tuple[Kind, ...]] = (ERROR_QUEUE,)
    commands: ClassVar[Mapping[str, Command]]
    errors: ClassVar[Mapping[int, str]] = _ERRORS
    identity: ClassVar[str]
    queued_errors: ClassVar[int] = 20
    overflow: ClassVar[str] = "Too many errors"
    line_end = b"\n"
    """End of a command; white space beside it is ignored."""
    reply_end = b"\r\n"
    integers: ClassVar[str] = "+d"
    """Format of numbers of the status system."""
    set_event_enable, ask_event_enable = mask("_event_enable", 0xFF)
    set_service_enable, ask_service_enable = mask("_service_enable", 0xFF)
    set_questionable_enable, ask_questionable_enable = mask("_questionable_enable")
    set_power_on_clear, ask_power_on_clear = switch("_power_on_clear")

    def __init__(self, name: str, world: World, baud: int, frame: str) -> None:
        self.name = name
        self.world = world
        self.baud = baud
        self.frame = frame
        self._session = 0
        self._power_on_clear = True  # non-volatile
        self._event_enable = self._service_enable = 0
        self._asked: dict[tuple[str, str], _Found] = {}
        self.switch_on()

    def switch_on(self) -> None:
        """State at power-on."""
        self._session += 1
        self._input = b""
        self._lines: deque[str] = deque()
        self._running = False
        self._queue: deque[tuple[int, str]] = deque()
        self.events = POWER_ON
        self.questionable = 0
        if self._power_on_clear:
            self._event_enable = self._service_enable = 0
        self._questionable_enable = 0
        self.remote = False
        self.reset()

    def power_cycle(self) -> None:
        """Power off and on: settings, readings and errors are lost; local control."""
        self.switch_on()

    def reset(self) -> None:
        """The settings of *RST."""
        raise NotImplementedError(f"{type(self).__name__} does not say what *RST does")

    def busy_for(self) -> float:
        """Seconds until the running measurement is complete; 0 if there is none."""
        return 0.0

    def on_rx(self, data: bytes, tx: Callable[[bytes], None]) -> None:
        """Collect characters; LF ends a line, CR is white space, Ctrl-C clears input, output and measurement."""
        if DEVICE_CLEAR in data and self.hears_clear():
            data = data[data.rindex(DEVICE_CLEAR) + 1 :]
            self.device_clear()
        if DEVICE_CLEAR in data:
            data = data.replace(bytes([DEVICE_CLEAR]), b"")
        *lines, self._input = (self._input + data).split(self.line_end)
        self._lines.extend([line.decode("latin-1") for line in lines])
        if not self._running:
            self._next_line(tx)

    def hears_clear(self) -> bool:
        """Whether Ctrl-C is recognised now."""
        return True

    def device_clear(self) -> None:
        """Discard received commands that are not yet executed."""
        self._session += 1
        self._input = b""
        self._lines.clear()
        self._running = False

    def _next_line(self, tx: Callable[[bytes], None]) -> None:
        self._running = bool(self._lines)
        if self._running:
            units = deque(self.commands_in(self._lines.popleft()))
            delay = _COMMAND_S * len(units)
            self.world.call_in(delay, partial(self._carry_out, units, [], "", tx, self._session))

    def commands_in(self, line: str) -> Sequence[_Unit]:
        """The commands of a line, in order."""
        return _units(line)

    @property
    def waiting(self) -> int:
        """Number of received characters that are not yet being executed."""
        return len(self._input) + sum(map(len, self._lines))

    @property
    def busy(self) -> bool:
        """Whether a line is being executed or waiting."""
        return self._running

    def _carry_out(
        self, units: deque[_Unit], answers: list[str], path: str, tx: Callable[[bytes], None], session: int
    ) -> None:
        """Execute the rest of a line; `path` is the subtree of the next header."""
        if session != self._session:
            return  # cleared or switched off meanwhile
        while units:
            try:
                path, answer = self._execute(path, *units[0])
            except Wait as wait:
                self.world.call_in(wait.seconds, partial(self._carry_out, units, answers, path, tx, session))
                return
            except ScpiError as error:
                self.fail(error.code)
            else:
                if answer is not None:
                    answers.append(answer)
            units.popleft()
        if answers:
            tx(";".join(answers).encode("ascii") + self.reply_end)
        self._next_line(tx)

    def _execute(self, path: str, header: str, rest: str) -> tuple[str, str | None]:
        if not header:
            return path, None
        query = header.endswith("?")
        name = header.removesuffix("?")
        if not name.startswith("*"):
            name = self.addressed(name[1:] if name.startswith(":") else path + name)
        found = self._asked.get((name, rest)) if query else None
        if found is None:
            found = self._looked_up(name, rest, query=query)
        row, method, arguments = found
        if not (self.remote or row.local):
            raise ScpiError(550)
        answer: str | None = getattr(self, method)(*arguments)
        if not name.startswith("*"):
            path = name[: name.rfind(":") + 1]
        return path, answer if answer is None else self.reply(row, answer)

    def _looked_up(self, name: str, rest: str, *, query: bool) -> _Found:
        row = self.commands.get(name)
        method = row and (row.query if query else row.set)
        if row is None or not method:
            raise ScpiError(-113)
        if not (self.remote or row.local):
            raise ScpiError(550)
        arguments = [part.strip() for part in split_outside(rest, ",")] if rest else []
        fewest, most = _parameters(getattr(type(self), method))
        if not fewest <= len(arguments) <= most:
            raise ScpiError(-109 if len(arguments) < fewest else -108)
        if query:
            self._asked[name, rest] = row, method, arguments
        return row, method, arguments

    def addressed(self, name: str) -> str:
        """The header for look-up, in upper case without its leading colon, from a received header."""
        return name

    def reply(self, row: Command, answer: str) -> str:
        """An answer as sent on the wire."""
        return answer

    def overflow_errors(self) -> None:
        """Fill the error queue beyond its length."""
        for _ in range(self.queued_errors + 1):
            self.fail(-113)

    def fail(self, code: int) -> None:
        """Put an error into the queue and set its class in the event register."""
        if -200 < code <= -100:
            self.events |= COMMAND_ERROR
        elif -300 < code <= -200:
            self.events |= EXECUTION_ERROR
        elif -500 < code <= -400:
            self.events |= QUERY_ERROR
        else:
            self.events |= DEVICE_ERROR
        if len(self._queue) < self.queued_errors:
            self._queue.append((code, self.errors[code]))
        else:
            self._queue[-1] = (-350, self.overflow)

    def ask_identity(self) -> str:
        """*IDN?."""
        return self.identity

    def ask_error(self) -> str:
        """SYSTem:ERRor?."""
        code, text = self._queue.popleft() if self._queue else (0, "No error")
        return f'{code:{self.integers}},"{text}"'

    def ask_version(self) -> str:
        """SYSTem:VERSion?."""
        return "1991.0"

    def clear_status(self) -> None:
        """*CLS."""
        self.events = 0
        self.questionable = 0
        self._queue.clear()

    def ask_events(self) -> str:
        """*ESR?: reading clears it."""
        events, self.events = self.events, 0
        return f"{events:{self.integers}}"

    def ask_status_byte(self) -> str:
        """*STB?."""
        summary = 8 * bool(self.questionable & self._questionable_enable) + 32 * bool(self.events & self._event_enable)
        return f"{summary + 64 * bool(summary & self._service_enable):{self.integers}}"

    def note_completion(self) -> None:
        """*OPC: sets the event bit when the running measurement is complete."""
        session = self._session
        self.world.call_in(self.busy_for(), lambda: self._complete(session))

    def _complete(self, session: int) -> None:
        if session == self._session:
            self.events |= OPC

    def wait_for_completion(self) -> None:
        """*WAI."""
        seconds = self.busy_for()
        if seconds > 0:
            raise Wait(seconds)

    def ask_completion(self) -> str:
        """*OPC?."""
        self.wait_for_completion()
        return "1"

    def ask_questionable(self) -> str:
        """STATus:QUEStionable?: reading clears it."""
        value, self.questionable = self.questionable, 0
        return f"{value:+d}"

    def preset_status(self) -> None:
        """STATus:PRESet."""
        self._questionable_enable = 0

    def go_remote(self) -> None:
        """SYSTem:REMote and SYSTem:RWLock."""
        self.remote = True

    def go_local(self) -> None:
        """SYSTem:LOCal."""
        self.remote = False
