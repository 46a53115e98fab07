"""Simulated Newport ESP301 motion controller with two rotary stages: a dividing head's pitch and roll.

Commands and error codes are from the ESP301 user's manual (Newport EDH0235En1030, section 3 and appendix A). One line
of answer per query of a line is known from public drivers. Angles are degrees, time is the world's. The mechanics
behind the encoders (profiles, backlash, settling) are the plant's. This module is the controller: it counts from its
position at power-on until it has found home.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Callable, Mapping
from functools import lru_cache, partial
from typing import ClassVar, Protocol

from rig.sims.faults import Kind
from rig.sims.faults.instrument_faults import ERROR_QUEUE, OF_HEADS
from rig.sims.twin import Medium, Role
from rig.sims.twins.newport_axis import PARAMETERS, Axis, Head, Parameter
from rig.sims.world import World

_COMMAND_S = 0.004  # execution time of one command [?]
_TICK_S = 400e-6  # TB?'s time stamps count servo cycles of 400 us
_QUEUED_ERRORS = 10
_POLL_S = 0.05
_HOME_RUN_UP_DEG = 2.0
_LONGEST_LINE = 80
"""Maximum length of a line, characters (manual, page 3-8)."""

_TRIPS = {"drive-fault": 2, "following-error": 3}

_ERRORS = {
    0: "NO ERROR DETECTED",
    6: "COMMAND DOES NOT EXIST",
    7: "PARAMETER OUT OF RANGE",
    9: "AXIS NUMBER OUT OF RANGE",
    37: "AXIS NUMBER MISSING",
    38: "COMMAND PARAMETER MISSING",
}
_AXIS_ERRORS = {
    2: "AMPLIFIER FAULT DETECTED",
    3: "FOLLOWING ERROR THRESHOLD EXCEEDED",
    6: "POSITIVE SOFTWARE LIMIT DETECTED",
    7: "NEGATIVE SOFTWARE LIMIT DETECTED",
    10: "MAXIMUM VELOCITY EXCEEDED",
    11: "MAXIMUM ACCELERATION EXCEEDED",
    13: "MOTOR NOT ENABLED",
    20: "HOMING ABORTED",
    30: "COMMAND NOT ALLOWED DURING HOMING",
}


class Plant(Protocol):
    """Parts of the plant that this twin uses."""

    @property
    def head(self) -> Head:
        """The dividing head."""
        ...


_COMMAND = re.compile(r"(\d{0,3})([A-Z]{2})(\??)(.*)", re.ASCII)
_WORD = re.compile(r"[0-9][0-9A-F]{0,4}H?", re.ASCII)
_SET = 0x40  # high in the manual's example of the status characters
_NO_EMERGENCY_STOP = 0x18000000  # likewise in that of the hardware status
_NUMBER = re.compile(r"[+-]?(\d{1,9}\.?\d*|\.\d+)(E[+-]?\d)?", re.ASCII)


_Poll = Callable[[float], str]
"""The answer to a frequent query at a time."""
_Parsed = tuple[int, str, bool, str]
"""Axis number (0 if none), mnemonic, whether it is a query, parameter text."""
_WITHOUT_AXIS = frozenset(("TE", "TB", "VE", "AB", "WS", "TS", "TX", "PH"))


@lru_cache(maxsize=4096)
def _commands(line: bytes) -> tuple[str, ...]:
    return tuple(c for c in line.decode("latin-1").split(";") if c.strip())


@lru_cache(maxsize=4096)
def _parsed(text: str) -> _Parsed | None:
    match = _COMMAND.fullmatch(text.replace(" ", "").upper())
    if match is None:
        return None
    number, mnemonic, query, parameter = match.groups()
    return int(number or 0), mnemonic, bool(query), parameter


class _Refused(Exception):
    """A refused command; `code` goes to the error queue."""

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


def _number(text: str) -> float:
    """A command's parameter."""
    if not _NUMBER.fullmatch(text):
        raise _Refused(7 if text else 38)
    return float(text)


def _hexadecimal(text: str) -> float:
    """A configuration word: hexadecimal digits, with or without an H."""
    if not _WORD.fullmatch(text):
        raise _Refused(6 if text else 38)  # a letter at the begin is taken for a command
    return int(text.removesuffix("H"), 16)


class NewportESP301Twin:
    """The controller.

    Args:
        name: the bench's name for it.
        options: its options in the bench file; `pitch_axis`, `roll_axis` and `baud` are used.
        world: virtual time.
        plant: has `head`.
        serial: serial number of its stages.
    """

    wire: ClassVar[Medium] = "serial"
    roles: ClassVar[frozenset[Role]] = frozenset({"head"})
    faults: ClassVar[tuple[Kind, ...]] = (*OF_HEADS, ERROR_QUEUE)
    frame = "8N1"

    def __init__(self, name: str, options: Mapping[str, object], world: World, plant: Plant, serial: str) -> None:
        self.name = name
        self.baud = int(str(options.get("baud", 19200)))
        self._world = world
        self._serial = serial
        numbers = {axis: int(str(options.get(f"{axis}_axis", n))) for n, axis in ((1, "pitch"), (2, "roll"))}
        self._axes = {number: Axis(axis, plant.head, world) for axis, number in numbers.items()}
        self._polled: dict[str, _Poll] = {}
        for n, axis in self._axes.items():
            self._polled |= {f"{n}TP?": axis.told_position, f"{n}MD?": axis.told_done, f"{n}MO?": axis.told_power}
        self._commands: dict[str, Callable[[Axis, int, str], str | None]] = {
            "TP": lambda axis, n, text: axis.told_position(world.now()),
            "MD": lambda axis, n, text: axis.told_done(world.now()),
            "DP": lambda axis, n, text: f"{axis.target:.4f}",
            "TV": lambda axis, n, text: f"{axis.speed():.4f}",
            "ID": lambda axis, n, text: f"RGV100BL, {self._serial}",
            "MO": self._power_on,
            "MF": self._power_off,
            "PA": self._move_absolute,
            "PR": self._move_relative,
            "ST": self._stop,
            "DH": self._define_home,
            "OR": self._search_home,
        }
        self._polls = lru_cache(maxsize=64)(self._polls_of)
        self._session = 0
        self._switch_on()

    def _switch_on(self) -> None:
        self._session += 1
        self._started = self._world.now()
        self._input = b""
        self._lines: deque[bytes] = deque()
        self._running = False
        self._errors: deque[tuple[int, int]] = deque()

    def power_cycle(self) -> None:
        """Power off and on: settings, homing and the count are lost, the mechanics do not move."""
        for axis in self._axes.values():
            axis.stop()
            axis.switch_on()
        self._switch_on()

    def trip(self, axis: str, why: str) -> str:
        """Make an axis fail: it stops, its motor goes off, an error is reported.

        Args:
            axis: "pitch" or "roll".
            why: "drive-fault" or "following-error".

        Returns:
            A sentence about the event.
        """
        number, tripped = next((n, a) for n, a in self._axes.items() if a.name == axis)
        code = 100 * number + _TRIPS[why]
        tripped.homing = False
        tripped.powered = False
        tripped.stop()
        self._fail(code)
        return f"error {code}, {_AXIS_ERRORS[code % 100]}, motor off"

    def overflow_errors(self) -> None:
        """Fill the error queue beyond its length."""
        for _ in range(_QUEUED_ERRORS + 1):
            self._fail(6)

    def on_rx(self, data: bytes, tx: Callable[[bytes], None]) -> None:
        """Collect characters; a carriage return ends a line, a line feed is ignored."""
        *lines, self._input = (self._input + data).replace(b"\n", b"").split(b"\r")
        self._lines += lines
        if not self._running:
            self._next_line(tx)

    def _next_line(self, tx: Callable[[bytes], None]) -> None:
        """Take the next line; it is executed after the time the controller needs to read it."""
        self._running = bool(self._lines)
        if self._running:
            line = self._lines.popleft()
            polls = self._polls(line)
            if polls:
                self._world.call_in(_COMMAND_S * len(polls), partial(self._tell, polls, tx, self._session))
                return
            if len(line) > _LONGEST_LINE:
                self._fail(6)  # the manual does not name the error [?]
                line = b""
            commands = deque(_commands(line))
            self._world.call_in(_COMMAND_S * len(commands), partial(self._carry_out, commands, tx, self._session))

    def _polls_of(self, line: bytes) -> tuple[_Poll, ...]:
        """Functions for the answers of a line of frequent queries only, as nearly all of a night; () for any other."""
        polls = [self._polled.get(command) for command in _commands(line)] if len(line) <= _LONGEST_LINE else [None]
        return () if None in polls else tuple(poll for poll in polls if poll is not None)

    def _tell(self, polls: tuple[_Poll, ...], tx: Callable[[bytes], None], session: int) -> None:
        if session == self._session:  # not switched off meanwhile
            now = self._world.now()
            tx(("\r\n".join([poll(now) for poll in polls]) + "\r\n").encode("ascii"))
            self._next_line(tx)

    def _carry_out(self, commands: deque[str], tx: Callable[[bytes], None], session: int) -> None:
        if session != self._session:
            return  # switched off meanwhile
        answers = []
        while commands:
            parsed = _parsed(commands[0])
            if parsed is not None and parsed[1] == "WS" and (seconds := self._waits(commands, parsed)):
                self._world.call_in(seconds, partial(self._carry_out, commands, tx, session))
                break
            commands.popleft()
            try:
                answer = self._execute(parsed)
            except _Refused as refused:
                self._fail(refused.code)
            else:
                if answer is not None:
                    answers.append(answer)
        if answers:
            tx(("\r\n".join(answers) + "\r\n").encode("ascii"))
        if not commands:
            self._next_line(tx)

    def _waits(self, commands: deque[str], parsed: _Parsed) -> float:
        """Seconds until the next command, WS, can be executed: it waits for the end of motion plus nn ms."""
        number, _, _, text = parsed
        waited = [self._axes[number]] if number in self._axes else list(self._axes.values())
        if any(axis.moving() for axis in waited):
            return _POLL_S
        commands[0] = f"{number or ''}WS"
        return float(text) / 1000 if _NUMBER.fullmatch(text) else 0.0

    def _execute(self, parsed: _Parsed | None) -> str | None:
        if parsed is None:
            raise _Refused(6)
        number, mnemonic, query, text = parsed
        if mnemonic in _WITHOUT_AXIS:
            return self._execute_without_axis(mnemonic)
        action = self._commands.get(mnemonic)
        parameter = PARAMETERS.get(mnemonic)
        if action is None and parameter is None:
            raise _Refused(6)
        if not number:
            raise _Refused(37)
        axis = self._axes.get(number)
        if axis is None:
            raise _Refused(9)
        if parameter is not None:
            if query:
                value = axis.values[mnemonic]
                return f"{int(value):X}H" if parameter.hexadecimal else f"{value:.9g}"
            self._set(axis, number, mnemonic, parameter, text)
            return None
        assert action is not None
        return action(axis, number, "?" if query else text)

    def _execute_without_axis(self, mnemonic: str) -> str | None:
        match mnemonic:
            case "VE":
                return "ESP301 Version 3.0.1 6/1/99"
            case "TE":
                return str(self._oldest_error()[0])
            case "TB":
                code, tick = self._oldest_error()
                text = _AXIS_ERRORS[code % 100] if code >= 100 else _ERRORS[code]
                return f"{code}, {tick}, {f'AXIS-{code // 100} ' if code >= 100 else ''}{text}"
            case "TS":
                return self._status()
            case "TX":
                return chr(_SET | 16 * any(axis.moving() for axis in self._axes.values()))
            case "PH":
                return f"{_NO_EMERGENCY_STOP:X}H, 0H"  # stages without limit switches, home switches open
            case "AB":
                for number, axis in self._axes.items():
                    self._stop(axis, number, "")
                    axis.powered = False
        return None

    def _status(self) -> str:
        """The moving axes, and whether a motor is on, as the bits of a character."""
        moving = sum(1 << (number - 1) for number, axis in self._axes.items() if axis.moving())
        return chr(_SET | moving | 16 * any(axis.powered for axis in self._axes.values()))

    def _oldest_error(self) -> tuple[int, int]:
        return self._errors.popleft() if self._errors else (0, self._ticks())

    def _ticks(self) -> int:
        return round((self._world.now() - self._started) / _TICK_S)

    def _fail(self, code: int) -> None:
        if len(self._errors) == _QUEUED_ERRORS:
            self._errors.popleft()
        self._errors.append((code, self._ticks()))

    def _set(self, axis: Axis, number: int, name: str, parameter: Parameter, text: str) -> None:
        value = _hexadecimal(text) if parameter.hexadecimal else _number(text)
        if not parameter.low <= value <= parameter.high:
            raise _Refused(7)
        if parameter.ceiling and value > axis.values[parameter.ceiling]:
            raise _Refused(100 * number + parameter.ceiling_error)
        axis.values[name] = value

    def _power_on(self, axis: Axis, number: int, text: str) -> str | None:
        if text == "?":
            return axis.told_power(self._world.now())
        axis.powered = True
        return None

    def _power_off(self, axis: Axis, number: int, text: str) -> str | None:
        if text == "?":
            return "0" if axis.powered else "1"
        axis.powered = False
        self._stop(axis, number, "")
        return None

    def _move_absolute(self, axis: Axis, number: int, text: str) -> str | None:
        if text == "?":
            return f"{axis.target:.4f}"
        self._move(axis, number, _number(text))
        return None

    def _move_relative(self, axis: Axis, number: int, text: str) -> None:
        self._move(axis, number, axis.position() + _number(text))

    def _move(self, axis: Axis, number: int, target: float) -> None:
        self._check_ready(axis, number)
        if target > axis.values["SR"]:
            raise _Refused(100 * number + 6)
        if target < axis.values["SL"]:
            raise _Refused(100 * number + 7)
        axis.go(target, axis.values["VA"])

    def _check_ready(self, axis: Axis, number: int) -> None:
        if not axis.powered:
            raise _Refused(100 * number + 13)
        if axis.homing:
            raise _Refused(100 * number + 30)

    def _stop(self, axis: Axis, number: int, text: str) -> None:
        if axis.homing:
            axis.homing = False
            self._fail(100 * number + 20)
        axis.stop()

    def _define_home(self, axis: Axis, number: int, text: str) -> str | None:
        if text == "?":
            return f"{axis.values['SH']:.4f}"
        axis.zero += axis.position() - (_number(text) if text else 0.0)
        return None

    def _search_home(self, axis: Axis, number: int, text: str) -> None:
        """Move fast below the home mark, then up to it slowly: the index is always approached from the same side."""
        if text and _number(text) not in range(7):
            raise _Refused(7)
        self._check_ready(axis, number)
        axis.homing = True
        axis.go(-_HOME_RUN_UP_DEG - axis.zero, axis.values["OH"])
        self._world.call_in(_POLL_S, partial(self._home_next, axis, [0.0], self._session))

    def _home_next(self, axis: Axis, legs: list[float], session: int) -> None:
        if not axis.homing or session != self._session:
            return
        if axis.driving():
            self._world.call_in(_POLL_S, partial(self._home_next, axis, legs, session))
        elif legs:
            axis.go(legs[0] - axis.zero, axis.values["OL"])
            self._world.call_in(_POLL_S, partial(self._home_next, axis, legs[1:], session))
        else:
            axis.homing = False
            axis.zero = -axis.values["SH"]
            axis.target = axis.values["SH"]
