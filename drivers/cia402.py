"""Two CiA 402 drives on one CAN bus: a dividing head's pitch and roll, in profile position mode by SDO.

Source: CiA 402 (IEC 61800-7-201). Objects are read and written as described by the EDS; the controller program passes
it as text. Positions on the wire are encoder counts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from operator import eq
from typing import ClassVar

from rig.drivers.cia402_settings import (
    ERROR_CODE,
    VELOCITY,
    CiA402Options,
    Scales,
    homed_bit,
    judged_here,
    lacking,
    meanings_of,
    settings_of,
)
from rig.drivers.cia402_words import error_text, state_of
from rig.drivers.clock import Clock
from rig.drivers.driver import ContractFile, Medium
from rig.drivers.errors import BadReply, InstrumentError, LimitError, NotReady, WrongInstrument
from rig.drivers.kept import not_kept
from rig.drivers.roles import AxisState, Identity
from rig.drivers.wires import Wires
from rig.drivers.wires.can_node import CanNode, read_eds

CONTROLWORD, STATUSWORD = 0x6040, 0x6041
MODE, MODE_DISPLAY, PROFILE_POSITION, HOMING = 0x6060, 0x6061, 1, 6
POSITION, TARGET = 0x6064, 0x607A
_DEVICE_TYPE, _DEVICE_NAME, _SOFTWARE, _IDENTITY = 0x1000, 0x1008, 0x100A, 0x1018
_VENDOR, _PRODUCT, _SERIAL = 1, 2, 4
_PROFILE = 402

_COMMANDS = 8
"""Commands to enable a drive at most; it takes four, and more if it falls back."""
_NEXT = {"disabled": 0x06, "ready": 0x07, "switched on": 0x0F, "quick stop": 0x00}
"""Controlword for the next step from a state to "enabled"."""

_REACHED, _ACKNOWLEDGED, _HOMED_NOW, _HOMING_ERROR = 1 << 10, 1 << 12, 1 << 12, 1 << 13
_DISABLE, _HOLD, _GO, _HOME, _HALT, _QUICK_STOP, _RESET = 0x07, 0x0F, 0x3F, 0x1F, 0x10F, 0x02, 0x80
_POLL_S = 0.01
_ENABLE_S, _ACKNOWLEDGE_S, _STANDSTILL_S, _MODE_S = 2.0, 0.5, 5.0, 1.0
"""Longest waits for a drive, seconds; chosen."""


@dataclass
class _Axis:
    """One drive and its known state.

    Attributes:
        node: the drive.
        limits: (low, high) in degrees.
        homing: a home search was started and its end has not been seen.
        homed: whether the position is referenced, None if unknown.
        fault: the fault that ended the last home search.
        distrusted: whether the zero must be found again, whatever the drive reports.
        target_deg: last target; None if the drive is neither there nor on its way.
        near_since: bench time since which it has been near its target; only if this driver judges it.
        kept: objects by (index, subindex) that stay as they were prepared.
    """

    node: CanNode
    limits: tuple[float, float]
    homing: bool = False
    homed: bool | None = None
    fault: str = ""
    distrusted: bool = False
    target_deg: float | None = None
    near_since: float | None = None
    kept: dict[tuple[int, int], int] = field(default_factory=dict)


class CiA402Pair:
    """The head's two drives; satisfies `rig.drivers.roles.Head`, `Remarking` and `SelfChecking`.

    Args:
        name: the bench's name for it.
        address: CAN address.
        options: see `Options`.
        wires: where to open it.
        clock: bench time.

    Raises:
        Unreachable: the bus cannot be opened, or one of the nodes is declared twice.

    """

    wire: ClassVar[Medium] = "can"
    contracts: ClassVar[tuple[ContractFile, ...]] = (ContractFile("eds", "rig.contracts", "cia402_drive.eds"),)

    Options = CiA402Options

    def __init__(self, name: str, address: str, options: CiA402Options, wires: Wires, clock: Clock) -> None:
        self.name = name
        self._options = options
        self._clock = clock
        self._line = wires.can(address, name)
        self._where = self._line.where
        self._dictionary = read_eds(options.eds, 1)
        self._judged_here = judged_here(self._dictionary)
        self._homed_bit = homed_bit(self._dictionary, options)
        self._rounded: list[str] = []
        self._axes = {
            axis: _Axis(self._line.node(node, read_eds(options.eds, node), options.timeout_s), limits)
            for axis, node, limits in (
                ("pitch", options.pitch_node, options.pitch_deg),
                ("roll", options.roll_node, options.roll_deg),
            )
        }

    def remarks(self) -> Sequence[str]:
        """Settings that are not used, or not as declared: objects missing in the EDS, and rounded speeds."""
        return (*lacking(self._dictionary), *dict.fromkeys(self._rounded))

    def axes(self) -> Mapping[str, tuple[float, float]]:
        """Axis name ("pitch", "roll") to its (low, high) limits in degrees."""
        return {name: axis.limits for name, axis in self._axes.items()}

    def identify(self) -> Identity:
        """Ask for the identity. Both drives must follow CiA 402 and be the product the EDS describes."""
        device = self._dictionary.device_information
        models, serials, versions = [], [], []
        for name, axis in self._axes.items():
            profile = axis.node.number(_DEVICE_TYPE) & 0xFFFF
            if profile != _PROFILE:
                raise WrongInstrument(f"{self._where}: the {name} node follows profile {profile}, not CiA 402")
            found = tuple(self._told(axis, _IDENTITY, subindex) for subindex in (_VENDOR, _PRODUCT))
            described = device.vendor_number, device.product_number
            if any(a and b is not None and a != str(b) for a, b in zip(found, described, strict=True)):
                told, meant = (" product ".join(_hex(n) for n in pair) for pair in (found, described))
                words = f"the {name} drive is vendor {told}; the EDS describes vendor {meant}"
                raise WrongInstrument(f"{self._where}: {words}")
            models.append(self._told(axis, _DEVICE_NAME) or str(device.product_name or "CiA 402 drive"))
            versions.append(self._told(axis, _SOFTWARE))
            serials.append(self._told(axis, _IDENTITY, _SERIAL) or "0")
        serial = "" if all(s == "0" for s in serials) else "+".join(serials)
        model, version = ("+".join(dict.fromkeys(told)) for told in (models, versions))
        return Identity(str(device.vendor_name or "maker not told"), model, serial, version)

    def prepare(self) -> None:
        """Reset faults, set speeds, windows and limits, read them back, and enable the drives. Moves nothing.

        Raises:
            InstrumentError: a fault persists, or a drive refuses a setting.
            BadReply: a setting reads back differently, or units of speed are unknown or contradict the bench file; the
                message names the key.
            NotReady: a drive does not become enabled, or does not take its mode.
        """
        self._rounded.clear()
        for name, axis in self._axes.items():
            axis.homed = self._is_homed(axis, self._status(axis))  # after enabling, it would not report a power cut
            self._set_out(name, axis)
            scales = Scales(axis.node, self._options)
            for index, subindex, value in tuple(settings_of(axis.node, scales, self._options, axis.limits)):
                axis.node.write(index, value, subindex)
                if (found := axis.node.number(index, subindex)) != value:
                    raise BadReply(
                        f"{axis.node.where}: {index:04X}h:{subindex:02X} was set to {value} and reads back {found}"
                    )
                axis.kept[index, subindex] = value
            self._rounded += scales.remarks
            self._set_mode(axis, PROFILE_POSITION)
            axis.kept |= meanings_of(axis.node)
            axis.target_deg = None
            axis.fault = ""
        for name, axis in self._axes.items():
            self._enable(name, axis)

    def wrong(self) -> Sequence[str]:
        """Settings that are not as declared: mode, settings and units of both drives, which other tools can change."""
        return [
            f"{name}: {index:04X}h:{sub:02X} reads {found}, not {wanted}"
            for name, axis in self._axes.items()
            for (index, sub), wanted, found in not_kept(axis.kept, lambda key: axis.node.number(*key), eq)  # noqa: B023
        ]

    def home(self) -> None:
        """Start homing every axis that is not homed; poll `read` until all are homed and none moves."""
        for name, axis in self._axes.items():
            axis.homed = self._is_homed(axis, self._status(axis))
            if axis.homed:
                continue
            self._set_out(name, axis)
            self._set_mode(axis, HOMING)
            self._enable(name, axis)
            axis.node.write(CONTROLWORD, _HOME)
            axis.homing, axis.homed, axis.fault, axis.target_deg = True, False, "", None

    def forget_zeros(self) -> None:
        """Make `read` report every axis as not homed, so that `home` finds all zeros again."""
        for axis in self._axes.values():
            axis.distrusted, axis.homed = True, False

    def move(self, targets_deg: Mapping[str, float]) -> None:
        """Start moving the named axes to absolute angles, together. Targets are rounded to encoder counts.

        Raises:
            LimitError: a target is outside its axis' limits, or not a number.
            NotReady: an axis is not homed, or its drive does not accept the set-point.
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
            axis.target_deg, axis.near_since = counts / self._options.counts_per_degree, None
        # All targets first, then the starts: the axes begin together, one message apart.
        for _, axis, _ in moving:
            axis.node.write(CONTROLWORD, _GO)
        for name, axis, _ in moving:
            self._acknowledged(name, axis)
            axis.node.write(CONTROLWORD, _HOLD)  # a new set-point is taken at the rising edge of its bit

    def read(self) -> Mapping[str, AxisState]:
        """Read every axis. Two exchanges per axis."""
        states = {}
        for name, axis in self._axes.items():
            status = self._status(axis)
            position = axis.node.number(POSITION) / self._options.counts_per_degree
            if axis.homing:
                status = self._follow_homing(axis, status)
            state = state_of(status)
            axis.homed = self._is_homed(axis, status)
            reached = bool(status & _REACHED) and self._arrived(axis, position)
            states[name] = AxisState(
                position_deg=position,
                moving=state in ("enabled", "quick stop") and (axis.homing or not reached),
                homed=axis.homed and not axis.homing,
                enabled=state == "enabled",
                fault=self._fault(axis) if state in ("fault", "stopping for a fault") else axis.fault,
            )
        return states

    def stop(self) -> None:
        """Stop: halt, with the drives enabled. A running home search is given up."""
        self._each(lambda axis: axis.node.write(CONTROLWORD, _HALT))

    def quick_stop(self) -> None:
        """Stop all motion with the maximum deceleration; the drives are disabled afterwards."""
        self._each(lambda axis: axis.node.write(CONTROLWORD, _QUICK_STOP))

    def make_safe(self) -> None:
        """The safe state: halt; an axis that still turns after a while gets a quick stop."""
        self.stop()
        end = self._clock.now() + _STANDSTILL_S
        while any(self._turns(axis) for axis in self._axes.values()):
            if self._clock.now() > end:
                self.quick_stop()
                return
            self._clock.sleep(_POLL_S)

    def close(self) -> None:
        """Release the wire; idempotent."""
        self._line.close()

    def _is_homed(self, axis: _Axis, status: int) -> bool:
        """Whether the position is referenced.

        If the drive does not report it, only a search with an observed good end counts, and only while the drive stays
        enabled: a disabled drive may have been switched off.
        """
        if axis.distrusted:
            return False
        if self._homed_bit:
            return bool(status & 1 << self._homed_bit)
        return bool(axis.homed) and state_of(status) == "enabled"

    def _arrived(self, axis: _Axis, position_deg: float) -> bool:
        """Whether an axis has been near its target for long enough, for a drive without an adjustable target window."""
        if not self._judged_here or axis.target_deg is None:
            return True
        if abs(position_deg - axis.target_deg) > self._options.in_position_deg:
            axis.near_since = None
            return False
        if axis.near_since is None:
            axis.near_since = self._clock.now()
        return self._clock.now() - axis.near_since >= self._options.in_position_s

    def _turns(self, axis: _Axis) -> bool:
        """Whether it still turns after a halt; by bit 10 of the statusword if the drive does not report its speed."""
        if axis.node.has(VELOCITY):
            return axis.node.number(VELOCITY) != 0
        return not self._status(axis) & _REACHED

    def _told(self, axis: _Axis, index: int, subindex: int = 0) -> str:
        """An object as text, "" if the EDS does not have it."""
        return str(axis.node.read(index, subindex)) if axis.node.has(index, subindex) else ""

    def _set_mode(self, axis: _Axis, mode: int) -> None:
        """Set a mode of operation and wait until the drive reports it, which some do late."""
        axis.node.write(MODE, mode)
        end = self._clock.now() + _MODE_S
        while (shown := axis.node.number(MODE_DISPLAY)) != mode:
            if self._clock.now() > end:
                raise NotReady(
                    f"{axis.node.where}: it was put into mode {mode} (6060h) and still shows mode {shown} (6061h) "
                    f"after {_MODE_S:g} s; see its manual for when it changes modes, and whether it has mode {mode}"
                )
            self._clock.sleep(_POLL_S)
        axis.kept[MODE_DISPLAY, 0] = mode

    def _counts(self, degrees: float) -> int:
        return round(degrees * self._options.counts_per_degree)

    def _each(self, action: Callable[[_Axis], None]) -> None:
        """Call a function for both drives, for the second also if the first fails; raises the first error."""
        failed: list[Exception] = []
        for axis in self._axes.values():
            axis.homing, axis.target_deg = False, None
            try:
                action(axis)
            except Exception as error:
                failed.append(error)
        if failed:
            raise failed[0]

    def _status(self, axis: _Axis) -> int:
        return axis.node.number(STATUSWORD)

    def _set_out(self, name: str, axis: _Axis) -> None:
        """Bring a drive to a state without motion: reset the fault, clear set-points and halt."""
        state = state_of(self._status(axis))
        if state == "fault":
            axis.node.write(CONTROLWORD, 0)  # a reset is the rising edge of bit 7, which may be set already
            axis.node.write(CONTROLWORD, _RESET)
            state = state_of(self._status(axis))
            if state == "fault":
                raise InstrumentError(axis.node.where, self._error(axis), f"{name}: {self._fault(axis)}")
            axis.node.write(CONTROLWORD, 0)
        elif state == "enabled":
            axis.node.write(CONTROLWORD, _DISABLE)

    def _enable(self, name: str, axis: _Axis) -> None:
        # Each command has its own time, and time is read before the state: a slow computer is no slow drive.
        before, commands, now = "", 0, self._clock.now()
        end = now + _ENABLE_S
        while (state := state_of(self._status(axis))) != "enabled":
            goes_on = state != before and state in _NEXT and commands < _COMMANDS
            if state == "fault" or (now > end and not goes_on):
                text = self._fault(axis) if state == "fault" else "check its enable input and supply"
                raise NotReady(f"{axis.node.where}: the {name} drive stays {state}; {text}")
            if goes_on:
                axis.node.write(CONTROLWORD, _NEXT[state])
                before, commands, end = state, commands + 1, self._clock.now() + _ENABLE_S
            self._clock.sleep(_POLL_S)
            now = self._clock.now()

    def _acknowledged(self, name: str, axis: _Axis) -> None:
        now = self._clock.now()
        end = now + _ACKNOWLEDGE_S
        while not (status := self._status(axis)) & _ACKNOWLEDGED:
            state = state_of(status)
            if now > end or state != "enabled":
                text = self._fault(axis) if state == "fault" else "prepare it, or look at its display"
                raise NotReady(f"{axis.node.where}: {name} does not take the set-point; it is {state}: {text}")
            self._clock.sleep(_POLL_S)
            now = self._clock.now()

    def _follow_homing(self, axis: _Axis, status: int) -> int:
        """Check whether a home search has ended; the drive then returns to positioning. Returns the statusword."""
        if status & _HOMING_ERROR:
            axis.fault = "the home search failed; look at the mark and the homing method"
        elif state_of(status) == "enabled" and not (status & _REACHED and status & _HOMED_NOW):
            return status
        else:
            axis.homed = state_of(status) == "enabled"
            axis.distrusted = axis.distrusted and not axis.homed
        axis.homing = False
        if state_of(status) == "enabled":
            axis.node.write(CONTROLWORD, _HOLD)
            self._set_mode(axis, PROFILE_POSITION)
            status = self._status(axis)
        return status

    def _error(self, axis: _Axis) -> int:
        return axis.node.number(ERROR_CODE) if axis.node.has(ERROR_CODE) else 0

    def _fault(self, axis: _Axis) -> str:
        if not axis.node.has(ERROR_CODE):
            return "see the drive's display; its EDS has no error code (603Fh)"
        code = self._error(axis)
        return error_text(code)


def _hex(number: object) -> str:
    return f"{int(str(number)):X}h" if str(number or "").isdigit() else "not told"
