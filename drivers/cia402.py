"""Two CiA 402 drives on one CAN bus: a dividing head's pitch and roll, in profile position mode by SDO.

Source: CiA 402 (IEC 61800-7-201). Objects are read and written as the EDS describes them; the controller program
hands it over as text. Positions on the wire are encoder counts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

from pydantic import BaseModel, Field, field_validator, model_validator

from drivers.clock import Clock
from drivers.errors import BadReply, InstrumentError, LimitError, NotReady, WrongInstrument
from drivers.roles import AxisState, Identity
from drivers.wires import Wires
from drivers.wires.can_node import CanNode, read_eds

CONTROLWORD, STATUSWORD, ERROR_CODE = 0x6040, 0x6041, 0x603F
MODE, MODE_DISPLAY, PROFILE_POSITION, HOMING = 0x6060, 0x6061, 1, 6
POSITION, TARGET, VELOCITY = 0x6064, 0x607A, 0x606C
_DEVICE_TYPE, _DEVICE_NAME, _SOFTWARE, _IDENTITY = 0x1000, 0x1008, 0x100A, 0x1018
_VENDOR, _PRODUCT, _SERIAL = 1, 2, 4
_PROFILE = 402

_STATES = {
    "not ready": (0x4F, 0x00),
    "disabled": (0x4F, 0x40),
    "ready": (0x6F, 0x21),
    "switched on": (0x6F, 0x23),
    "enabled": (0x6F, 0x27),
    "quick stop": (0x6F, 0x07),
    "stopping for a fault": (0x4F, 0x0F),
    "fault": (0x4F, 0x08),
}
"""State by (mask, value) of the statusword."""

_NEXT = {"disabled": 0x06, "ready": 0x07, "switched on": 0x0F, "quick stop": 0x00}
"""Controlword that leads from a state one step nearer to "enabled"."""

_REACHED, _ACKNOWLEDGED, _HOMED_NOW, _HOMING_ERROR = 1 << 10, 1 << 12, 1 << 12, 1 << 13
_DISABLE, _HOLD, _GO, _HOME, _HALT, _QUICK_STOP, _RESET = 0x07, 0x0F, 0x3F, 0x1F, 0x10F, 0x02, 0x80
_POLL_S = 0.01
_ENABLE_S, _ACKNOWLEDGE_S, _STANDSTILL_S = 2.0, 0.5, 5.0

_FAULTS = {
    0x2310: "continuous overcurrent",
    0x3210: "DC link overvoltage",
    0x3220: "DC link undervoltage",
    0x4310: "drive overtemperature",
    0x7305: "encoder signal",
    0x8130: "heartbeat lost",
    0x8611: "following error",
}


@dataclass
class _Axis:
    """One drive, and what is known of it.

    Attributes:
        node: the drive.
        limits: (low, high) in degrees.
        homing: a home search was started and has not been seen to end.
        homed: whether the position is referenced, None as long as it is not known.
        fault: what ended the last home search.
        distrusted: its zero is not to be trusted before it has been found again, whatever the drive says.

    """

    node: CanNode
    limits: tuple[float, float]
    homing: bool = False
    homed: bool | None = None
    fault: str = ""
    distrusted: bool = False


class CiA402Pair:
    """The head's two drives; satisfies `drivers.roles.Head`.

    Args:
        name: the bench's name for it.
        address: CAN address.
        options: see `Options`.
        wires: where to open it.
        clock: bench time.

    Raises:
        Unreachable: the bus cannot be opened, or one of the nodes is declared twice.

    """

    wire = "can"

    class Options(BaseModel, extra="forbid"):
        """What the bench file may say about this instrument."""

        pitch_node: int = Field(1, ge=1, le=127, description="node of the drive that pitches")
        roll_node: int = Field(2, ge=1, le=127, description="node of the drive that rolls")
        counts_per_degree: float = Field(36000.0, gt=0, description="encoder counts per degree of the table")
        speed_deg_per_s: float = Field(5.0, gt=0, le=80, description="speed of moves")
        acceleration_deg_per_s2: float = Field(5.0, gt=0, le=320, description="acceleration and deceleration of moves")
        home_method: int = Field(34, ge=-128, le=37, description="CiA 402 homing method; 34 goes to the index mark")
        home_speed_deg_per_s: float = Field(4.0, gt=0, le=40, description="speed of the home search")
        in_position_deg: float = Field(3e-4, gt=0, description="how near the target counts as reached")
        in_position_s: float = Field(0.05, ge=0, le=60, description="and for how long")
        following_error_deg: float = Field(0.5, gt=0, description="behind by more than this the drive gives up")
        homed_bit: Literal[0, 8, 14, 15] = Field(
            15, description="statusword bit by which the drives tell that they are homed; 0 if they do not"
        )
        pitch_deg: tuple[float, float] = Field((-190.0, 190.0), description="lowest and highest pitch")
        roll_deg: tuple[float, float] = Field((-190.0, 190.0), description="lowest and highest roll")
        timeout_s: float = Field(0.3, gt=0, description="wait for an SDO reply")
        eds: str = Field(description="text of the drives' EDS; supplied unless the bench has its own")

        @field_validator("eds")
        @classmethod
        def _readable(cls, text: str) -> str:
            read_eds(text, 1)
            return text

        @model_validator(mode="after")
        def _consistent(self) -> CiA402Pair.Options:
            if self.pitch_node == self.roll_node:
                raise ValueError(f"pitch_node and roll_node are both {self.pitch_node}")
            for name, (low, high) in (("pitch_deg", self.pitch_deg), ("roll_deg", self.roll_deg)):
                if not low < high:
                    raise ValueError(f"{name}: {low:g} is not below {high:g}")
                if max(-low, high) * self.counts_per_degree >= 2**31:
                    raise ValueError(f"{name}: at {self.counts_per_degree:g} counts per degree it exceeds 32 bits")
            return self

    def __init__(self, name: str, address: str, options: Options, wires: Wires, clock: Clock) -> None:
        self.name = name
        self._options = options
        self._clock = clock
        self._line = wires.can(address, name)
        self._where = self._line.where
        self._axes = {
            axis: _Axis(self._line.node(node, read_eds(options.eds, node), options.timeout_s), limits)
            for axis, node, limits in (
                ("pitch", options.pitch_node, options.pitch_deg),
                ("roll", options.roll_node, options.roll_deg),
            )
        }

    def axes(self) -> Mapping[str, tuple[float, float]]:
        """See `Head.axes`."""
        return {name: axis.limits for name, axis in self._axes.items()}

    def identify(self) -> Identity:
        """See `Instrument.identify`. Both drives must follow CiA 402 and be the product the EDS describes."""
        device = read_eds(self._options.eds, 1).device_information
        models, serials, versions = [], [], []
        for name, axis in self._axes.items():
            profile = axis.node.number(_DEVICE_TYPE) & 0xFFFF
            if profile != _PROFILE:
                raise WrongInstrument(f"{self._where}: the {name} node follows profile {profile}, not CiA 402")
            found = axis.node.number(_IDENTITY, _VENDOR), axis.node.number(_IDENTITY, _PRODUCT)
            if found != (device.vendor_number, device.product_number):
                raise WrongInstrument(
                    f"{self._where}: the {name} drive is vendor {found[0]:X}h product {found[1]:X}h; "
                    f"the EDS describes vendor {device.vendor_number:X}h product {device.product_number:X}h"
                )
            models.append(str(axis.node.read(_DEVICE_NAME)))
            versions.append(str(axis.node.read(_SOFTWARE)))
            serials.append(str(axis.node.number(_IDENTITY, _SERIAL)))
        serial = "" if all(s == "0" for s in serials) else "+".join(serials)
        return Identity(
            str(device.vendor_name), "+".join(dict.fromkeys(models)), serial, "+".join(dict.fromkeys(versions))
        )

    def prepare(self) -> None:
        """Reset faults, set speeds, windows and limits, read them back, and enable the drives. Moves nothing.

        Raises:
            InstrumentError: a fault stays, or a drive refuses a setting.
            BadReply: a setting reads back as something else.
            NotReady: a drive does not become enabled.

        """
        options = self._options
        speed, acceleration = options.speed_deg_per_s, options.acceleration_deg_per_s2
        for name, axis in self._axes.items():
            self._set_out(name, axis)
            low, high = (self._counts(limit) for limit in axis.limits)
            settings = {
                (0x6081, 0): self._counts(speed),
                (0x6083, 0): self._counts(acceleration),
                (0x6084, 0): self._counts(acceleration),
                (0x6085, 0): self._counts(4.0 * acceleration),
                (0x6065, 0): self._counts(options.following_error_deg),
                (0x6067, 0): self._counts(options.in_position_deg),
                (0x6068, 0): round(1000.0 * options.in_position_s),
                (0x607D, 1): low,
                (0x607D, 2): high,
                (0x6098, 0): options.home_method,
                (0x6099, 1): self._counts(options.home_speed_deg_per_s),
                (0x6099, 2): self._counts(options.home_speed_deg_per_s / 4.0),
                (0x609A, 0): self._counts(acceleration),
                (MODE, 0): PROFILE_POSITION,
            }
            for (index, subindex), value in settings.items():
                axis.node.write(index, value, subindex)
                found = axis.node.number(index if index != MODE else MODE_DISPLAY, subindex)
                if found != value:
                    raise BadReply(
                        f"{axis.node.where}: {index:04X}h:{subindex:02X} was set to {value} and reads back {found}"
                    )
            axis.fault = ""
        for name, axis in self._axes.items():
            self._enable(name, axis)

    def home(self) -> None:
        """See `Head.home`."""
        for name, axis in self._axes.items():
            axis.homed = self._is_homed(axis, self._status(axis))
            if axis.homed:
                continue
            self._set_out(name, axis)
            axis.node.write(MODE, HOMING)
            self._enable(name, axis)
            axis.node.write(CONTROLWORD, _HOME)
            axis.homing, axis.homed, axis.fault = True, False, ""

    def forget_zeros(self) -> None:
        """See `Referenced.forget_zeros`."""
        for axis in self._axes.values():
            axis.distrusted, axis.homed = True, False

    def move(self, targets_deg: Mapping[str, float]) -> None:
        """See `Head.move`. Targets are rounded to encoder counts.

        Raises:
            LimitError: a target is outside its axis' limits, or no number.
            NotReady: an axis is not homed, or its drive does not take the set-point.

        """
        for name, target in targets_deg.items():
            low, high = self._axes[name].limits
            if not low <= target <= high:
                raise LimitError(f"{self._where}: {name} to {target:g} deg is outside {low:g} to {high:g}")
        moving = [(name, self._axes[name], self._counts(target)) for name, target in targets_deg.items()]
        for name, axis, _ in moving:
            if axis.homed is None:
                axis.homed = self._is_homed(axis, self._status(axis))
            if not axis.homed:
                raise NotReady(f"{self._where}: {name} must be homed before it can go to an angle")
        for _, axis, counts in moving:
            axis.node.write(TARGET, counts)
        for _, axis, _ in moving:
            axis.node.write(CONTROLWORD, _GO)
        for name, axis, _ in moving:
            self._acknowledged(name, axis)
            axis.node.write(CONTROLWORD, _HOLD)

    def read(self) -> Mapping[str, AxisState]:
        """See `Head.read`. Two exchanges an axis."""
        states = {}
        for name, axis in self._axes.items():
            status = self._status(axis)
            position = axis.node.number(POSITION) / self._options.counts_per_degree
            if axis.homing:
                status = self._follow_homing(axis, status)
            state = _state(status)
            axis.homed = self._is_homed(axis, status)
            states[name] = AxisState(
                position_deg=position,
                moving=state in ("enabled", "quick stop") and (axis.homing or not status & _REACHED),
                homed=axis.homed and not axis.homing,
                enabled=state == "enabled",
                fault=self._fault(axis) if state in ("fault", "stopping for a fault") else axis.fault,
            )
        return states

    def stop(self) -> None:
        """See `Head.stop`: halt, the drives staying enabled. A home search that is under way is given up."""
        self._each(lambda axis: axis.node.write(CONTROLWORD, _HALT))

    def quick_stop(self) -> None:
        """Stop all motion as hard as the drives may; they are disabled afterwards."""
        self._each(lambda axis: axis.node.write(CONTROLWORD, _QUICK_STOP))

    def make_safe(self) -> None:
        """See `Instrument.make_safe`: halt; what still turns after a while is stopped hard."""
        self.stop()
        end = self._clock.now() + _STANDSTILL_S
        while any(axis.node.number(VELOCITY) for axis in self._axes.values()):
            if self._clock.now() > end:
                self.quick_stop()
                return
            self._clock.sleep(_POLL_S)

    def close(self) -> None:
        """See `Instrument.close`."""
        self._line.close()

    def _is_homed(self, axis: _Axis, status: int) -> bool:
        """Whether the position is referenced.

        If the drive does not tell, only a search that was seen to end well counts, and only as long as the drive
        stays enabled: one that is not may have been switched off.
        """
        if axis.distrusted:
            return False
        if self._options.homed_bit:
            return bool(status & 1 << self._options.homed_bit)
        return bool(axis.homed) and _state(status) == "enabled"

    def _counts(self, degrees: float) -> int:
        return round(degrees * self._options.counts_per_degree)

    def _each(self, action: Callable[[_Axis], None]) -> None:
        """Do something to both drives, to the second also when the first fails; raises the first error."""
        failed: list[Exception] = []
        for axis in self._axes.values():
            axis.homing = False
            try:
                action(axis)
            except Exception as error:
                failed.append(error)
        if failed:
            raise failed[0]

    def _status(self, axis: _Axis) -> int:
        return axis.node.number(STATUSWORD)

    def _set_out(self, name: str, axis: _Axis) -> None:
        """Bring a drive to a state in which nothing is under way: fault reset, set-points and halt forgotten."""
        state = _state(self._status(axis))
        if state == "fault":
            axis.node.write(CONTROLWORD, 0)
            axis.node.write(CONTROLWORD, _RESET)
            state = _state(self._status(axis))
            if state == "fault":
                raise InstrumentError(axis.node.where, axis.node.number(ERROR_CODE), f"{name}: {self._fault(axis)}")
            axis.node.write(CONTROLWORD, 0)
        elif state == "enabled":
            axis.node.write(CONTROLWORD, _DISABLE)

    def _enable(self, name: str, axis: _Axis) -> None:
        end = self._clock.now() + _ENABLE_S
        before = ""
        while (state := _state(self._status(axis))) != "enabled":
            if self._clock.now() > end or state == "fault":
                text = self._fault(axis) if state == "fault" else "check its enable input and supply"
                raise NotReady(f"{axis.node.where}: the {name} drive stays {state}; {text}")
            if state != before and state in _NEXT:
                axis.node.write(CONTROLWORD, _NEXT[state])
                before = state
            self._clock.sleep(_POLL_S)

    def _acknowledged(self, name: str, axis: _Axis) -> None:
        end = self._clock.now() + _ACKNOWLEDGE_S
        while not (status := self._status(axis)) & _ACKNOWLEDGED:
            state = _state(status)
            if self._clock.now() > end or state != "enabled":
                text = self._fault(axis) if state == "fault" else "prepare it, or look at its display"
                raise NotReady(f"{axis.node.where}: {name} does not take the set-point; it is {state}: {text}")
            self._clock.sleep(_POLL_S)

    def _follow_homing(self, axis: _Axis, status: int) -> int:
        """See whether a home search has ended; the drive then goes back to positioning. Returns the statusword."""
        if status & _HOMING_ERROR:
            axis.fault = "the home search failed; look at the mark and the homing method"
        elif _state(status) == "enabled" and not (status & _REACHED and status & _HOMED_NOW):
            return status
        else:
            axis.homed = _state(status) == "enabled"
            axis.distrusted = axis.distrusted and not axis.homed
        axis.homing = False
        if _state(status) == "enabled":
            axis.node.write(CONTROLWORD, _HOLD)
            axis.node.write(MODE, PROFILE_POSITION)
            status = self._status(axis)
        return status

    def _fault(self, axis: _Axis) -> str:
        code = axis.node.number(ERROR_CODE)
        return f"{_FAULTS.get(code, 'see the drive manual')} (error {code:04X}h)"


def _state(status: int) -> str:
    return next((name for name, (mask, value) in _STATES.items() if status & mask == value), f"unknown ({status:04X}h)")
