"""One axis of a simulated CiA 402 drive: power state machine, profile position, homing.

Source: CiA 402 (IEC 61800-7-201): states and controlword commands, set-point handshake, statusword. Positions are
encoder counts; speeds and accelerations have the units of `cia402.rates`. The mechanics behind the encoder are the
plant's. The drive counts from its position at power-on until homing has found the mark.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import inf

from rig.sims.physics.head import HeadMechanics
from rig.sims.wires import sdo_server as sdo
from rig.sims.wires.eds import EdsObject, Key
from rig.sims.world import World

DISABLED, READY, ON, ENABLED, QUICK_STOP, FAULT = 0x40, 0x21, 0x23, 0x27, 0x07, 0x08
"""States as the low bits of the statusword."""

PROFILE_POSITION, HOMING = 1, 6
FOLLOWING_ERROR, OVERCURRENT = 0x8611, 0x2310
_VOLTAGE, _REMOTE, _REACHED, _LIMITED, _BIT_12, _BIT_13, _REFERENCED = (1 << n for n in (4, 9, 10, 11, 12, 13, 15))
_NEW_SETPOINT, _AT_ONCE, _RELATIVE, _RESET, _HALT = (1 << n for n in (4, 5, 6, 7, 8))
_BRAKE_S = 0.05  # the brake releases before the axis may move
_HISTORY, _REMEMBERED = 0x1003, 4
_SAVE = 0x65766173
_NOT_KEPT = (_HISTORY, 0x1010, 0x6040, 0x6060, 0x607A)
_MODE_SHOWN_S = 0.004  # a drive reports a new mode of operation with a delay
_OWN_WINDOW = 100  # counts, for drives without a settable position window
_HOMING_METHODS = (33, 34, 35, 37)  # to the mark from either side; or "here"


class Drive:
    """One axis; its objects are the wire's `rig.sims.wires.sdo_server.Objects`.

    Args:
        world: virtual time.
        head: the mechanics.
        axis: "pitch" or "roll".
        counts_per_degree: encoder resolution.
        rates: units of speed and acceleration on the wire.
        objects: objects of the data sheet; for others the drive has fixed settings.
        serial: serial number.
        emergency: sends an emergency message: error code, error register.
        heartbeat: called with the interval of heartbeats, seconds; 0 for none.
    """

    def __init__(
        self,
        world: World,
        head: HeadMechanics,
        axis: str,
        counts_per_degree: float,
        rates: tuple[float, float],
        objects: Mapping[Key, EdsObject],
        serial: int,
        emergency: Callable[[int, int], None],
        heartbeat: Callable[[float], None] = lambda seconds: None,
    ) -> None:
        self._world = world
        self._head = head
        self._axis = axis
        self._scale = counts_per_degree
        self._per_deg_s, self._per_deg_s2 = rates
        self._objects = objects
        self._serial = serial
        self._emergency = emergency
        self._heartbeat = heartbeat
        self._stored: dict[Key, int] = {}
        self._computed: dict[Key, Callable[[], int]] = {
            (0x1001, 0): lambda: 0x21 if self._state == FAULT else 0,
            (0x603F, 0): lambda: self._error,
            (0x6041, 0): self._statusword,
            (0x1003, 0): lambda: len(self._history),
            (0x6061, 0): lambda: self._shown_mode,
            (0x6062, 0): self._demand,
            (0x6064, 0): lambda: self._counts(self._world.now()),
            (0x606C, 0): lambda: round(head.speed_deg_per_s(axis, world.now()) * self._per_deg_s),
            (0x60F4, 0): lambda: self._demand() - self._counts(self._world.now()),
        }
        self._effects: dict[Key, Callable[[int], None]] = {
            (0x1003, 0): self._clear_history,
            (0x1010, 1): self._store,
            (0x1017, 0): lambda ms: self._heartbeat(ms / 1000.0),
            (0x6040, 0): self._control,
            (0x6060, 0): self._choose_mode,
            (0x6098, 0): self._check_method,
        }
        self._epoch = 0
        self.power_cycle()

    def power_cycle(self) -> None:
        """Power off and on: parameters and reference are lost, the axis stops."""
        self._head.stop(self._axis)
        self._values = {key: o.default for key, o in self._objects.items() if isinstance(o.default, int)}
        self._values |= self._stored
        self._values[0x1018, 4] = self._serial
        self._shown_mode = self._values[0x6060, 0]
        self._history: list[int] = []
        self._zero_deg = self._head.encoder_deg(self._axis, self._world.now())
        self._state = DISABLED
        self._error = 0
        self._controlword = 0
        self._target = 0
        self._waiting: int | None = None
        self._acknowledged = self._limited = self._halted = False
        self._homing = self._homed = self._referenced = self._homing_failed = False
        self._epoch += 1
        self._heartbeat(self._values.get((0x1017, 0), 0) / 1000.0)

    def fault(self, code: int) -> None:
        """Fail with an error code: motion stops, power goes off, an emergency message is sent."""
        self._head.stop(self._axis, self._braking(0x6085))
        self._state, self._error = FAULT, code
        self._history = [code, *self._history][:_REMEMBERED]
        self._give_up()
        self._emergency(code, 0x21)

    def read(self, index: int, subindex: int) -> bytes:
        """An object's value. Raises `Aborted`."""
        found = self._find(index, subindex)
        if found.access == "wo":
            raise sdo.Aborted(sdo.WRITE_ONLY)
        if isinstance(found.default, str):
            return found.pack(found.default)
        key = (index, subindex)
        if index == _HISTORY and subindex:
            if subindex > len(self._history):
                raise sdo.Aborted(sdo.NO_DATA)
            return found.pack(self._history[subindex - 1])
        compute = self._computed.get(key)
        return found.pack(compute() if compute else self._values[key])

    def write(self, index: int, subindex: int, data: bytes) -> None:
        """Set an object's value. Raises `Aborted`."""
        found = self._find(index, subindex)
        if found.access in ("ro", "const"):
            raise sdo.Aborted(sdo.READ_ONLY)
        if len(data) != found.size:
            raise sdo.Aborted(sdo.TOO_LONG if found.size is None or len(data) > found.size else sdo.TOO_SHORT)
        value = found.unpack(data)
        if found.high is not None and value > found.high:
            raise sdo.Aborted(sdo.TOO_HIGH)
        if found.low is not None and value < found.low:
            raise sdo.Aborted(sdo.TOO_LOW)
        effect = self._effects.get((index, subindex))
        if effect:
            effect(value)
        if (index, subindex) not in ((_HISTORY, 0), (0x1010, 1)):
            self._values[index, subindex] = value

    def _braking(self, index: int) -> float:
        """Deceleration of a stop (6084h) or a quick stop (6085h), deg/s^2; a fixed one if the data sheet has none."""
        own = self._values[0x6083, 0] * (4 if index == 0x6085 else 1)
        return (self._values.get((index, 0)) or own) / self._per_deg_s2

    def _clear_history(self, value: int) -> None:
        if value:
            raise sdo.Aborted(sdo.OUT_OF_RANGE)
        self._history.clear()

    def _store(self, signature: int) -> None:
        """Save settings to non-volatile memory; the signature is "save"."""
        if signature != _SAVE:
            raise sdo.Aborted(sdo.NOT_STORED)
        kept = {key for key, o in self._objects.items() if o.access == "rw" and key[0] not in _NOT_KEPT}
        self._stored = {key: value for key, value in self._values.items() if key in kept}

    def _find(self, index: int, subindex: int) -> EdsObject:
        try:
            return self._objects[index, subindex]
        except KeyError:
            known = any(i == index for i, _ in self._objects)
            raise sdo.Aborted(sdo.NO_SUBINDEX if known else sdo.NO_OBJECT) from None

    # Power: controlword commands by their target states.

    def _control(self, word: int) -> None:
        rising, falling = word & ~self._controlword, self._controlword & ~word
        self._controlword = word
        if self._state == FAULT:
            if rising & _RESET:
                self._state, self._error = DISABLED, 0
                self._emergency(0, 0)
            return
        if not word & 0x02:
            self._disable(DISABLED)
        elif not word & 0x04:
            self._stop_quickly()
        elif not word & 0x01:
            if self._state != QUICK_STOP:
                self._disable(READY)
        elif not word & 0x08:
            if self._state in (READY, ON, ENABLED):
                self._disable(ON)
        elif self._state in (READY, ON):
            self._state = ON
            self._later(_BRAKE_S, self._enable)
        if self._state == ENABLED:
            self._operate(word, rising, falling)

    def _disable(self, state: int) -> None:
        if self._state in (ENABLED, QUICK_STOP):
            self._head.stop(self._axis, self._braking(0x6084))
        self._give_up()
        self._state = state

    def _stop_quickly(self) -> None:
        if self._state in (READY, ON):
            self._disable(DISABLED)
        elif self._state == ENABLED:
            self._head.stop(self._axis, self._braking(0x6085))
            self._give_up()
            self._state = QUICK_STOP
            if self._values.get((0x605A, 0), 2) < 5:  # slow down, then disable; from 5 on it stays in this state
                self._later(self._ends() - self._world.now(), lambda: self._disable(DISABLED))

    def _enable(self) -> None:
        self._state = ENABLED
        self._target = self._counts(self._world.now())
        self._halted = bool(self._controlword & _HALT)

    def _give_up(self) -> None:
        """Discard set-points, homing, and scheduled actions."""
        self._epoch += 1
        self._waiting = None
        self._acknowledged = self._limited = self._halted = self._homing = False

    def _later(self, seconds: float, action: Callable[[], None]) -> None:
        """Schedule an action that is cancelled if the drive fails before."""
        self._epoch += 1
        epoch = self._epoch

        def due() -> None:
            if epoch == self._epoch:
                action()

        self._world.call_in(seconds, due)

    # Motion: meaning of bits 4 to 8 of the controlword in the mode of operation.

    def _operate(self, word: int, rising: int, falling: int) -> None:
        if rising & _HALT:
            self._head.stop(self._axis, self._braking(0x6084))
            self._epoch += 1
            self._halted, self._homing = True, False
        if self._values[0x6060, 0] == HOMING:
            if falling & _HALT:
                self._halted = False
            if rising & _NEW_SETPOINT and not self._halted:
                self._start_homing()
            return
        if self._values[0x6060, 0] != PROFILE_POSITION:
            return
        if rising & _NEW_SETPOINT and not self._acknowledged:
            self._take_setpoint(word)
        if not word & _NEW_SETPOINT and self._waiting is None:
            self._acknowledged = False
        if falling & _HALT:
            self._halted = False
            self._go()

    def _take_setpoint(self, word: int) -> None:
        target = self._values[0x607A, 0] + (self._target if word & _RELATIVE else 0)
        low, high = (self._values.get((0x607D, n), own) for n, own in ((1, -(2**31)), (2, 2**31 - 1)))
        self._limited = not low <= target <= high
        target = min(max(target, low), high)
        self._acknowledged = True
        if word & _AT_ONCE or not self._moving():
            self._epoch += 1
            self._target, self._waiting = target, None
            if not word & _HALT:
                self._halted = False
                self._go()
        else:
            self._waiting = target
            self._later(self._ends() - self._world.now(), self._take_waiting)

    def _take_waiting(self) -> None:
        if self._waiting is not None:
            self._target, self._waiting = self._waiting, None
            self._acknowledged = bool(self._controlword & _NEW_SETPOINT)
            self._go()

    def _go(self) -> None:
        speed = self._values[0x6081, 0] / self._per_deg_s
        acceleration = min(self._values[0x6083, 0] / self._per_deg_s2, self._braking(0x6084))
        self._head.move(self._axis, self._target / self._scale + self._zero_deg, speed, acceleration)

    def _start_homing(self) -> None:
        self._homed = self._homing_failed = self._referenced = False
        told = self._objects.get((0x6098, 0))
        method = self._values[0x6098, 0] if told is not None and "w" in told.access else _HOMING_METHODS[1]
        if method not in _HOMING_METHODS:
            self._homing_failed = True
            return
        if method in (35, 37):
            self._reference(self._head.encoder_deg(self._axis, self._world.now()))
            return
        speed = (self._values.get((0x6099, 1)) or self._values[0x6081, 0]) / self._per_deg_s
        acceleration = (self._values.get((0x609A, 0)) or self._values[0x6083, 0]) / self._per_deg_s2
        self._head.move(self._axis, 0.0, speed, acceleration)
        self._homing = True
        self._later(self._ends() - self._world.now(), lambda: self._reference(0.0))

    def _reference(self, mark_deg: float) -> None:
        """The encoder angle `mark_deg` becomes the home position."""
        self._zero_deg = mark_deg - self._values.get((0x607C, 0), 0) / self._scale
        self._target = self._values.get((0x607C, 0), 0)
        self._homing = False
        self._homed = self._referenced = True

    def _choose_mode(self, mode: int) -> None:
        if mode not in (0, PROFILE_POSITION, HOMING):
            raise sdo.Aborted(sdo.OUT_OF_RANGE)
        if self._state == ENABLED and self._moving():
            raise sdo.Aborted(sdo.NOT_IN_THIS_STATE)

        def show() -> None:
            if self._values[0x6060, 0] == mode:
                self._shown_mode = mode

        self._world.call_in(_MODE_SHOWN_S, show)

    def _check_method(self, method: int) -> None:
        if method not in (0, *_HOMING_METHODS):
            raise sdo.Aborted(sdo.OUT_OF_RANGE)

    # Observable state.

    def _ends(self) -> float:
        return self._head.axes[self._axis].leg(inf).end

    def _moving(self) -> bool:
        return self._head.moving(self._axis, self._world.now())

    def _counts(self, t: float) -> int:
        return round((self._head.encoder_deg(self._axis, t) - self._zero_deg) * self._scale)

    def _demand(self) -> int:
        """Angle of the profile generator: on the way, or at the target while the axis still creeps."""
        arrived = self._state == ENABLED and not self._halted and not self._moving()
        return self._target if arrived else self._counts(self._world.now())

    def _reached(self) -> bool:
        """Bit 10. In position means inside the window for its time; after a move the axis only creeps nearer."""
        if self._values[0x6060, 0] == HOMING:
            return not self._homing and not self._moving()
        if self._halted or self._state != ENABLED:
            return not self._moving()
        since = self._world.now() - self._values.get((0x6068, 0), 0) / 1000.0
        near = abs(self._counts(since) - self._target) <= self._values.get((0x6067, 0), _OWN_WINDOW)
        return near and since >= self._ends() and self._waiting is None

    def _statusword(self) -> int:
        word = self._state | _VOLTAGE | _REMOTE
        if self._reached():
            word |= _REACHED
        if self._limited:
            word |= _LIMITED
        if self._referenced:
            word |= _REFERENCED
        homing = self._values[0x6060, 0] == HOMING
        if self._homed if homing else self._acknowledged:
            word |= _BIT_12
        if self._homing_failed if homing else self._error == FOLLOWING_ERROR:
            word |= _BIT_13
        return word
