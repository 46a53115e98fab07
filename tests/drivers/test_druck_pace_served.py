"""The PACE driver against the twin in another process, on a serial port and on TCP; time made to run fast."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from types import SimpleNamespace

import pytest

from rig.drivers.clock import ScaledClock
from rig.drivers.druck_pace import DruckPACE
from rig.drivers.errors import DriverError
from rig.drivers.wires import Wires

SPEED = 40.0
SERVER = """
import json, pathlib, sys
from rig.sims.serve import serve
from rig.sims.twins.druck_pace import DruckPACETwin
bench, live, speed = json.loads(sys.argv[1])
serve(bench, {}, {"druck-pace": DruckPACETwin}, pathlib.Path(live), speed=speed, seconds=40.0,
      announce=lambda line: print(line, flush=True))
"""


@pytest.fixture(params=["/dev/rig/pace", "socket://192.0.2.7:5025"], ids=["serial", "tcp"])
def served(request, tmp_path):
    """A served controller: its new address, bench time and wires, and the process it lives in."""
    supply = {"driver": "druck-pace", "address": request.param, "slew_psi_per_s": 1.0, "serial": "4711"}
    bench = {"name": "served", "instruments": {"supply": supply}, "factors": {"pressure_psia": "supply"}}
    live = tmp_path / "LIVE.toml"
    server = subprocess.Popen(
        [sys.executable, "-c", SERVER, json.dumps([bench, str(live), SPEED])],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        for line in server.stdout:
            if line.startswith("serving"):
                break
        else:
            raise AssertionError(server.stderr.read())
        told = tomllib.loads(live.read_text())
        address = told["instruments"]["supply"]["address"]
        clock = ScaledClock(*(told["live"][key] for key in ("speed", "epoch_utc", "started_utc")))
        wires = Wires(clock)
        yield SimpleNamespace(address=address, clock=clock, wires=wires, server=server)
        wires.close()
    finally:
        server.kill()
        server.communicate()


def test_pressure_is_set_and_vented_across_processes(served):
    assert served.address.startswith(("/dev/pts/", "socket://127.0.0.1:"))
    options = DruckPACE.Options(slew_psi_per_s=1.0, vent_psi_per_s=2.0)
    pace = DruckPACE("supply", served.address, options, served.wires, served.clock)
    assert pace.identify().serial == "4711"
    assert pace.restarted()
    pace.prepare()
    pace.set_pressure(12.5)
    end = served.clock.now() + 120.0
    while not (state := pace.read()).in_limits and served.clock.now() < end:
        served.clock.sleep(1.0)
    assert state.in_limits
    assert state.pressure_psia == pytest.approx(12.5, abs=0.002)
    pace.close()
    assert not pace.restarted(), "a second connection finds the same instrument"
    assert pace.read().setpoint_psia == 12.5
    pace.make_safe()
    state = pace.read()
    assert not state.controlling
    assert state.pressure_psia == pytest.approx(14.696, abs=0.02)
    served.server.kill()
    served.server.wait(timeout=10.0)
    with pytest.raises(DriverError, match="supply at"):
        pace.read()
