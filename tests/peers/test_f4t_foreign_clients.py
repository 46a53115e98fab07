"""Clients that others wrote (pymodbus, minimalmodbus) on our F4T twin, served to other processes by `rig sim`."""

from __future__ import annotations

import signal
import tomllib
from collections.abc import Iterator

import minimalmodbus
import pytest
from pymodbus import FramerType
from pymodbus.client import ModbusBaseSyncClient, ModbusSerialClient, ModbusTcpClient

from proving.crashes.kills import rig
from rig.drivers.clock import RealClock

BENCH = """
name = "three-chambers"
[instruments.network]
driver = "watlow-f4t"
address = "modbus-tcp://192.0.2.10:502/1"
power = "event-1"
[instruments.line]
driver = "watlow-f4t"
address = "modbus-rtu:///dev/rig/chambers/2"
[instruments.server]
driver = "watlow-f4t"
address = "modbus-rtu://socket://192.0.2.11:4001/1"
[instruments.daq]
driver = "can-daq"
address = "can:socketcan/can0"
[sensors.level]
axis = "x"
reader = "daq"
channel = "spare_voltage"
"""
OWN = {"network": 6730, "line": 14080, "server": 14080}
UNIT = {"network": 1, "line": 2, "server": 1}


@pytest.fixture(scope="module")
def addresses(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, str]]:
    folder = tmp_path_factory.mktemp("served")
    bench, live = folder / "bench.toml", folder / "LIVE.toml"
    bench.write_text(BENCH)
    process = rig("sim", bench, "--speed", 20, "--live", live, "--for", 60)
    clock = RealClock()
    end = clock.now() + 20.0
    while not live.exists():
        assert process.poll() is None, process.communicate()[1]
        assert clock.now() < end
        clock.sleep(0.02)
    yield {name: one["address"] for name, one in tomllib.loads(live.read_text())["instruments"].items()}
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=10)


def client_of(address: str) -> ModbusBaseSyncClient:
    """pymodbus's own client, with its own sockets and its own serial port."""
    place = address.rpartition("/")[0].partition("://")[2]
    if place.startswith("/dev/"):
        return ModbusSerialClient(place, framer=FramerType.RTU, baudrate=9600, timeout=5)
    framer = FramerType.RTU if "socket" in address else FramerType.SOCKET
    host, _, port = place.removeprefix("socket://").rpartition(":")
    return ModbusTcpClient(host, port=int(port), framer=framer, timeout=5)


@pytest.mark.parametrize("name", ["network", "line", "server"])
def test_pymodbus_reads_sets_and_asks_who_is_there(addresses: dict[str, str], name: str) -> None:
    with client_of(addresses[name]) as client:
        unit = UNIT[name]

        def words(address: int, count: int) -> list[int]:
            reply = client.read_holding_registers(address, count=count, device_id=unit)
            assert not reply.isError(), (address, reply)
            return list(reply.registers)

        def number(address: int) -> float:
            value = client.convert_from_registers(words(address, 2), client.DATATYPE.FLOAT32, word_order="little")
            assert isinstance(value, float)
            return value

        assert "".join(map(chr, words(16, 15))) == "F4T1A2CAA1A1AAA"
        assert words(1328, 1) == words(OWN[name], 1) == [30], "as shipped: degrees Fahrenheit, each for itself"
        client.write_register(1328, 15, device_id=unit)
        fahrenheit = client.convert_to_registers(77.0, client.DATATYPE.FLOAT32, word_order="little")
        assert not client.write_registers(2782, fahrenheit, device_id=unit).isError()
        assert number(2782) == pytest.approx(77.0), "the display's unit changes nothing on a wire"
        client.write_register(OWN[name], 15, device_id=unit)
        assert number(2782) == pytest.approx(25.0)
        assert 10.0 < number(2820) < 35.0
        year = words(14664, 12)[10]
        assert 2025 < year < 2036
        assert [words(16568, 1), words(2784, 2), words(16596, 1)] == [[251], [0, 0], [62]]

        assert client.diag_query_data(b"\x12\x34", device_id=unit).message == b"\x12\x34"
        report = client.report_device_id(device_id=unit)
        assert (report.identifier, report.status) == (b"Watlow F4T1A2CAA1A1AAA", True)
        both = client.readwrite_registers(
            read_address=2782, read_count=2, address=2782, values=words(2810, 2), device_id=unit
        )
        assert both.registers == words(2782, 2)
        assert client.read_holding_registers(1, count=1, device_id=unit).exception_code == 2
        assert client.read_coils(1, count=1, device_id=unit).exception_code == 1


def test_minimalmodbus_reads_and_sets_over_a_serial_line(addresses: dict[str, str]) -> None:
    place = addresses["line"].rpartition("/")[0].removeprefix("modbus-rtu://")
    device = minimalmodbus.Instrument(place, UNIT["line"])
    device.serial.baudrate, device.serial.timeout = 9600, 5.0
    little = minimalmodbus.BYTEORDER_LITTLE_SWAP
    device.write_register(14080, 15, functioncode=6)
    device.write_float(2782, -12.5, byteorder=little)
    assert device.read_float(2782, byteorder=little) == -12.5
    device.write_register(14080, 30, functioncode=16)
    assert device.read_float(2782, byteorder=little) == pytest.approx(9.5)
    assert device.read_register(2730) == 10
    assert device.read_long(12, signed=True, byteorder=little) > 0
    assert bytes(device.read_registers(16, 3)) == b"F4T"
    device.serial.timeout = 0.5  # it waits for as many bytes as an ordinary answer has
    with pytest.raises(minimalmodbus.IllegalRequestError):
        device.write_register(2730, 7, functioncode=6)
    device.serial.close()


def test_an_event_output_starts_and_stops_the_chamber(addresses: dict[str, str]) -> None:
    """As TestEquity's manual has it: event 1 is power, 63 on, 62 off."""
    with client_of(addresses["network"]) as client:
        assert client.read_holding_registers(16594).registers == [63]
        assert not client.write_register(16594, 62).isError()
        assert client.read_holding_registers(2814).registers == [10], "the loop's mode does not tell"
        assert client.write_register(16594, 1).exception_code == 3
        assert not client.write_register(16594, 63).isError()


def test_each_is_served_at_the_kind_of_address_that_it_has(addresses: dict[str, str]) -> None:
    assert addresses["server"].startswith("modbus-rtu://socket://127.0.0.1:")
    assert addresses["line"].startswith("modbus-rtu:///dev/pts/")
    assert addresses["network"].startswith("modbus-tcp://127.0.0.1:")
