"""A CiA 402 drive on canopen's LocalNode, with its SDO server and its reading of the EDS; only the motor is ours."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import canopen

from rig.drivers.wires.can_node import read_eds
from rig.sims.world import World

Transmit = Callable[[int, bytes], None]
_AFTER = {0x06: 0x21, 0x07: 0x23, 0x0F: 0x27}
"""Statusword after a controlword, by its low four bits."""


class ForeignDrive:
    """One node: takes a mode late, counts speeds in rpm of its motor, arrives without a word about windows.

    Args:
        world: virtual time.
        node: node identifier.
        eds: its data sheet.
        counts_per_turn: encoder counts per turn of the motor.
        values: what objects hold, by index and subindex, instead of the defaults.
        mode_late_s: how much later than 6060h the display 6061h follows; infinite: never.

    """

    def __init__(
        self,
        world: World,
        node: int,
        eds: str,
        counts_per_turn: float,
        values: dict[tuple[int, int], int] | None = None,
        mode_late_s: float = 0.0,
    ) -> None:
        self.world = world
        self.counts_per_turn = counts_per_turn
        self.mode_late_s = mode_late_s
        self.written: dict[tuple[int, int], int] = {}
        self.settles_off_by = 0  # counts; where it comes to rest besides its target
        self._values = values or {}
        self._status, self._mode, self._since = 0x40, 0, -1e9
        self._from, self._to, self._begun = 0.0, 0.0, 0.0
        self._acknowledged = self._homed = False
        self._node = canopen.LocalNode(node, read_eds(eds, node))
        self._node.add_write_callback(self._written)
        self._node.add_read_callback(self._read)
        self._network = canopen.Network()
        self._network[node] = self._node

    def on_frame(self, can_id: int, data: bytes, tx: Transmit) -> None:
        """Take a frame; canopen's answers go out half a millisecond later."""

        class Bus:
            def send(self, message: Any) -> None:
                self.world.call_in(5e-4, lambda: tx(message.arbitration_id, bytes(message.data)))

            world = self.world

        self._network.bus = Bus()  # type: ignore[assignment]
        self._network.notify(can_id, bytearray(data), 0.0)

    @property
    def speed_rpm(self) -> int:
        """Profile velocity as it was set."""
        return self.written.get((0x6081, 0), 0)

    def position(self) -> float:
        """Encoder counts at this moment, at constant speed."""
        way = (self.world.now() - self._begun) * self.speed_rpm / 60.0 * self.counts_per_turn
        left = self._to - self._from
        return self._to if abs(left) <= way else self._from + (way if left > 0 else -way)

    def _moving(self) -> bool:
        return self.position() != self._to

    def _written(self, index: int, subindex: int, od: Any, data: bytes) -> None:
        value = int(od.decode_raw(data))
        self.written[index, subindex] = value
        if index == 0x6060:
            self._mode, self._since = value, self.world.now()
        elif index == 0x6040:
            self._control(value)

    def _control(self, word: int) -> None:
        if word & 0x80 or not word & 0x02:
            self._status = 0x40
        elif word & 0x07 == 0x02:
            self._status = 0x07
        else:
            self._status = _AFTER.get(word & 0x0F, self._status)
        if word & 0x100:
            self._from = self._to = self.position()
        elif word & 0x10 and self._status == 0x27:
            if self._mode == 6:
                self._from = self._to = 0.0
                self._homed = True
            elif not self._acknowledged:
                target = self.written[0x607A, 0] + self.settles_off_by
                self._from, self._to, self._begun = self.position(), float(target), self.world.now()
        self._acknowledged = bool(word & 0x10)

    def _read(self, index: int, subindex: int, od: Any) -> int | None:
        if (index, subindex) in self._values:
            return self._values[index, subindex]
        match index:
            case 0x6061:
                return self._mode if self.world.now() >= self._since + self.mode_late_s else 0
            case 0x6064:
                return round(self.position())
            case 0x606C:
                return self.speed_rpm if self._moving() else 0
            case 0x6041:
                bit_12 = self._homed if self._mode == 6 else self._acknowledged
                return self._status | (0 if self._moving() else 1 << 10) | bit_12 << 12
        return None
