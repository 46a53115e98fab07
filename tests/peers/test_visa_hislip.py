"""The 34401A driver as it is, over messages with device clear: pyvisa-py's HiSLIP, and a simulated meter behind it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from rig.bench.plugins import driver_class
from rig.drivers.clock import RealClock
from rig.drivers.errors import NoReply, Unreachable
from rig.drivers.wires import SerialSettings, Wires

Keysight34401A = driver_class("keysight-34401a")

SERVER = Path(__file__).parent / "hislip_server.py"


@pytest.fixture
def served():
    path = os.pathsep.join([str(SERVER.parents[1] / "support"), str(SERVER.parents[2])])
    server = subprocess.Popen(
        [sys.executable, SERVER], stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONPATH": path}
    )
    try:
        yield server, f"visa://TCPIP::127.0.0.1::hislip0,{int(server.stdout.readline())}::INSTR"
    finally:
        server.terminate()
        server.communicate(timeout=20)


@pytest.fixture
def wires(monkeypatch):
    monkeypatch.setenv("PYVISA_LIBRARY", "@py")
    sent = []
    made = Wires(RealClock(), tap=lambda _, way, data: sent.append(data) if way == "tx" else None)
    yield made, sent
    made.close()


def test_the_34401a_is_prepared_read_and_cleared(served, wires):
    made, sent = wires
    dvm = Keysight34401A("dvm", served[1], Keysight34401A.Options(nplc=0.2), made, RealClock())
    assert dvm.identify().model == "34401A"
    dvm.prepare()
    dvm.start(3)
    assert dvm.fetch() == {"input": pytest.approx([2.5] * 3, abs=1e-4)}
    dvm.start(100)
    dvm.make_safe()  # gives up a measurement, by the bus's own device clear
    dvm.start(1)
    assert dvm.fetch() == {"input": pytest.approx([2.5], abs=1e-4)}
    assert not dvm.restarted()
    assert not any(b"\x03" in data or b"SYST:REM" in data for data in sent)


def test_device_clear_takes_back_an_answer_that_is_late(served, wires):
    made, sent = wires
    line = made.serial(served[1], SerialSettings(9600, timeout_s=0.2, sync=("SYST:VERS?", "19")), "dvm")
    with pytest.raises(NoReply):
        line.query("SLOW?", repeat=False)
    assert line.query("*IDN?", 2.0).startswith("HEWLETT")
    assert line.query("*ESE?", 2.0) == "+0"
    assert sent == [b"SLOW?\n", b"SYST:VERS?\n", b"*IDN?\n", b"*ESE?\n"]


def test_an_instrument_that_goes_away_is_unreachable(served, wires):
    line = wires[0].serial(served[1], SerialSettings(9600, timeout_s=0.5), "dvm")
    line.query("*IDN?", 2.0)
    served[0].terminate()
    served[0].wait()
    with pytest.raises(Unreachable, match=r"dvm at visa://TCPIP::127.0.0.1::hislip0,\d+::INSTR was lost"):
        line.query("*IDN?")
