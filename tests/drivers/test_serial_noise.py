"""Line noise: whatever bytes arrive, a twin goes on and answers the next proper question."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from serial_bench import FakePlant

from rig.sims.twins.keysight_34401a import Keysight34401ATwin
from rig.sims.twins.keysight_34970a import Keysight34970ATwin
from rig.sims.twins.newport_esp301 import NewportESP301Twin
from rig.sims.world import World

ESP301 = (
    NewportESP301Twin,
    "\r",
    "VE?",
    b"ESP301",
    ("1", "2", "PA", "OR", "TP?", "TB?", "MO", "DH", "1e9", "nan", "-", ";"),
)
METER = (
    "*RST",
    "SYST:REM",
    "CONF:VOLT:DC",
    "INIT",
    "FETC?",
    "READ?",
    "TRIG:COUN",
    "(@101:",
    ")",
    "nan",
    "1e99",
    "-1",
    ";",
    " ",
)
TWINS = {
    "esp301": ESP301,
    "34401a": (Keysight34401ATwin, "\n", "*IDN?", b"HEWLETT-PACKARD,34401A", METER),
    "34970a": (Keysight34970ATwin, "\n", "*IDN?", b"HEWLETT-PACKARD,34970A", METER),
}


@pytest.mark.parametrize("name", TWINS)
@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_a_twin_survives_line_noise(name, data):
    cls, end, question, answer, words = TWINS[name]
    piece = st.one_of(st.sampled_from(words).map(str.encode), st.just(end.encode()), st.binary(max_size=6))
    noise = data.draw(st.lists(piece, max_size=30))
    world = World()
    twin = cls("it", {}, world, FakePlant(world, dict.fromkeys(map(str, ("input", *range(101, 121))), 1.0)), "SN1")
    heard = bytearray()
    for part in noise:
        twin.on_rx(part, heard.extend)
        world.sleep(0.01)
    twin.on_rx(b"\x03" + end.encode(), heard.extend)
    world.sleep(100.0)
    heard.clear()
    twin.on_rx(f"{question}{end}".encode(), heard.extend)
    world.sleep(100.0)
    assert heard.startswith(answer)
