"""A SCPI meter of another maker: no SYSTem:REMote, no Ctrl-C, another form of number, another word to start."""

from __future__ import annotations

from typing import ClassVar

import pytest
from serial_bench import FakePlant, plug_in, wires

from rig.drivers.declared import driver_of
from rig.drivers.errors import BadReply
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


FILE = """
maker = "MAKER"
model = "MODEL 6500"
scpi = true
prepare = ["*RST", "*CLS", "CONF:VOLT:DC 10", "VOLT:DC:NPLC 10"]
errors = { ask = "SYST:ERR?", each = false }
wire = { baud = 9600, frame = "7E2", done = "*OPC?"MORE }
[reader]
unit = "V"
start = "*SRE {mark:d};:START"
fetch = { ask = "FETC?;*SRE?", answer = "{values};{mark:d}" }
abort = "ABOR"
reading_s = 0.5
most = 100
"""


def bench(more="", start="TRIG:COUN {count:d};:INIT", values="{values}"):
    world = World()
    twin = ForeignTwin(world)
    opened, wire = wires(world)
    made = driver_of(FILE.replace("MORE", more).replace("START", start).replace("{values}", values))
    return world, twin, wire, made("dmm", plug_in(world, twin), made.Options(), opened, world)


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


def test_another_makers_habits_would_leave_it_with_errors():
    _, twin, _, meter = bench(', remote = "SYST:REM", clear = "\\u0003"')
    meter.identify()
    assert meter._talk.line.query("SYST:ERR?").startswith("-113")
    meter.prepare()
    meter.start(50)
    meter.make_safe()
    assert b"\x03" in twin.unknown


def test_start_and_form_of_the_readings_are_its_own():
    *_, wire, meter = bench(start="SAMP:COUN {count:d};:INIT", values="{values:1.9}")
    meter.identify()
    meter.prepare()
    wire.log.clear()
    meter.start(2)
    assert wire.sent() == [b"*SRE 1;:SAMP:COUN 2;:INIT\n"]
    with pytest.raises(BadReply, match="expected an answer as in"):
        meter.fetch()
