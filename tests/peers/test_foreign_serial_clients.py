"""Clients that others wrote, on one bench that `rig sim` serves: what they do and read is what its world has.

PyMeasure's ESP300 turns the head; PyMeasure's HP34401A and daqmon's HP34970A (written for a 34970A on a serial line
with XON/XOFF) read the sensor on it. What they must read follows from the world file below and the sine of the angle.
"""

from __future__ import annotations

import subprocess
import sys
import tomllib
from math import radians, sin

import pytest
from daqmon.instrument import HP34970A
from pymeasure.adapters import SerialAdapter
from pymeasure.instruments.hp import HP34401A
from pymeasure.instruments.newport import ESP300
from serial import Serial, serial_for_url

pytestmark = pytest.mark.filterwarnings("ignore:It is not known whether this device support SCPI:FutureWarning")

SPEED = 20.0
OFFSET_V, SENSITIVITY_V_PER_G = 0.0123, 5.02
WITHIN_V = 5 * 25e-6 / (10 / 50) ** 0.5 + 20e-6  # noise over ten power line cycles, and the head's and meters' digits
BENCH = """
name = "served"
[instruments.head]
driver = "newport-esp301"
address = "/dev/rig/head"
[instruments.dvm]
driver = "keysight-34401a"
address = "/dev/rig/dvm"
[instruments.scanner]
driver = "keysight-34970a"
address = "/dev/rig/scanner"
channels = { "101" = "volts", "104" = "thermistor-10k" }
[instruments.spare]
driver = "keysight-34401a"
address = "socket://192.0.2.7:4001"
[sensors.x]
axis = "x"
reader = "dvm"
channel = "input"
[sensors.again]
axis = "x"
reader = "scanner"
channel = "101"
[sensors.tcp]
axis = "x"
reader = "spare"
channel = "input"
[temperatures.sensor_temperature_degC]
reader = "scanner"
channel = "104"
place = "package"
[limits]
pitch_deg = [-190, 190]
"""
WORLD = "seed = 7\n" + "".join(
    f"[sensors.{name}]\noffset_V = {OFFSET_V}\nsensitivity_V_per_g = {SENSITIVITY_V_PER_G}\nconing_deg = 0.0\n"
    for name in ("x", "again", "tcp")
)


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """Addresses that `rig sim` serves, by instrument."""
    folder = tmp_path_factory.mktemp("served")
    files = {name: folder / name for name in ("bench.toml", "world.toml", "LIVE.toml")}
    files["bench.toml"].write_text(BENCH)
    files["world.toml"].write_text(WORLD)
    command = [sys.executable, "-m", "rig", "sim", files["bench.toml"], "--world", files["world.toml"], "--live"]
    command += [files["LIVE.toml"], "--speed", str(SPEED), "--for", "60"]
    server = subprocess.Popen(list(map(str, command)), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        assert any("serving" in line for line in server.stdout), "rig sim ended"
        live = tomllib.loads(files["LIVE.toml"].read_text())
        yield {name: instrument["address"] for name, instrument in live["instruments"].items()}
    finally:
        server.terminate()
        server.communicate(timeout=20)


@pytest.fixture(scope="module")
def head(bench):
    port = Serial(bench["head"], 19200, timeout=10.0, rtscts=True)  # as two public clients have it
    client = ESP300(SerialAdapter(port, write_termination="\r", read_termination="\r\n"))
    client.x.enable()
    client.x.home(1)
    client.x.wait_for_stop()
    assert client.x.position == pytest.approx(0.0, abs=1e-3)
    yield client
    port.close()


@pytest.fixture(params=["dvm", "spare"])
def meter(bench, request):
    """On a pseudo-terminal, and behind a TCP port."""
    port = serial_for_url(bench[request.param], 9600, timeout=10.0)
    client = HP34401A(SerialAdapter(port, write_termination="\n", read_termination="\r\n"))
    client.write("SYST:REM")  # which it leaves to others
    yield client
    port.close()


def turned(head, pitch_deg):
    head.x.position = pitch_deg
    head.x.wait_for_stop(delay=3)
    assert head.x.position == pytest.approx(pitch_deg, abs=2e-4)
    assert head.errors == []
    return OFFSET_V + SENSITIVITY_V_PER_G * sin(radians(pitch_deg))


@pytest.mark.parametrize("pitch_deg", [30.0, -45.0])
def test_pymeasure_turns_the_head_and_reads_the_meter(head, meter, pitch_deg):
    truth = turned(head, pitch_deg)
    assert meter.id == "HEWLETT-PACKARD,34401A,0,10-5-2"
    meter.function_ = "DCV"
    meter.range_ = 10
    meter.nplc = 10
    meter.sample_count = 3
    assert meter.reading == pytest.approx([truth] * 3, abs=WITHIN_V)
    assert meter.check_errors() == []


def test_pymeasure_is_told_what_the_head_refuses(head):
    head.x.right_limit = 50.0
    assert head.x.right_limit == 50.0
    head.x.position = 60.0
    head.y.position = 1.0
    assert [error.message for error in head.errors] == ["POSITIVE SOFTWARE LIMIT DETECTED", "MOTOR NOT ENABLED"]
    assert head.x.units == "degree"


def test_daqmon_scans(bench, head):
    truth = turned(head, 20.0)
    client = HP34970A(bench["scanner"])
    client.open()
    try:
        client._raw_write("SYST:REM")
        assert "34970A" in client.idn()
        client.configure_dc_voltage([101], "10", nplc=10)
        client.set_scan_list([101])
        client.enable_channel_in_readings()
        client.set_scan_interval(1.0)
        client.set_scan_count(3)
        assert float(client.query_trigger_count()) == 3.0
        client.initiate_scan()
        client.write("*WAI")
        assert client.get_data_count() == 3
        readings = client.query_readings_with_channels("DATA:REM? 3")
        assert [channel for _, channel in readings] == [101] * 3
        assert [value for value, _ in readings] == pytest.approx([truth] * 3, abs=WITHIN_V)
        assert client.get_data_count() == 0
        assert client.query_channel_function(101) == '"VOLT"'
        assert float(client.query_channel_nplc(101, "VOLT:DC")) == 10.0
        assert client.query("SYST:ERR?") == '+0,"No error"'
    finally:
        client.close()
