"""Several F4T controllers: two on one RS-485 line, and two chambers of one bench, dry and in another process."""

from __future__ import annotations

import os
import pty
import signal
import threading
import tty
from collections.abc import Iterator
from pathlib import Path
from typing import cast

import pytest
from buses import REGISTER_MAP

from proving.crashes.kills import rig
from rig.bench.bench_file import check_options
from rig.bench.config import BenchConfig, parse_bench
from rig.drivers.clock import Clock, RealClock, ScaledClock
from rig.drivers.errors import NoReply
from rig.drivers.roles import Chamber, Reader
from rig.drivers.watlow_f4t import WatlowF4T
from rig.drivers.wires import Wires
from rig.instruments.opening import Bench, identities, open_bench
from rig.sims.physics import Plant
from rig.sims.twins.watlow_f4t import WatlowF4TTwin
from rig.sims.wires.modbus_slave import RtuSlave, crc16
from rig.sims.world import World
from rig.simulated.dry_run import DryBench

TWO_CHAMBERS = """
name = "two-chambers"

[instruments.sensor_chamber]
driver = "watlow-f4t"
address = "{sensor_chamber}"
low_degC = -140
high_degC = 40
alarms = 1

[instruments.sse_chamber]
driver = "watlow-f4t"
address = "modbus-rtu:///dev/rig/chambers/2"
low_degC = -60
high_degC = 60
ramp_degC_per_min = 2
alarms = 1

[instruments.daq]
driver = "can-daq"
address = "can:socketcan/can0"

[factors]
sensor_temperature_degC = "sensor_chamber"
sse_temperature_degC = "sse_chamber"

[sensors.level]
axis = "x"
reader = "daq"
channel = "spare_voltage"

[temperatures.sensor_temperature_degC]
reader = "daq"
channel = "sensor_temperature"
place = "sensors"

[temperatures.sse_temperature_degC]
reader = "daq"
channel = "sse_temperature"
place = "sse"
"""


@pytest.fixture
def line() -> Iterator[tuple[str, dict[int, WatlowF4TTwin]]]:
    """Two controllers on one serial line, answering in a thread."""
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    world = World()
    plant = Plant(world, {}, {})
    options = {"register_map": REGISTER_MAP}
    twins = {unit: WatlowF4TTwin(f"oven{unit}", options, world, plant, f"SN00000{unit}") for unit in (1, 2)}
    slave = RtuSlave({unit: twin.registers for unit, twin in twins.items()})

    def serve() -> None:
        while b"stop" not in (data := os.read(ours, 4096)):
            for reply in slave.feed(data):
                os.write(ours, reply)

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    yield os.ttyname(theirs), twins
    os.write(theirs, b"stop")
    thread.join(5)
    os.close(ours)
    os.close(theirs)


def test_two_controllers_share_a_serial_line(line: tuple[str, dict[int, WatlowF4TTwin]]) -> None:
    device, twins = line
    clock, log = RealClock(), []
    wires = Wires(clock, tap=lambda name, way, data: log.append((name, way, data)))
    options = WatlowF4T.Options(register_map=REGISTER_MAP, timeout_s=2.0)
    one, two = (WatlowF4T(f"oven{n}", f"modbus-rtu://{device}/{n}?baud=115200", options, wires, clock) for n in (1, 2))
    assert [oven.identify().serial for oven in (one, two, one)] == ["1", "2", "1"]
    twins[2].set_alarm(3, "error")
    assert [oven.read().alarms for oven in (one, two)] == [(), ("alarm 3: its sensor cannot be read",)]
    for name, way, data in log:
        assert data[0] == int(name[-1]), (name, way, data.hex())
        assert crc16(data[:-2]) == data[-2:]
    silent = WatlowF4T.Options(register_map=REGISTER_MAP, timeout_s=0.05)
    three = WatlowF4T("oven3", f"modbus-rtu://{device}/3?baud=115200", silent, wires, clock)
    with pytest.raises(NoReply, match=rf"oven3 at modbus-rtu://{device}/3\?baud=115200 did not answer .* this unit"):
        three.identify()
    assert two.identify().serial == "2", "a silent neighbour does not spoil the line"
    wires.close()


def opened(bench: BenchConfig, clock: Clock, wires: Wires) -> Bench:
    return open_bench(bench, check_options(bench, "bench.toml"), clock, wires)


def drive_both(bench: Bench, settle_s: float) -> None:
    """Send the two chambers to different temperatures and look at them and at the unit that reads them."""
    chambers: dict[str, Chamber] = bench.chambers
    found = identities(bench)
    assert len({found[name]["serial"] for name in chambers}) == 2
    for instrument in bench.instruments.values():
        instrument.prepare()
    targets = {"sensor_chamber": -100.0, "sse_chamber": 45.0}
    for name, target in targets.items():
        chambers[name].set_temperature(target)
    bench.clock.sleep(settle_s)
    daq = cast(Reader, bench.instruments["daq"])
    bench.clock.sleep(daq.start(3))
    readings = daq.fetch()
    for (name, target), channel in zip(targets.items(), ("sensor_temperature", "sse_temperature"), strict=True):
        state = chambers[name].read()
        assert state.setpoint_degC == pytest.approx(target, abs=1e-3)
        assert len(readings[channel]) == 3
        if settle_s:
            assert state.temperature_degC == pytest.approx(target, abs=0.5)
            assert readings[channel] == pytest.approx([target] * 3, abs=3.0)


def test_two_chambers_of_a_dry_bench_go_their_own_ways() -> None:
    text = TWO_CHAMBERS.format(sensor_chamber="modbus-tcp://192.0.2.10:502/1")
    dry = DryBench(parse_bench(text, "bench.toml"), {})
    bench = opened(dry.config, dry.world, dry.wires)
    drive_both(bench, settle_s=12 * 3600.0)
    bench.close()
    dry.close()


def test_in_a_cascade_the_chambers_temperature_is_the_one_that_the_unit_reads() -> None:
    text = TWO_CHAMBERS.format(sensor_chamber="modbus-tcp://192.0.2.10:502/1")
    text = text.replace("low_degC = -140", "low_degC = -140\ncascade = true")
    dry = DryBench(parse_bench(text, "bench.toml"), {})
    bench = opened(dry.config, dry.world, dry.wires)
    chamber = bench.chambers["sensor_chamber"]
    chamber.set_temperature(-40.0)
    dry.world.sleep(1800.0)
    daq = cast(Reader, bench.instruments["daq"])
    daq.start(1)
    (part_degC,) = daq.fetch()["sensor_temperature"]
    air_degC = dry.sim.plant.chamber("sensor_chamber").air_degC(dry.world.now())
    assert chamber.read().temperature_degC == pytest.approx(part_degC, abs=0.05)
    assert part_degC - air_degC > 1.0
    bench.close()
    dry.close()


def test_two_chambers_and_the_unit_live_in_another_process(tmp_path: Path) -> None:
    bench_file, live = tmp_path / "bench.toml", tmp_path / "LIVE.toml"
    bench_file.write_text(TWO_CHAMBERS.format(sensor_chamber="modbus-rtu:///dev/rig/chambers/1"))
    server = rig("sim", bench_file, "--speed", 20, "--live", live, "--for", 40)
    try:
        real = RealClock()
        end = real.now() + 20.0
        while not live.exists():
            assert server.poll() is None, server.communicate()[1]
            assert real.now() < end
            real.sleep(0.02)
        config = parse_bench(live.read_text(), str(live))
        assert config.live is not None
        clock = ScaledClock(config.live.speed, config.live.epoch_utc, config.live.started_utc)
        bench = opened(config, clock, Wires(clock))
        try:
            drive_both(bench, settle_s=0.0)
        finally:
            bench.close()
    finally:
        server.send_signal(signal.SIGTERM)
        server.communicate(timeout=10)
