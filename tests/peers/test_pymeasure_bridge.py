"""PyMeasure's own drivers as instruments of a bench, on our twins in another process; what they make of each other."""

from __future__ import annotations

import signal
import tomllib
from collections.abc import Iterator
from typing import Any

import pytest

from proving.crashes.kills import rig, wait_for
from rig.bench.bench_file import check_options
from rig.bench.config import parse_bench
from rig.drivers.clock import RealClock
from rig.drivers.errors import BadReply, InstrumentError, NoReply
from rig.drivers.wires import Wires
from rig.instruments.opening import Bench, open_bench

SERVED = """name = "bath and meter"
[instruments.bath]
driver = "fluke-7341"
address = "/dev/ttyUSB1"
[instruments.meter]
driver = "keithley-2000"
address = "/dev/ttyUSB0"
[sensors.x]
reader = "meter"
[factors]
bath_degC = "bath"
"""
BENCH = """name = "bath and meter"
[instruments.bath]
driver = "pymeasure:fluke.Fluke7341"
address = "{bath}"
maker = "Fluke"
model = "7341"
check = [{{ ask = "unit", answer = "{{text}}", is = "C" }}]
[instruments.bath.source]
unit = "degC"
low = 0
high = 95
set = "set_point"
setpoint = "set_point"
read = "temperature"
safe_value = 25
tolerance = 0.05
dwell_s = 0
[instruments.meter]
driver = "pymeasure:keithley.Keithley2000"
address = "{meter}"
wire = {{ timeout_s = 5 }}
{reader}
[sensors.x]
reader = "meter"
[factors]
bath_degC = "bath"
"""


@pytest.fixture(scope="module")
def served(tmp_path_factory) -> Iterator[dict[str, Any]]:
    """The twins in another process, for at most two minutes."""
    folder = tmp_path_factory.mktemp("bench")
    (folder / "bench.toml").write_text(SERVED)
    live = folder / "LIVE.toml"
    server = rig("sim", folder / "bench.toml", "--speed", 300, "--live", live, "--for", 120)
    wait_for(live.exists, server)
    found = tomllib.loads(live.read_text())["instruments"]
    yield {name: found[name]["address"] for name in ("bath", "meter")}
    server.send_signal(signal.SIGTERM)
    server.communicate(timeout=10)


@pytest.fixture
def bench(served) -> Iterator[Any]:
    opened: list[Bench] = []

    def made(reader: str = 'reader = { unit = "V", reading = "voltage" }') -> Bench:
        config = parse_bench(BENCH.format(**served, reader=reader), "bench")
        clock = RealClock()
        opened.append(open_bench(config, check_options(config, "bench"), clock, Wires(clock)))
        return opened[-1]

    yield made
    for one in opened:
        one.close()


def test_pymeasures_bath_and_meter_are_a_source_and_a_reader(bench):
    it = bench()
    bath, meter = it.instruments["bath"], it.instruments["meter"]
    assert bath.identify().model == "7341"
    assert meter.identify().maker == "KEITHLEY INSTRUMENTS INC."
    bath.prepare()
    meter.prepare()
    bath.set(30.25)
    assert bath.read().setpoint == 30.25
    assert bath.wrong() == ()
    meter.start(3)
    (readings,) = meter.fetch().values()
    assert len(readings) == 3
    assert all(abs(value) < 1.0 for value in readings)
    bath.make_safe()
    assert bath.read().safe


def test_its_limits_and_names_are_said(bench):
    bath = bench().instruments["bath"]
    with pytest.raises(InstrumentError, match="ValueError"):  # PyMeasure's own range ends at 150
        bath._guarded._talk.line.write("set_point = 151")
    with pytest.raises(InstrumentError, match="did you mean set_point"):
        bath._guarded._talk.line.write("setpoint = 20")


@pytest.mark.parametrize(
    ("reading", "error"), [("id", BadReply), ("voltag", InstrumentError), ("ask('NOTHING?')", NoReply)]
)
def test_what_gives_no_number_in_time_is_no_reading(bench, reading, error):
    meter = bench(f'reader = {{ unit = "V", reading = "{reading}" }}').instruments["meter"]
    meter.identify()
    meter.start(1)
    with pytest.raises(error):
        meter.fetch()
