"""Files with CAN messages against a process of python-can and cantools, on a bus of real time."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from command import rig

HERE = Path(__file__).parent
DBC = """VERSION ""
BU_: Controller Chamber
BO_ 256 Command: 4 Controller
 SG_ Enable : 0|1@1+ (1,0) [0|1] "" Chamber
 SG_ Setpoint : 16|16@1- (0.01,0) [-80|200] "degC" Chamber
BO_ 512 State: 8 Chamber
 SG_ Mode : 0|2@1+ (1,0) [0|3] "" Controller
 SG_ Arrived : 2|1@1+ (1,0) [0|1] "" Controller
 SG_ Alarm : 8|8@1+ (1,0) [0|255] "" Controller
 SG_ Setpoint : 16|16@1- (0.01,0) [-80|200] "degC" Controller
 SG_ Actual : 47|16@0- (0.01,0) [-80|200] "degC" Controller
BO_ 513 Product: 8 Chamber
 SG_ Type : 0|8@1+ (1,0) [0|255] "" Controller
 SG_ Serial : 16|32@1+ (1,0) [0|0] "" Controller
BO_ 2566834709 Probe: 8 Chamber
 SG_ Group M : 0|4@1+ (1,0) [0|15] "" Controller
 SG_ Count : 8|8@1+ (1,0) [0|255] "" Controller
 SG_ Temperature m0 : 23|24@0- (0.001,0) [-200|300] "\u00b0C" Controller
 SG_ Quality m0 : 47|4@0+ (1,0) [0|15] "" Controller
 SG_ Supply m1 : 31|32@0- (1,0) [0|0] "V" Controller
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_ "GenMsgCycleTime" BO_ 512 50;
BA_ "GenMsgCycleTime" BO_ 2566834709 50;
SIG_VALTYPE_ 2566834709 Supply : 1;
VAL_ 512 Mode 0 "Idle" 1 "Running" ;
VAL_ 513 Type 7 "Chamber C7" ;
VAL_ 2566834709 Quality 0 "valid" 1 "settling" ;
"""
CHAMBER = """
maker = "ACME"
model = "C7"
healthy = [{ ask = "State.Alarm", is = 0 }]
[wire]
protocol = "can"
dbc = "chamber.dbc"
cyclic = { Command = 0.1 }
[identity]
ask = "Product.Type"
is = "Chamber C7"
serial = "Product.Serial"
[source]
unit = "degC"
low = -70
high = 180
set = "Command: Setpoint = {value}"
setpoint = "State.Setpoint"
read = "State.Actual"
on = "Command: Enable = 1"
off = "Command: Enable = 0"
output = { ask = "State.Mode", words = { Idle = "off", Running = "on" } }
settled = "State.Arrived"
"""
PROBE = """
maker = "ACME"
model = "P1"
words = { valid = "stable", settling = "busy" }
[wire]
protocol = "can"
dbc = "chamber.dbc"
counter = "Count"
[identity]
ask = "Probe.Count"
[reader]
unit = "degC"
again_s = 0.01
[reader.channels]
air = { reading = { ask = "Probe.Temperature", status = "Probe.Quality" } }
supply = { unit = "V", reading = "Probe.Supply" }
"""


@pytest.fixture
def address(tmp_path: Path) -> Iterator[str]:
    (tmp_path / "chamber.dbc").write_bytes(DBC.encode("cp1252"))  # as most programs write it
    (tmp_path / "chamber.toml").write_text(CHAMBER)
    (tmp_path / "probe.toml").write_text(PROBE)
    group = f"239.74.{os.getpid() % 250 + 1}.{os.getpid() // 250 % 250 + 1}"
    peer = subprocess.Popen([sys.executable, HERE / "foreign_can.py", group, tmp_path / "chamber.dbc", "60"])
    yield f"can:udp_multicast/{group}"
    peer.kill()
    peer.wait()


def test_a_foreign_chamber_is_set_kept_and_made_safe_and_a_foreign_probe_read(tmp_path: Path, address: str) -> None:
    done = rig(
        *("instrument", "check", "chamber.toml", "--address", address, "--set", "35", "--wait", "30", "--json"),
        cwd=tmp_path,
    )
    assert done.returncode == 0, (done.stdout[-3000:], done.stderr)
    steps = {one["what"]: one["found"] for one in json.loads(done.stdout)[0]["steps"]}
    assert steps["identity"] == "ACME C7, serial number 4711, firmware not told"
    assert "it reads 3" in steps["settle"]
    assert "off, not settled" in steps["safe state"]
    done = rig("instrument", "check", "probe.toml", "--address", address, "--json", cwd=tmp_path)
    assert done.returncode == 0, (done.stdout[-3000:], done.stderr)
    steps = {one["what"]: one["found"] for one in json.loads(done.stdout)[0]["steps"]}
    found = steps["three readings of each channel"]
    assert found.count("4.98") == 3
    assert found.endswith("V")
