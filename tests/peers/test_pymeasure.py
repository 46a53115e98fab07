"""PyMeasure's drivers of a voltmeter and a motion controller on our twins, in virtual time."""

from __future__ import annotations

import pytest
from pymeasure.adapters import SerialAdapter
from pymeasure.instruments.hp import HP34401A
from pymeasure.instruments.newport import ESP300
from serial import serial_for_url
from serial_bench import FakePlant, plug_in

from rig.sims.twins.keysight_34401a import Keysight34401ATwin
from rig.sims.twins.newport_esp301 import NewportESP301Twin
from rig.sims.world import World

pytestmark = pytest.mark.filterwarnings("ignore:It is not known whether this device support SCPI:FutureWarning")


def test_pymeasures_hp34401a_reads_the_twin():
    """A driver we did not write; it never asks for remote control, so that is done for it."""
    world = World()
    twin = Keysight34401ATwin("dvm", {}, world, FakePlant(world, {"input": 2.5}), "")
    twin.go_remote()
    port = serial_for_url(plug_in(world, twin), baudrate=9600, bytesize=7, parity="E", stopbits=2, timeout=60.0)
    dvm = HP34401A(SerialAdapter(port, write_termination="\n", read_termination="\r\n"))
    assert dvm.id == "HEWLETT-PACKARD,34401A,0,10-5-2"
    assert dvm.function_ == "DCV"
    dvm.range_ = 10
    dvm.nplc = 1
    assert (dvm.range_, dvm.autorange, dvm.nplc) == (10.0, False, 1.0)
    assert dvm.reading == pytest.approx(2.5, abs=2e-5)
    dvm.sample_count = 4
    dvm.trigger_count = 2
    dvm.autozero_enabled = False
    assert dvm.reading == pytest.approx([2.5] * 8, abs=2e-5)
    dvm.init_trigger()
    assert dvm.stored_reading == pytest.approx([2.5] * 8, abs=2e-5)
    assert dvm.stored_readings_count == 8
    assert dvm.check_errors() == []
    port.close()


def test_pymeasures_esp300_drives_the_twin():
    """A driver we did not write: enable, home, move, wait, read back, limits, errors."""
    world = World()
    plant = FakePlant(world)
    twin = NewportESP301Twin("head", {}, world, plant, "SN000042")
    port = serial_for_url(plug_in(world, twin), baudrate=19200, timeout=60.0)
    client = ESP300(SerialAdapter(port, write_termination="\r", read_termination="\r\n"))
    client.x.enable()
    assert client.x.enabled
    client.x.home(1)
    client.x.wait_for_stop()
    assert client.x.position == pytest.approx(0.0, abs=1e-3)
    client.x.position = 20.0
    client.x.wait_for_stop()
    assert client.x.position == pytest.approx(20.0, abs=1e-4)
    assert client.x.units == "degree"
    client.x.right_limit = 25.0
    assert client.x.right_limit == 25.0
    client.x.position = 30.0
    client.y.position = 1.0
    assert [e.message for e in client.errors] == ["POSITIVE SOFTWARE LIMIT DETECTED", "MOTOR NOT ENABLED"]
    assert client.errors == []
    port.close()
