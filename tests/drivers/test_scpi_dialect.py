"""A SCPI meter of another maker: no SYSTem:REMote, no Ctrl-C, another form of number, another word to start."""

from __future__ import annotations

import re
from typing import ClassVar

import pytest
from serial_bench import FakePlant, plug_in, wires

from rig.drivers.errors import BadReply
from rig.drivers.scpi import SYNC, Dialect, ScpiMeter
from rig.drivers.wires import SerialSettings
from rig.sims.twins.keysight_34401a import Keysight34401ATwin
from rig.sims.twins.scpi_syntax import Command, compiled
from rig.sims.world import World


class ForeignTwin(Keysight34401ATwin):
    """Refuses what only Hewlett-Packard's meters know on RS-232, and prints fewer digits."""

    identity = "MAKER,MODEL 6500,04512345,1.7.12b"
    commands: ClassVar = {
        **{k: v for k, v in Keysight34401ATwin.commands.items() if not k.startswith(("SYST:REM", "SYSTEM:REM"))},
        **compiled([Command("ABORt", set="stop_measuring")]),
    }

    def __init__(self, world):
        super().__init__("dmm", {"interface": "gpib"}, world, FakePlant(world, {"input": 1.2345}), "")
        self.unknown = bytearray()

    def on_rx(self, data, tx):
        self.unknown += bytes(b for b in data if b < 0x20 and b not in b"\r\n")
        super().on_rx(data, tx)

    def hears_clear(self):
        return False

    def printed(self, reading):
        return f"{reading.value:.6g}"


class ForeignMeter(ScpiMeter):
    most_sweeps = 100

    def channels(self):
        return ("input",)

    def sweep_s(self):
        return 0.5

    def prepare(self):
        self._configure(("CONF:VOLT:DC 10", "VOLT:DC:NPLC 10"))


def bench(*dialect):
    world = World()
    twin = ForeignTwin(world)
    opened, wire = wires(world)
    line = opened.serial(plug_in(world, twin), SerialSettings(9600, "7E2", timeout_s=2.0, sync=SYNC), "dmm")
    return world, twin, wire, ForeignMeter(line, world, "MODEL 6500", *dialect)


def test_nothing_of_another_makers_habits_is_assumed():
    _, twin, wire, meter = bench()
    assert meter.identify().serial == "04512345"
    meter.prepare()
    meter.start(3)
    assert meter.fetch()["input"] == pytest.approx([1.2345] * 3, abs=1e-4)
    meter.start(50)
    meter.make_safe()
    assert not twin.measuring, "ABORt is every SCPI instrument's"
    assert twin.unknown == b""
    assert not any(b"REM" in line for line in wire.sent())


def test_another_makers_habits_would_leave_it_measuring_and_with_errors():
    _, twin, _, meter = bench(Dialect(remote="SYST:REM", clear="\x03"))
    meter.identify()
    assert meter._line.query("SYST:ERR?").startswith("-113")
    meter.prepare()
    meter.start(50)
    meter.make_safe()
    assert twin.measuring
    assert b"\x03" in twin.unknown


def test_start_and_form_of_the_readings_are_its_own():
    dialect = Dialect(start="SAMP:COUN {count};:INIT", reading=re.compile(r"\d\.\d{9}"))
    *_, wire, meter = bench(dialect)
    meter.identify()
    meter.prepare()
    wire.log.clear()
    meter.start(2)
    assert wire.sent() == [b"*SRE 1;:SAMP:COUN 2;:INIT\n"]
    with pytest.raises(BadReply, match="expected readings and the measurement's mark"):
        meter.fetch()
