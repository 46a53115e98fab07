"""The drivers that a bench file describes, on a SCPI server of others in another process, with VISA and without."""

from __future__ import annotations

import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from rig.drivers.clock import RealClock
from rig.drivers.errors import InstrumentError, WrongInstrument
from rig.drivers.scpi_meter import DescribedMeter
from rig.drivers.scpi_source import DescribedSource
from rig.drivers.wires import Wires

SERVER = Path(__file__).parent / "foreign_scpi.py"
KNOWN = {"maker": "STRANGER INC.", "model": "SMU 1"}
RANGE = {"prepare": ("SENS:VOLT:RANG 10",), "check": {"SENS:VOLT:RANG?": 10}}
SOURCE = {
    **KNOWN,
    "low": -10,
    "high": 30,
    "set": "SOUR:VOLT {value}",
    "setpoint": "SOUR:VOLT?",
    "read": "READ?",
    "on": "OUTP ON",
    "off": "OUTP OFF",
    "output": "OUTP?",
    "tolerance": 0.001,
    "dwell_s": 0.05,
}


@pytest.fixture(scope="module")
def port():
    server = subprocess.Popen([sys.executable, SERVER], stdout=subprocess.PIPE, text=True)
    try:
        number = int(server.stdout.readline())
        for _ in range(100):
            try:
                socket.create_connection(("127.0.0.1", number)).close()
                break
            except ConnectionRefusedError:
                time.sleep(0.05)  # noqa: TID251 - another process starts
        yield number
    finally:
        server.terminate()
        server.communicate(timeout=20)


@pytest.fixture(params=["visa://TCPIP::127.0.0.1::{port}::SOCKET", "socket://127.0.0.1:{port}"])
def make(request, port, monkeypatch):
    """Opens a driver at the server, through pyvisa-py and through pyserial."""
    monkeypatch.setenv("PYVISA_LIBRARY", "@py")
    clock = RealClock()
    wires = Wires(clock)
    yield lambda cls, **options: cls(
        "it", request.param.format(port=port), cls.Options.model_validate(options), wires, clock
    )
    wires.close()


def test_a_source_is_set_read_back_and_made_safe(make):
    source = make(DescribedSource, **SOURCE)
    assert source.identify().serial == "S123"
    source.prepare()
    assert not source.restarted()
    source.set(2.5)
    state = source.read()
    assert (state.setpoint, state.value, state.output, state.safe) == (2.5, 2.5, True, False)
    time.sleep(0.06)  # noqa: TID251 - another process
    assert source.read().settled
    source.make_safe()
    assert source.read().safe
    assert not source.read().output


def test_what_the_instrument_refuses_is_told_with_its_own_words(make):
    source = make(DescribedSource, **SOURCE)
    source.prepare()
    with pytest.raises(InstrumentError, match=r"after 'SOUR:VOLT 25.000000', reports error -222: Data out of range"):
        source.set(25.0)


def test_a_line_that_it_does_not_know_is_named(make):
    meter = make(DescribedMeter, **KNOWN, reading_s=0.02, prepare=("SENS:VOLT:NPLC 10",))
    with pytest.raises(InstrumentError, match=r"after 'SENS:VOLT:NPLC 10', reports error -110: Command header error"):
        meter.prepare()


def test_a_question_that_it_does_not_know_is_named(make):
    source = make(DescribedSource, **(SOURCE | {"read": "MEAS:CURR?", "timeout_s": 0.2}))
    source.prepare()
    with pytest.raises(InstrumentError, match=r"after 'MEAS:CURR\?', reports error -110: Command header error"):
        source.read()


def test_a_meter_reads_in_a_block_and_one_by_one(make):
    source = make(DescribedSource, **SOURCE)
    source.prepare()
    source.set(-1.5)
    block = make(DescribedMeter, **KNOWN, **RANGE, reading_s=0.02, start="SAMP:COUN {count};:INIT", fetch="FETC?")
    one_by_one = make(DescribedMeter, **KNOWN, **RANGE, reading_s=0.02)
    for meter in (block, one_by_one):
        meter.identify()
        meter.prepare()
        meter.start(3)
        assert meter.fetch() == {"input": [-1.5] * 3}
    source.make_safe()


def test_another_instrument_is_asked_for_its_identity_and_nothing_else(make):
    source = make(DescribedSource, **(SOURCE | {"model": "SMU 2"}))
    with pytest.raises(WrongInstrument, match=r"should be a STRANGER INC\. SMU 2; it answers 'STRANGER"):
        source.identify()
    assert source._talk.line.exchanges == 1
