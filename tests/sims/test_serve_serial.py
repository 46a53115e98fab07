"""The same drivers against the same twins in another process: pseudo-terminals, TCP, slcan; time made to run fast."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tomllib
from contextlib import contextmanager
from importlib.resources import files
from types import SimpleNamespace

import pytest

from rig.bench.plugins import driver_class
from rig.drivers.cia402 import CiA402Pair
from rig.drivers.clock import RealClock, ScaledClock
from rig.drivers.errors import DriverError
from rig.drivers.newport_esp301 import NewportESP301
from rig.drivers.watlow_f4t import WatlowF4T
from rig.drivers.wires import Wires
from rig.sims.serve import toml

SPEED = 20.0
EDS = files("rig.contracts").joinpath("cia402_drive.eds").read_text(encoding="utf-8")
REGISTERS = files("rig.contracts").joinpath("watlow_f4t.toml").read_text(encoding="utf-8")
BENCH = {
    "name": "served",
    "instruments": {
        "head": {"driver": "newport-esp301", "address": "/dev/rig/head", "serial": "SN4711", "due": None},
        "dvm": {"driver": "keysight-34401a", "address": "/dev/rig/dvm", "nplc": 1},
        "scanner": {
            "driver": "keysight-34970a",
            "address": "/dev/rig/scanner",
            "channels": {"101": "volts", "104": "thermistor-10k"},
            "nplc": 1,
        },
        "enclosure": {"driver": "watlow-f4t", "address": "modbus-tcp://192.0.2.10:502/1", "register_map": REGISTERS},
        "drives": {"driver": "cia402-pair", "address": "can:socketcan/can0", "eds": EDS},
        "oven": {"driver": "watlow-f4t", "address": "modbus-rtu:///dev/ttyUSB1/3", "register_map": REGISTERS},
    },
    "sensors": {"x": {"axis": "x", "reader": "dvm", "channel": "input"}},
    "temperatures": {"sensor_temperature_degC": {"reader": "scanner", "channel": "104", "place": "package"}},
    "limits": {"pitch_deg": [-190, 190]},
}
SERVER = """
import json, pathlib, sys
from rig.sims.serve import serve
from rig.sims.twins.newport_esp301 import NewportESP301Twin
from rig.sims.twins.keysight_34401a import Keysight34401ATwin
from rig.sims.twins.keysight_34970a import Keysight34970ATwin
from rig.sims.twins.watlow_f4t import WatlowF4TTwin
from rig.sims.twins.cia402 import CiA402PairTwin
twins = {"newport-esp301": NewportESP301Twin, "keysight-34401a": Keysight34401ATwin,
         "keysight-34970a": Keysight34970ATwin, "watlow-f4t": WatlowF4TTwin,
         "cia402-pair": CiA402PairTwin}
bench, live, speed, seconds = json.loads(sys.argv[1])
serve(bench, {}, twins, pathlib.Path(live), speed=speed, seconds=seconds, announce=lambda s: print(s, flush=True))
"""


@contextmanager
def served(folder, speed=SPEED, seconds=50.0):
    live = folder / "LIVE.toml"
    arguments = json.dumps([BENCH, str(live), speed, seconds])
    server = subprocess.Popen(
        [sys.executable, "-c", SERVER, arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        for line in server.stdout:
            if line.startswith("serving"):
                break
        bench = tomllib.loads(live.read_text())
        clock = ScaledClock(*(bench["live"][key] for key in ("speed", "epoch_utc", "started_utc")))
        wires = Wires(clock)
        try:
            yield SimpleNamespace(process=server, live=live, bench=bench, clock=clock, wires=wires)
        finally:
            wires.close()
    finally:
        server.terminate()
        server.communicate(timeout=20)


def driver(bench, name, cls):
    instrument = bench.bench["instruments"][name]
    own = {k: v for k, v in instrument.items() if k not in ("driver", "address", "serial", "due", "asset")}
    return cls(name, instrument["address"], cls.Options(**own), bench.wires, bench.clock)


def goes_where_it_is_told(head, clock):
    head.prepare()
    head.home()
    while not all(state.homed for state in head.read().values()):
        clock.sleep(1.0)
    head.move({"pitch": 90.0, "roll": -10.0})
    clock.sleep(1.0)
    while any(state.moving for state in head.read().values()):
        clock.sleep(1.0)
    clock.sleep(5.0)
    states = head.read()
    assert states["pitch"].position_deg == pytest.approx(90.0, abs=5e-4)
    assert states["roll"].position_deg == pytest.approx(-10.0, abs=5e-4)


def test_drivers_work_across_processes(tmp_path):
    with served(tmp_path) as bench:
        assert bench.bench["simulated"] is True
        assert bench.bench["instruments"]["head"]["address"].startswith("/dev/pts/")

        head = driver(bench, "head", NewportESP301)
        assert head.identify().serial == "SN4711"
        goes_where_it_is_told(head, bench.clock)

        dvm = driver(bench, "dvm", driver_class("keysight-34401a"))
        dvm.identify()
        dvm.prepare()
        dvm.start(3)
        upright = dvm.fetch()["input"]
        assert len(upright) == 3
        assert abs(upright[0]) > 0.1, "a sensor along x feels its weight at 90 degrees of pitch"

        scanner = driver(bench, "scanner", driver_class("keysight-34970a"))
        scanner.identify()
        scanner.prepare()
        scanner.start(2)
        readings = scanner.fetch()
        assert readings["101"] == pytest.approx([0.0, 0.0], abs=1e-4)
        assert 10.0 < readings["104"][0] < 35.0


@pytest.mark.parametrize(
    ("name", "address"), [("enclosure", "modbus-tcp://127.0.0.1:"), ("oven", "modbus-rtu:///dev/pts")]
)
def test_modbus_is_served_on_tcp_and_on_a_serial_line(tmp_path, name, address):
    with served(tmp_path) as bench:
        assert bench.bench["instruments"][name]["address"].startswith(address)
        chamber = driver(bench, name, WatlowF4T)
        chamber.identify()
        chamber.prepare()
        chamber.set_temperature(25.0)
        assert chamber.read().setpoint_degC == pytest.approx(25.0, abs=1e-3)
        bench.wires.close()
        assert chamber.read().running, "a second connection is as good as the first"


def test_can_is_served_as_a_serial_adapter(tmp_path):
    with served(tmp_path) as bench:
        assert bench.bench["instruments"]["drives"]["address"].startswith("can:slcan//dev/pts/")
        drives = driver(bench, "drives", CiA402Pair)
        drives.identify()
        goes_where_it_is_told(drives, bench.clock)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_it_and_takes_the_bench_file_away(tmp_path, number):
    with served(tmp_path) as bench:
        assert bench.live.exists()
        began = RealClock().now()
        os.kill(bench.process.pid, number)
        assert bench.process.wait(timeout=10.0) == 0
        assert RealClock().now() - began < 5.0
        assert not bench.live.exists()
        assert list(tmp_path.iterdir()) == []


def test_it_stops_by_itself_when_its_time_is_up(tmp_path):
    with served(tmp_path, seconds=0.3) as bench:
        assert bench.process.wait(timeout=10.0) == 0
        assert not bench.live.exists()


def test_instruments_that_go_away_are_named(tmp_path):
    with served(tmp_path) as bench:
        head = driver(bench, "head", NewportESP301)
        head.read()
        bench.process.kill()
        bench.process.wait(timeout=10.0)
        with pytest.raises(DriverError, match="head at /dev/pts/"):
            head.read()


def test_bench_values_survive_as_toml():
    values = {
        "name": 'a "quoted" name\nin two lines \\ µ',
        "simulated": True,
        "nothing": None,
        "limits": {"pitch_deg": [-190, 190.5]},
        "instruments": {"head": {"speed": 1e-05, "odd key": "x", "channels": {"101": "volts"}}},
    }
    back = tomllib.loads(toml(values))
    del values["nothing"]
    assert back == values
