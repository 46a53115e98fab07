"""The drivers of meters at `visa://...::SOCKET`, through pyvisa-py, against raw sockets in another process."""

from __future__ import annotations

import subprocess
import sys
import tomllib

import pytest

from rig.bench.plugins import driver_class
from rig.drivers.clock import RealClock, ScaledClock
from rig.drivers.errors import Unreachable
from rig.drivers.wires import Wires

Keysight34401A = driver_class("keysight-34401a")
Keysight34970A = driver_class("keysight-34970a")

BENCH = """
name = "served"
[instruments.dvm]
driver = "keysight-34401a"
address = "socket://192.0.2.7:4001"
[instruments.scanner]
driver = "keysight-34970a"
address = "socket://192.0.2.7:4002"
channels = { "101" = "volts", "104" = "thermistor-10k" }
[instruments.gpib]
driver = "keysight-34401a"
address = "visa://GPIB0::9::INSTR"
[sensors.x]
axis = "x"
reader = "dvm"
[sensors.third]
axis = "x"
reader = "gpib"
[sensors.again]
axis = "x"
reader = "scanner"
channel = "101"
[temperatures.sensor_temperature_degC]
reader = "scanner"
channel = "104"
"""
WORLD = "seed = 7\n" + "".join(
    f"[sensors.{name}]\noffset_V = 0.25\nsensitivity_V_per_g = 0.001\n" for name in ("x", "again", "third")
)


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    """What `rig sim` serves, as its bench file says."""
    folder = tmp_path_factory.mktemp("served")
    files = {name: folder / name for name in ("bench.toml", "world.toml", "LIVE.toml")}
    files["bench.toml"].write_text(BENCH)
    files["world.toml"].write_text(WORLD)
    command = [sys.executable, "-m", "rig", "sim", files["bench.toml"], "--world", files["world.toml"], "--live"]
    command += [files["LIVE.toml"], "--speed", "10", "--for", "60"]
    server = subprocess.Popen(list(map(str, command)), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        assert any("serving" in line for line in server.stdout), "rig sim ended"
        yield tomllib.loads(files["LIVE.toml"].read_text())
    finally:
        server.terminate()
        server.communicate(timeout=20)


@pytest.fixture
def clock(served):
    return ScaledClock(*(served["live"][key] for key in ("speed", "epoch_utc", "started_utc")))


@pytest.fixture
def place(served, monkeypatch):
    """The VISA name of a served instrument; pyvisa-py opens it."""
    monkeypatch.setenv("PYVISA_LIBRARY", "@py")

    def name(instrument):
        host, port = served["instruments"][instrument]["address"].removeprefix("socket://").split(":")
        return f"visa://TCPIP::{host}::{port}::SOCKET"

    return name


def test_a_34401a_reads(place, clock):
    wires = Wires(clock)
    dvm = Keysight34401A("dvm", place("dvm"), Keysight34401A.Options(nplc=1), wires, clock)
    assert dvm.identify().model == "34401A"
    dvm.prepare()
    for count in (3, 5):
        dvm.start(count)
        assert dvm.fetch() == {"input": pytest.approx([0.25] * count, abs=0.05)}
    assert not dvm.restarted()
    wires.close()


def test_rig_sim_serves_an_instrument_on_gpib_at_a_socket(served, clock):
    """Without a VISA library: as behind an adapter that passes lines on to GPIB."""
    instrument = served["instruments"]["gpib"]
    assert instrument["interface"] == "gpib"
    wires = Wires(clock)
    dvm = Keysight34401A("gpib", instrument["address"], Keysight34401A.Options(nplc=1, interface="gpib"), wires, clock)
    dvm.identify()
    dvm.prepare()
    dvm.start(2)
    assert dvm.fetch() == {"input": pytest.approx([0.25] * 2, abs=0.05)}
    wires.close()


def test_a_34970a_reads_volts_and_degrees(place, clock):
    wires = Wires(clock)
    options = Keysight34970A.Options(channels={"101": "volts", "104": "thermistor-10k"}, nplc=1)
    scanner = Keysight34970A("scanner", place("scanner"), options, wires, clock)
    assert scanner.identify().model == "34970A"
    scanner.prepare()
    scanner.start(2)
    found = scanner.fetch()
    assert found["101"] == pytest.approx([0.25] * 2, abs=0.05)
    assert found["104"] == pytest.approx([found["104"][0]] * 2, abs=0.05)
    wires.close()


def test_what_comes_late_is_not_taken_for_the_next_answer(place, clock):
    wires = Wires(clock)
    dvm = Keysight34401A("dvm", place("dvm"), Keysight34401A.Options(nplc=1), wires, clock)
    dvm.identify()
    line = dvm._talk.line
    line.write("*ESE?")  # its answer is nobody's
    clock.sleep(2.0)
    assert line.query("*IDN?").startswith("HEWLETT")
    assert line.query("*OPC?") == "1"
    wires.close()


def test_a_port_on_which_nobody_listens_is_unreachable(monkeypatch):
    monkeypatch.setenv("PYVISA_LIBRARY", "@py")
    clock = RealClock()
    dvm = Keysight34401A("dvm", "visa://TCPIP::127.0.0.1::1::SOCKET", Keysight34401A.Options(), Wires(clock), clock)
    with pytest.raises(Unreachable, match=r"dvm at visa://TCPIP::127.0.0.1::1::SOCKET was lost .*refused"):
        dvm.identify()
