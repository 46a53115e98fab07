"""canopen's client of CiA 402 drives, BaseNode402, against our simulated pair."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import canopen
import pytest
from buses import EDS
from canopen.profiles.p402 import BaseNode402
from canopen.sdo import SdoAbortedError, SdoCommunicationError

from rig.drivers.wires.can_node import read_eds
from rig.sims.physics import Plant
from rig.sims.twins.cia402 import CiA402PairTwin
from rig.sims.twins.cia402_drive import OVERCURRENT
from rig.sims.world import World

COUNTS_PER_DEGREE = 36000
SAVE = 0x65766173


class Loopback:
    """A python-can bus whose other end is the pair; every exchange takes 2 ms of its time."""

    def __init__(self) -> None:
        self.world = World()
        self.plant = Plant(self.world, {"head": {"start_pitch_deg": 12.0}}, {})
        self.pair = CiA402PairTwin("head", {"eds": EDS}, self.world, self.plant, "SN004711")
        self.network = canopen.Network()
        self.network.bus = self  # type: ignore[assignment]
        self.node = BaseNode402(1, read_eds(EDS, 1))
        self.node.sdo.RESPONSE_TIMEOUT = 0.01
        self.network[1] = self.node

    def send(self, message: Any) -> None:
        self.pair.on_frame(message.arbitration_id, bytes(message.data), self._heard)
        self.world.sleep(0.002)

    def _heard(self, can_id: int, data: bytes) -> None:
        self.network.notify(can_id, bytearray(data), self.world.now())


@pytest.fixture
def bus() -> Iterator[Loopback]:
    loopback = Loopback()
    yield loopback
    loopback.network.bus = None


def ready(bus: Loopback) -> BaseNode402:
    bus.node.nmt.send_command(0x81)  # reset the node: it boots up, which says that it is pre-operational
    bus.node.setup_402_state_machine()
    bus.node.nmt.state = "OPERATIONAL"
    return bus.node


def test_it_boots_up_and_its_heartbeat_says_its_state(bus: Loopback) -> None:
    node = ready(bus)
    assert node.nmt.state == "OPERATIONAL"
    node.nmt._state = 0  # forget it: only a heartbeat tells
    node.sdo[0x1017].raw = 100
    bus.world.sleep(0.15)
    assert node.nmt.state == "OPERATIONAL"
    node.nmt.send_command(0x80)
    bus.world.sleep(0.15)
    assert node.nmt.state == "PRE-OPERATIONAL"
    node.sdo[0x1017].raw = 0
    node.nmt._state = 0
    bus.world.sleep(1.0)
    assert node.nmt._state == 0, "no heartbeat any more"


def test_a_stopped_node_answers_nothing(bus: Loopback) -> None:
    node = ready(bus)
    node.nmt.state = "STOPPED"
    with pytest.raises(SdoCommunicationError):
        _ = node.sdo[0x6041].raw
    node.nmt.state = "PRE-OPERATIONAL"
    assert node.sdo[0x6041].raw & 0x4F == 0x40


def test_it_is_enabled_homed_and_moved_by_the_foreign_client(bus: Loopback) -> None:
    node = ready(bus)
    node.op_mode = "PROFILED POSITION"
    assert node.op_mode == "PROFILED POSITION"
    node.state = "OPERATION ENABLED"
    assert node.state == "OPERATION ENABLED"
    assert node.homing(timeout=30, restore_op_mode=True)
    assert node.op_mode == "PROFILED POSITION"
    node.sdo[0x6081].raw = 10 * COUNTS_PER_DEGREE
    node.sdo[0x607A].raw = 30 * COUNTS_PER_DEGREE
    for word in (0x0F, 0x3F):
        node.controlword = word
    assert node.statusword & 1 << 12, "set-point acknowledged"
    node.controlword = 0x0F
    bus.world.sleep(20.0)
    assert node.statusword & 1 << 10
    assert node.sdo[0x6064].raw == pytest.approx(30 * COUNTS_PER_DEGREE, abs=2)
    assert bus.plant.head.true_deg("pitch", bus.world.now()) == pytest.approx(30.0, abs=1e-4)
    for state in ("SWITCHED ON", "READY TO SWITCH ON", "SWITCH ON DISABLED"):
        node.state = state
        assert node.state == state


def test_a_fault_is_told_remembered_and_reset(bus: Loopback) -> None:
    node = ready(bus)
    node.state = "OPERATION ENABLED"
    for code in (OVERCURRENT, 0x8611):
        bus.pair.drives["pitch"].fault(code)
        bus.world.sleep(0.01)
        assert node.is_faulted()
        assert node.emcy.active[-1].code == code
        node.reset_from_fault()
        assert node.state == "OPERATION ENABLED"
    history = node.sdo[0x1003]
    assert [history[0].raw, history[1].raw, history[2].raw] == [2, 0x8611, OVERCURRENT], "the newest first"
    with pytest.raises(SdoAbortedError) as nothing:
        _ = history[3].raw
    assert nothing.value.code == 0x08000024
    with pytest.raises(SdoAbortedError):
        history[0].raw = 1
    history[0].raw = 0
    assert history[0].raw == 0


def test_settings_survive_a_power_cut_only_when_they_have_been_stored(bus: Loopback) -> None:
    node = ready(bus)
    node.sdo[0x6083].raw = 40000
    bus.pair.power_cycle()
    assert node.sdo[0x6083].raw == 144000
    node.sdo[0x6083].raw = 40000
    with pytest.raises(SdoAbortedError) as refused:
        node.sdo[0x1010][1].raw = 1
    assert refused.value.code == 0x08000020
    node.sdo[0x1010][1].raw = SAVE
    bus.pair.power_cycle()
    assert node.sdo[0x6083].raw == 40000


def test_its_units_are_told(bus: Loopback) -> None:
    node = ready(bus)
    assert [node.sdo[index].raw for index in (0x60A8, 0x60A9, 0x60AA)] == [0x00B50000, 0x00B50300, 0x00B55700]
