"""A declared driver on an instrument of others: pyvisa-sim's own generator, over GPIB and USB."""

from __future__ import annotations

import pytest

from rig.drivers.clock import RealClock
from rig.drivers.declared import driver_of
from rig.drivers.errors import InstrumentError, LimitError, WrongInstrument
from rig.drivers.wires import Wires

GENERATOR = """
maker = "LSG"
model = "generator"
parameters = { serial = "1234" }
prepare = [{ tell = "!CAL", answer = "OK" }]
[identity]
ask = "?IDN"
answer = "LSG Serial #{serial}"
[errors]
replies = ["FREQ_ERROR", "ERROR"]
[source]
unit = "Hz"
low = 0.5
high = 100000
set = { tell = "!FREQ {value:.2}", answer = "OK" }
setpoint = { ask = "?FREQ", answer = "{value:.2}" }
on = { tell = "!OUT 1", answer = "OK" }
off = { tell = "!OUT 0", answer = "OK" }
output = "?OUT"
dwell_s = 0
"""


@pytest.fixture(params=["visa://GPIB0::8::INSTR", "visa://USB0::0x1111::0x2222::0x1234::INSTR"])
def generator(request, monkeypatch):
    monkeypatch.setenv("PYVISA_LIBRARY", "@sim")
    clock = RealClock()
    wires = Wires(clock)
    driver = driver_of(GENERATOR)
    yield driver("it", request.param, driver.Options(), wires, clock)
    wires.close()


def test_it_is_identified_set_and_made_safe(generator):
    assert generator.identify().maker == "LSG"
    generator.prepare()
    generator.set(1234.56)
    state = generator.read()
    assert (state.setpoint, state.output, state.settled) == (1234.56, True, True)
    generator.make_safe()
    assert generator.read().safe


def test_its_refusal_is_an_error_in_its_words(generator):
    generator.prepare()
    with pytest.raises(InstrumentError, match=r"after '!FREQ 0\.60': it refuses \(FREQ_ERROR\)"):
        generator.set(0.6)  # its own limit is 1
    with pytest.raises(LimitError):
        generator.set(0.4)


def test_another_serial_number_is_another_instrument(generator, monkeypatch):
    driver = driver_of(GENERATOR)
    clock = RealClock()
    wires = Wires(clock)
    other = driver("it", "visa://GPIB0::8::INSTR", driver.Options(serial="77"), wires, clock)
    with pytest.raises(WrongInstrument, match="LSG Serial #1234"):
        other.identify()
    wires.close()
