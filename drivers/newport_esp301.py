"""Newport ESP301 motion controller with two rotary stages: a dividing head's pitch and roll.

Commands are from the ESP301 user's manual (Newport EDH0235En1030, section 3): several commands may share a line of at
most 80 characters, separated by semicolons; every query of a line is answered with a separate line.

The controller does not report whether an axis has been homed. So this driver sets a mark after the good end of a home
search: a distinctive jog speed (JW), which is lost at power-off, like the encoder's zero. It is never saved to the
controller's memory; its only side effect is the speed of jogging from the front panel. Another mark stands for a
running search: a controller that was switched off during a search also stands still at its zero.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import ClassVar, Literal

from pydantic import Field, model_validator

from rig.drivers.clock import Clock
from rig.drivers.driver import ContractFile, Medium
from rig.drivers.errors import BadReply, InstrumentError, LimitError, NotReady, WrongInstrument
from rig.drivers.numbers import decimal
from rig.drivers.roles import AxisState, Identity
from rig.drivers.wires import SerialOptions, SerialSettings, Wires
from rig.drivers.wires.serial_options import LINE_END, LineEnd

Axis = Literal["pitch", "roll"]

# Jog speeds as marks: values that nobody sets by hand, and an ordinary one.
_HOMED_MARK_DEG_PER_S = 0.1357
_SEARCHING_MARK_DEG_PER_S = 0.2468
_NOT_HOMED_DEG_PER_S = 1.0
_HOME_TOLERANCE_DEG = 0.01  # chosen
_DEGREES = 7  # code of the unit degree for SN
_HOME_STARTS_S = 1.0  # within this time a search that does not move yet does not count as ended
_SPEED_ROUNDING = 1e-3  # the controller rounds speeds to counts per servo cycle
_ANGLE_ROUNDING_DEG = 1e-3
_LONGEST_LINE = 78  # of 80 characters; the line end may take two
_MOST_ERRORS = 10  # the controller keeps ten errors


class NewportESP301:
    """The head's two axes behind one controller; satisfies `rig.drivers.roles.Head` and `SelfChecking`.

    Args:
        name: the bench's name for it.
        address: serial address.
        options: see `Options`.
        wires: where to open it.
        clock: bench time.

    Raises:
        Unreachable: the address cannot be opened.

    """

    wire: ClassVar[Medium] = "serial"
    contracts: ClassVar[tuple[ContractFile, ...]] = ()

    class Options(SerialOptions):
        """Options of this instrument in the bench file."""

        baud: Literal[9600, 19200, 38400, 57600, 115200, 921600] = Field(19200, description="symbols per second")
        line_end: LineEnd = Field("cr", description=LINE_END)
        pitch_axis: int = Field(1, ge=1, le=3, description="controller axis of pitch")
        roll_axis: int = Field(2, ge=1, le=3, description="controller axis of roll")
        speed_deg_per_s: float = Field(8.0, gt=0, le=80, description="speed of moves")
        acceleration_deg_per_s2: float = Field(16.0, gt=0, le=320, description="acceleration and deceleration of moves")
        home_mode: int = Field(1, ge=0, le=6, description="homing method: nn of the manual's OR command")
        home_speed_deg_per_s: float = Field(4.0, gt=0, le=40, description="speed of the first part of the home search")
        pitch_deg: tuple[float, float] = Field((-190.0, 190.0), description="limits of pitch: lowest, highest")
        roll_deg: tuple[float, float] = Field((-190.0, 190.0), description="limits of roll: lowest, highest")

        @model_validator(mode="after")
        def _consistent(self) -> NewportESP301.Options:
            if self.pitch_axis == self.roll_axis:
                raise ValueError(f"pitch_axis and roll_axis are both {self.pitch_axis}")
            for name, (low, high) in (("pitch_deg", self.pitch_deg), ("roll_deg", self.roll_deg)):
                if not low < high:
                    raise ValueError(f"{name}: {low:g} is not below {high:g}")
            return self

    def __init__(self, name: str, address: str, options: Options, wires: Wires, clock: Clock) -> None:
        self.name = name
        self._options = options
        self._clock = clock
        settings = SerialSettings(
            options.baud,
            "8N1",
            options.flow_at(address),
            send_end=options.send_end,
            timeout_s=1.0,
            sync=("VE?", "ESP301"),
        )
        self._line = wires.serial(address, settings, name)
        self._numbers: dict[str, int] = {"pitch": options.pitch_axis, "roll": options.roll_axis}
        self._limits = {"pitch": options.pitch_deg, "roll": options.roll_deg}
        # Values that are 0 or 1 at both ends of the line: they show an answer that has lost its first or last
        # characters.
        pitch, roll = self._numbers.values()
        self._status = f"{pitch}MO?;{pitch}MD?;{pitch}TP?;{roll}TP?;{roll}MD?;{roll}MO?"
        self._homed: dict[str, bool | None] = dict.fromkeys(self._numbers)
        self._homing: dict[str, float] = {}
        self._faults: dict[str, str] = dict.fromkeys(self._numbers, "")
        self._unchecked = True
        self._same_answers: list[str] = []  # with which the next reading is the last one, [] if a command may change it
        self._same_states: Mapping[str, AxisState] = {}

    def axes(self) -> Mapping[str, tuple[float, float]]:
        """Axis name ("pitch", "roll") to its (low, high) limits in degrees."""
        return dict(self._limits)

    def identify(self) -> Identity:
        """Ask for the identity. The serial number is that of the stages; the controller reads it from them."""
        version = self._line.query("VE?")
        words = version.split(maxsplit=1)
        if not words or words[0].upper() != "ESP301":
            raise WrongInstrument(f"{self._line.where} should be a Newport ESP301; it answers {version!r}")
        stages = [self._line.query(f"{n}ID?").partition(",") for n in self._numbers.values()]
        serials = dict.fromkeys(serial.strip() for _, _, serial in stages)
        return Identity("Newport", "ESP301", "+".join(serials), words[1] if len(words) > 1 else "")

    def prepare(self) -> None:
        """Set units, speeds and limits, switch the motors on, and read everything back. Moves nothing.

        Raises:
            InstrumentError: the controller refuses a setting.
            BadReply: a setting reads back differently.
        """
        self._same_answers = []
        self._errors()  # left from an earlier session
        # Motors that are on after this do not show an earlier power cut: the marks are read again.
        self._homed = dict.fromkeys(self._numbers)
        options = self._options
        for axis, n in self._numbers.items():
            low, high = self._limits[axis]
            settings = {
                "SN": _DEGREES,
                "VA": options.speed_deg_per_s,
                "AC": options.acceleration_deg_per_s2,
                "AG": options.acceleration_deg_per_s2,
                "OH": options.home_speed_deg_per_s,
                "SL": low,
                "SR": high,
            }
            self._send([f"{n}MO", *(f"{n}{name}{value:.9g}" for name, value in settings.items())])
            self._raise_errors()
            wanted = {"MO": 1.0, **settings}
            question = ";".join(f"{n}{name}?" for name in wanted)
            answers = self._line.query_lines(question, len(wanted))
            for (name, value), answer in zip(wanted.items(), answers, strict=True):
                if not self._kept(name, value, self._number(question, answer)):
                    raise BadReply(
                        f"{self._line.where}: {axis} was set to {name} {value:g} and reads back {answer}; "
                        f"check the stage's own maximum settings"
                    )
        self._faults = dict.fromkeys(self._numbers, "")

    def wrong(self) -> Sequence[str]:
        """Settings that are not as declared: the unit and the limits of both axes, which its front panel can change."""
        wanted = {
            f"{n}{name}?": value
            for axis, n in self._numbers.items()
            for name, value in zip(("SN", "SL", "SR"), (_DEGREES, *self._limits[axis]), strict=True)
        }
        question = ";".join(wanted)
        answers = self._line.query_lines(question, len(wanted))
        return [
            f"{self._line.where}: {asked} is {answer} and should be {value:g}"
            for (asked, value), answer in zip(wanted.items(), answers, strict=True)
            if not self._kept(asked[1:3], value, self._number(question, answer))
        ]

    @staticmethod
    def _kept(name: str, value: float, found: float) -> bool:
        """Whether a setting reads back as it was set, but for the controller's rounding."""
        return abs(found - value) <= (_ANGLE_ROUNDING_DEG if name in ("SL", "SR") else _SPEED_ROUNDING * value)

    def home(self) -> None:
        """Start homing every axis that is not homed; poll `read` until all are homed and none moves. `read` reports an
        axis as homed after its search has ended at zero without an error.
        """
        self.read()
        for axis, n in self._numbers.items():
            if not self._homed[axis]:
                self._send([f"{n}JW{_SEARCHING_MARK_DEG_PER_S:g}", f"{n}OR{self._options.home_mode}"])
                self._homing[axis] = self._clock.now()
                self._faults[axis] = ""
        self._commanded()

    def forget_zeros(self) -> None:
        """Make `read` report every axis as not homed, so that `home` finds all zeros again. The mark of a good home
        search is removed.
        """
        self._same_answers = []
        self._send([f"{n}JW{_NOT_HOMED_DEG_PER_S:g}" for n in self._numbers.values()])
        self._homed = dict.fromkeys(self._numbers)

    def move(self, targets_deg: Mapping[str, float]) -> None:
        """Start moving the named axes to absolute angles, together.

        Targets are sent in units of 1e-5 deg, finer than the encoder.

        Raises:
            LimitError: a target is outside its axis' limits, or not a number.
            NotReady: an axis has not been homed since power-on.
        """
        for axis, target in targets_deg.items():
            low, high = self._limits[axis]
            if not low <= target <= high:
                raise LimitError(f"{self._line.where}: {axis} to {target:g} deg is outside {low:g} to {high:g}")
        if any(self._homed[axis] is None for axis in targets_deg):
            self.read()
        lost = [axis for axis in targets_deg if not self._homed[axis]]
        if lost:
            raise NotReady(f"{self._line.where}: {' and '.join(lost)} must be homed before it can go to an angle")
        self._send([f"{self._numbers[axis]}PA{target:.5f}" for axis, target in targets_deg.items()])
        self._commanded()

    def read(self) -> Mapping[str, AxisState]:
        """Read every axis. One exchange; a second one if an error is possible.

        Raises:
            InstrumentError: the controller reports an error that belongs to no axis.
        """
        asked, number, flag = self._status, self._number, self._flag
        answers = self._line.query_lines(asked, 6)
        if answers == self._same_answers:  # axes that stand
            return self._same_states
        pitch, roll = self._numbers
        powered, done, position, of_roll, roll_done, roll_powered = answers
        positions = {pitch: number(asked, position), roll: number(asked, of_roll)}
        moving = {pitch: not flag(asked, done), roll: not flag(asked, roll_done)}
        enabled = {pitch: flag(asked, powered), roll: flag(asked, roll_powered)}
        for axis, began in self._homing.items():
            moving[axis] |= self._clock.now() - began < _HOME_STARTS_S
        # Errors end motion or switch off a motor, so they are asked for only then.
        moves, off = True in moving.values(), False in enabled.values()
        if off or (self._unchecked and not moves):
            self._collect_errors()
            self._unchecked = moves
        homed, faults = self._homed, self._faults
        searching = off or self._homing or None in homed.values()
        if searching:
            self._follow_homing(positions, moving, enabled)
        self._same_states = {
            axis: AxisState(position, moving[axis], bool(homed[axis]), enabled[axis], faults[axis])
            for axis, position in positions.items()
        }
        self._same_answers = [] if searching or self._unchecked else answers
        return self._same_states

    def stop(self) -> None:
        """Stop all motion at the axes' normal deceleration; drives stay on. A running home search is given up."""
        self._send([f"{n}ST" for n in self._numbers.values()])
        self._homing.clear()
        self._commanded()

    def make_safe(self) -> None:
        """The safe state: motion stops, the motors stay on."""
        self.stop()

    def close(self) -> None:
        """Release the wire; idempotent."""
        self._line.close()

    def _commanded(self) -> None:
        """An error is possible, and the next answers have another meaning."""
        self._unchecked, self._same_answers = True, []

    def _send(self, commands: Sequence[str]) -> None:
        """Send commands in as few lines as possible."""
        for line in lines_of(commands):
            self._line.write(line)

    def _follow_homing(
        self, positions: Mapping[str, float], moving: Mapping[str, bool], enabled: Mapping[str, bool]
    ) -> None:
        """Keep track of homed axes; a motor that is off may mean that the controller was restarted."""
        for axis, n in self._numbers.items():
            if axis in self._homing:
                if moving[axis]:
                    continue
                del self._homing[axis]
                at_zero = enabled[axis] and not self._faults[axis] and abs(positions[axis]) <= _HOME_TOLERANCE_DEG
                self._homed[axis] = at_zero and self._has_mark(n, _SEARCHING_MARK_DEG_PER_S)
                if self._homed[axis]:  # a mark lost on its way costs only another search
                    self._line.write(f"{n}JW{_HOMED_MARK_DEG_PER_S:g}")
            elif self._homed[axis] is None or not enabled[axis]:
                self._homed[axis] = self._has_mark(n, _HOMED_MARK_DEG_PER_S)

    def _has_mark(self, n: int, deg_per_s: float) -> bool:
        question = f"{n}JW?"
        return math.isclose(self._number(question, self._line.query(question)), deg_per_s, rel_tol=_SPEED_ROUNDING)

    def _collect_errors(self) -> None:
        """Assign the controller's errors to their axes."""
        for code, text in self._errors():
            axis = next((a for a, n in self._numbers.items() if n == code // 100), None)
            if axis is None:
                raise InstrumentError(self._line.where, code, text)
            self._faults[axis] = f"{text} (error {code})"

    def _raise_errors(self) -> None:
        for code, text in self._errors():
            raise InstrumentError(self._line.where, code, text)

    def _errors(self) -> list[tuple[int, str]]:
        """All errors of the controller, oldest first. Reading removes them, so a question is never repeated."""
        found: list[tuple[int, str]] = []
        while len(found) <= _MOST_ERRORS:
            answer = self._line.query("TB?", repeat=False)
            code, _, rest = answer.partition(",")
            _, _, text = rest.partition(",")
            if not (code.isascii() and code.strip().isdecimal()):
                raise self._line.bad_reply("TB?", answer, "code, time, text")
            if int(code) == 0:
                break
            found.append((int(code), text.strip()))
        return found

    def _number(self, question: str, answer: str) -> float:
        try:
            return decimal(answer)
        except ValueError:
            raise self._line.bad_reply(question, answer, "a number") from None

    def _flag(self, question: str, answer: str) -> bool:
        if answer not in ("0", "1"):
            raise self._line.bad_reply(question, answer, "0 or 1")
        return answer == "1"


def lines_of(commands: Sequence[str]) -> list[str]:
    """Join commands by semicolons, in order, into lines of valid length."""
    lines: list[str] = []
    for command in commands:
        if lines and len(lines[-1]) + 1 + len(command) <= _LONGEST_LINE:
            lines[-1] += f";{command}"
        else:
            lines.append(command)
    return lines
