"""Benches and procedures of kind "general" for tests: a few points, run dry."""

from __future__ import annotations

from pathlib import Path

from rig.engine.session import Signals
from rig.runs.controller import Result, start_run
from rig.runs.plans import load_plan

DVM = """
[instruments.dvm]
driver = "keysight-34401a"
address = "/dev/rig/dvm"
nplc = 1
"""
REFERENCE = """
[instruments.standard]
driver = "keysight-34401a"
address = "/dev/rig/standard"
nplc = 1
[references.force_kN]
reader = "standard"
formula = "4 * reading"
"""
PERSON = """
[instruments.operator]
driver = "person"
"""
BENCH = f"""name = "a stand"
{DVM}{PERSON}
[sensors.cell]
reader = "dvm"
[factors]
force_kN = "operator"
[limits]
force_kN = [0, 10]
"""
WORLD = """seed = 3
[sensors.cell]
formula = "0.1 + 0.5*force_kN"
noise = 1e-5
[person]
sets_s = 20
"""
WORLD_WITH_STANDARD = f"""{WORLD}
[sources.force_kN]
formula = "1.01*set"
[references.force_kN]
formula = "force_kN / 4"
"""
PROCEDURE = """kind = "general"
name = "a few weights"
seed = 1
replications = 2
[factors.force_kN]
levels = [0, 1, 2, 5]
order = "up-down"
[settle]
dwell_s = 5
[measure]
readings = 3
[model]
formula = "1 + force_kN"
"""

CHAMBER = """
[instruments.oven]
driver = "watlow-f4t"
address = "modbus-tcp://192.0.2.10:502/1"
low_degC = -60
high_degC = 100
"""
PACE = """
[instruments.supply]
driver = "druck-pace"
address = "/dev/rig/pace"
slew_psi_per_s = 0.5
high_psia = 6
"""


def written(
    folder: Path, procedure: str = PROCEDURE, bench: str = BENCH, world: str = WORLD
) -> tuple[Path, Path, Path]:
    """The three files."""
    folder.mkdir(parents=True, exist_ok=True)
    files = folder / "procedure.toml", folder / "bench.toml", folder / "world.toml"
    for path, text in zip(files, (procedure, bench, world), strict=True):
        path.write_text(text)
    return files


def run_dry(
    folder: Path, procedure: str = PROCEDURE, bench: str = BENCH, world: str = WORLD, **options: object
) -> tuple[Path, Result]:
    """Run a procedure dry; the run file, and how it ended."""
    files = written(folder, procedure, bench, world)
    plan = load_plan(files[0], files[1], dry=True, world=files[2])
    paths: list[Path] = []
    told = {"on_progress": lambda _: None, "signals": Signals(), **options}
    result = start_run(plan, folder, announce=paths.append, **told)  # type: ignore[arg-type]
    return paths[0], result


SOURCE = """name = "volts"
[instruments.calibrator]
driver = "scpi-source"
address = "socket://192.0.2.7:5025"
maker = "KEITHLEY INSTRUMENTS INC."
model = "MODEL 2400"
unit = "V"
low = -20
high = 20
prepare = ["SOUR:FUNC VOLT", "SOUR:VOLT:RANG 20"]
check = { "SOUR:FUNC?" = "VOLT", "SOUR:VOLT:RANG?" = 20 }
set = "SOUR:VOLT {value}"
decimals = 4
readback = 1e-4
setpoint = "SOUR:VOLT?"
read = "READ?"
read_off = false
on = "OUTP ON"
off = "OUTP OFF"
output = "OUTP?"
tolerance = 0.001
dwell_s = 1
[instruments.dvm]
driver = "keysight-34401a"
address = "/dev/rig/dvm"
nplc = 1
[sensors.meter]
reader = "dvm"
[factors]
input_V = "calibrator"
[limits]
input_V = [-8, 8]
"""
SOURCE_WORLD = """seed=2
[sensors.meter]
formula="1e-5 + 1.00002*input_V"
noise=1e-6
[sources.input_V]
time_constant_s = 0.3
"""
SOURCE_PROCEDURE = """kind="general"
name="volts"
replications=2
[factors.input_V]
levels=[-5,0,2,5]
[settle]
dwell_s=3
[model]
formula="1+input_V"
"""

BATH = """name = "baths"
[instruments.bath]
driver = "scpi-source"
address = "socket://192.0.2.7:5025"
maker = "ISOTECH"
model = "HYPERION"
unit = "degC"
low = -20
high = 140
set = "TEMP {value}"
decimals = 2
readback = 0.01
setpoint = "TEMP?"
read = "READ?"
on = "OUTP ON"
off = "OUTP OFF"
output = "OUTP?"
tolerance = 0.02
dwell_s = 60
[instruments.bridge]
driver = "keysight-34970a"
address = "/dev/rig/scanner"
nplc = 10
channels = { "101" = "volts", "102" = "volts", "103"="volts" }
[sensors.prt_1]
reader = "bridge"
channel = "101"
[sensors.prt_2]
reader = "bridge"
channel = "102"
unit = "mV"
[references.bath_degC]
reader = "bridge"
channel = "103"
formula = "(reading - 0.1)/0.00039"
[factors]
bath_degC = "bath"
[limits]
bath_degC = [-20, 140]
"""
BATH_WORLD = """seed=2
[sources.bath_degC]
formula = "set*1.001 - 0.03"
time_constant_s = 120
[references.bath_degC]
formula = "0.1 + 0.00039*bath_degC"
noise = 1e-7
[sensors.prt_1]
formula="0.1*(1+3.9083e-3*bath_degC-5.775e-7*bath_degC^2)"
noise=1e-7
[sensors.prt_2]
formula="100.1*(1+3.9e-3*bath_degC-5.775e-7*bath_degC^2)"
noise=1e-4
"""
BATH_PROCEDURE = """kind="general"
name="baths"
replications=2
[factors.bath_degC]
levels=[0,25,50,75,100]
hard = true
[soak]
dwell_s=600
tolerance_degC = 0.05
[model]
formula="1+bath_degC+bath_degC^2"
"""
