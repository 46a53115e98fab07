"""Simulated pair of CiA 402 drives on one CAN bus: the dividing head's pitch and roll.

The data sheet in the options describes the objects of the nodes; the drives themselves are in `cia402_drive`. Units of
speed and acceleration: CiA 402-2, objects 60A9h, 60AAh; codes of CiA 303-2 (B5h increments, B4h revolutions,
41h degrees, C0h revolutions per minute, 03h seconds, 47h minutes, 57h seconds squared).
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Mapping
from functools import partial
from typing import ClassVar

from rig.sims.faults import Kind
from rig.sims.faults.instrument_faults import OF_HEADS
from rig.sims.physics import Plant
from rig.sims.twin import Medium, Role
from rig.sims.twins.cia402_drive import FOLLOWING_ERROR, OVERCURRENT, Drive
from rig.sims.wires.eds import EdsObject, Key, identified, read_eds
from rig.sims.wires.sdo_server import SdoServer
from rig.sims.world import World

_VELOCITY, _ACCELERATION = (0x60A9, 0), (0x60AA, 0)


def rates(
    options: Mapping[str, object], objects: Mapping[Key, EdsObject], counts_per_degree: float
) -> tuple[float, float]:
    """Units on the wire per 1 deg/s and 1 deg/s^2 of the table.

    Args:
        options: those of the bench file; uses `velocity_unit`, `acceleration_unit` and `turns_per_table_turn`.
        objects: objects of the data sheet; counts if neither names a unit.
        counts_per_degree: encoder resolution.
    """
    turns = float(str(options.get("turns_per_table_turn") or 0.0)) or _turns(objects, counts_per_degree)
    per = {"increments": counts_per_degree, "revolutions": turns / 360.0, "degrees": turns, "rpm": turns / 6.0}
    found = []
    for name, key in (("velocity_unit", _VELOCITY), ("acceleration_unit", _ACCELERATION)):
        text = options.get(name)
        factor, thing = _named(str(text)) if text else _coded(objects.get(key))
        found.append(per[thing] / factor)
    return found[0], found[1]


def _named(text: str) -> tuple[float, str]:
    match = re.match(r"(?:([\d.e+-]+) )?(counts|rpm|rev|deg)", text)
    assert match is not None, text
    names = {"counts": "increments", "rpm": "rpm", "rev": "revolutions", "deg": "degrees"}
    return float(match[1] or 1.0), names[match[2]]


def _coded(told: EdsObject | None) -> tuple[float, str]:
    code = int(told.default) if told is not None and isinstance(told.default, int) else 0
    prefix, thing, time = code >> 24 & 0xFF, code >> 16 & 0xFF, code >> 8 & 0xFF
    names = {0xB5: "increments", 0xB4: "rpm" if time == 0x47 else "revolutions", 0x41: "degrees", 0xC0: "rpm"}
    return 10.0 ** (prefix if prefix < 128 else prefix - 256), names.get(thing, "increments")


def _turns(objects: Mapping[Key, EdsObject], counts_per_degree: float) -> float:
    """By feed constant (6092h) or encoder resolution (608Fh) if the data sheet sets them; 1 otherwise."""
    for index in (0x6092, 0x608F):
        over, under = objects.get((index, 1)), objects.get((index, 2))
        if over and under and int(over.default) > int(under.default) > 0:
            return 360.0 * counts_per_degree * int(under.default) / int(over.default)
    return 1.0


REPLY_S = 0.0005
"""Seconds from an SDO request to its reply, both on the wire: about 0.25 ms each at 500 kbit/s."""

_NMT, _EMERGENCY, _SDO_REPLY, _SDO_REQUEST, _BOOT_UP = 0x000, 0x080, 0x580, 0x600, 0x700
_START, _STOP, _PREPARE, _RESET_NODE, _RESET_COMMUNICATION = 0x01, 0x02, 0x80, 0x81, 0x82
_OPERATIONAL, _STOPPED, _PRE_OPERATIONAL = 0x05, 0x04, 0x7F
_STATE_AFTER = {_START: _OPERATIONAL, _STOP: _STOPPED, _PREPARE: _PRE_OPERATIONAL}

Transmit = Callable[[int, bytes], None]


class CiA402PairTwin:
    """The pair.

    Args:
        name: the bench's name for it.
        options: its options in the bench file; `eds` (text), `pitch_node`, `roll_node`, `counts_per_degree` and the
            units of speed and acceleration are used.
        world: virtual time.
        plant: has `head`.
        serial: serial number; the drives report its digits and the node.

    Attributes:
        drives: by axis.
    """

    wire: ClassVar[Medium] = "can"
    roles: ClassVar[frozenset[Role]] = frozenset({"head"})
    faults: ClassVar[tuple[Kind, ...]] = (*OF_HEADS,)

    def __init__(self, name: str, options: Mapping[str, object], world: World, plant: Plant, serial: str) -> None:
        self.name = name
        self._world = world
        self._transmit: Transmit | None = None
        eds = str(options["eds"])
        scale = float(str(options.get("counts_per_degree", 36000)))
        digits = int("".join(c for c in serial if c.isdigit()) or 0) % 10**8
        self.drives: dict[str, Drive] = {}
        self._servers: dict[int, SdoServer] = {}
        self._nodes: dict[int, Drive] = {}
        self._states: dict[int, int] = {}
        self._beats: dict[int, int] = {}
        for default, axis in ((1, "pitch"), (2, "roll")):
            node = int(str(options.get(f"{axis}_node", default)))
            emergency = partial(self._send_emergency, node)
            heartbeat = partial(self._set_heartbeat, node)
            self._states[node], self._beats[node] = _PRE_OPERATIONAL, 0
            objects, number = identified(read_eds(eds, node), eds), 10 * digits + default
            units = rates(options, objects, scale)
            drive = Drive(world, plant.head, axis, scale, units, objects, number, emergency, heartbeat)
            self.drives[axis] = self._nodes[node] = drive
            self._servers[node] = SdoServer(drive)

    def on_frame(self, can_id: int, data: bytes, tx: Transmit) -> None:
        """Take a frame from the bus; answers go to `tx` later."""
        self._transmit = tx
        if can_id == _NMT:
            self._manage(data, tx)
            return
        node = can_id - _SDO_REQUEST
        server = self._servers.get(node)
        if server is None or self._states[node] == _STOPPED:
            return
        if (reply := server.answer(data)) is not None:
            self._world.call_in(REPLY_S, partial(tx, _SDO_REPLY + node, reply))

    def trip(self, axis: str, why: str) -> str:
        """Make a drive fail; `why` is "drive-fault" or "following-error". Returns a sentence."""
        code = FOLLOWING_ERROR if why == "following-error" else OVERCURRENT
        self.drives[axis].fault(code)
        return f"error {code:04X}h, power off"

    def power_cycle(self) -> None:
        """Power off and on: parameters and references are lost, the mechanics do not move."""
        for node, drive in self._nodes.items():
            self._states[node] = _PRE_OPERATIONAL
            drive.power_cycle()

    def _manage(self, data: bytes, tx: Transmit) -> None:
        """Network management: a node, or all of them (0), changes its state or restarts."""
        if len(data) != 2:
            return
        for node, drive in self._nodes.items():
            if data[1] not in (0, node):
                continue
            if data[0] in _STATE_AFTER:
                self._states[node] = _STATE_AFTER[data[0]]
            elif data[0] in (_RESET_NODE, _RESET_COMMUNICATION):
                self._states[node] = _PRE_OPERATIONAL
                if data[0] == _RESET_NODE:
                    drive.power_cycle()
                self._world.call_in(REPLY_S, partial(tx, _BOOT_UP + node, b"\0"))

    def _set_heartbeat(self, node: int, seconds: float) -> None:
        """1017h: send the node's state at this interval from now on; 0 sends none."""
        self._beats[node] += 1
        if seconds > 0:
            self._world.call_in(seconds, partial(self._beat, node, seconds, self._beats[node]))

    def _beat(self, node: int, seconds: float, epoch: int) -> None:
        if epoch != self._beats[node]:
            return
        if self._transmit is not None:
            self._transmit(_BOOT_UP + node, bytes((self._states[node],)))
        self._world.call_in(seconds, partial(self._beat, node, seconds, epoch))

    def _send_emergency(self, node: int, code: int, register: int) -> None:
        if self._transmit is not None:
            frame = struct.pack("<HB5x", code, register)
            self._world.call_in(REPLY_S, partial(self._transmit, _EMERGENCY + node, frame))
