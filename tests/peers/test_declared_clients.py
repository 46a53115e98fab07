"""Clients that others wrote, on twins made from files: PyMeasure's meters and bath, minimalmodbus on the registers."""

from __future__ import annotations

from typing import Any

import minimalmodbus
import pytest
from pymeasure.adapters import SerialAdapter
from pymeasure.instruments.fluke import Fluke7341
from pymeasure.instruments.keithley import Keithley2000, KeithleyDMM6500
from serial import Serial, serial_for_url
from serial_bench import FakePlant, plug_in

from rig.bench.plugins import declared
from rig.sims.declared import twin_of
from rig.sims.physics.laboratory import Source
from rig.sims.physics.laboratory_truth import SourceTruth
from rig.sims.wires.modbus_slave import RtuSlave
from rig.sims.world import World

pytestmark = pytest.mark.filterwarnings("ignore:It is not known whether this device support SCPI:FutureWarning")


class _Plant(FakePlant):
    """A plant with one source, whatever the instrument's name."""

    def __init__(self, world: World, channels: dict[str, float] | None = None) -> None:
        super().__init__(world, channels or {})
        self._of = Source(SourceTruth(), world.now(), "it", time_constant_s=10.0)

    def source(self, instrument: str) -> Source:
        return self._of

    def channel_degC(self, instrument: str, channel: str, t: float) -> float:
        return float("inf")


def made(name: str, channels: dict[str, float] | None = None) -> tuple[Any, World]:
    world = World()
    return twin_of(declared()[name])("it", {}, world, _Plant(world, channels), "SN1"), world


def adapter(twin: Any, world: World, end: str) -> SerialAdapter:
    port = serial_for_url(plug_in(world, twin), baudrate=twin.baud, timeout=60.0)
    return SerialAdapter(port, write_termination=end, read_termination=end)


@pytest.mark.parametrize(
    ("name", "client", "reading"),
    [("keithley-2000", Keithley2000, "voltage"), ("keithley-dmm6500", KeithleyDMM6500, "")],
)
def test_pymeasures_meters_are_identified_and_read(name, client, reading):
    twin, world = made(name, {"input": 1.25})
    it = client(adapter(twin, world, "\n"))
    assert twin.table.model[0] in it.id
    if reading:
        assert getattr(it, reading) == pytest.approx(1.25, abs=1e-4)
    assert float(it.ask(":READ?")) == pytest.approx(1.25, abs=1e-4)
    if reading:  # PyMeasure's DMM6500 asks for its language, which the file does not know
        assert it.check_errors() == []


def test_pymeasures_bath_is_set_and_read():
    twin, world = made("fluke-7341")
    it = Fluke7341(adapter(twin, world, "\r\n"))
    assert it.id == "Fluke,7341,NA,1.0"
    assert it.unit == "C"
    it.set_point = 40
    assert it.set_point == 40.0
    world.sleep(100.0)
    assert it.temperature == pytest.approx(40.0, abs=0.02)


class _Port(Serial):
    """A serial port with a slave at its end."""

    def __init__(self, slave: RtuSlave) -> None:
        super().__init__()
        self._slave, self._heard, self.is_open = slave, b"", True

    def write(self, data: bytes) -> None:
        self._heard += b"".join(self._slave.feed(data))

    def read(self, size: int) -> bytes:
        found, self._heard = self._heard[:size], self._heard[size:]
        return found

    def reset_input_buffer(self) -> None:
        self._heard = b""

    def reset_output_buffer(self) -> None:
        pass

    def flush(self) -> None:
        pass

    def close(self) -> None:
        self.is_open = False


def on_registers(name: str) -> tuple[minimalmodbus.Instrument, Any, World]:
    twin, world = made(name)
    return minimalmodbus.Instrument(_Port(RtuSlave({1: twin.registers})), 1), twin, world


def test_minimalmodbus_drives_the_eurotherm():
    client, twin, world = on_registers("eurotherm-3200")
    client.write_register(2, 80.5, 1, functioncode=6, signed=True)
    assert client.read_register(2, 1, signed=True) == 80.5
    client.write_register(199, 0, functioncode=6)
    world.sleep(200.0)
    assert client.read_register(1, 1, signed=True) == pytest.approx(80.5)
    assert twin.quantity.on
    with pytest.raises(minimalmodbus.IllegalRequestError):
        client.read_register(777)


def test_minimalmodbus_drives_the_flow_controller():
    client, _, world = on_registers("bronkhorst-modbus")
    assert client.read_long(0xF108) == int.from_bytes(b"DMFC", "big")
    client.write_register(0x21, 16000, functioncode=6)
    world.sleep(300.0)
    assert client.read_register(0x20) == 16000
    assert client.read_float(0xF108) != 0.0
