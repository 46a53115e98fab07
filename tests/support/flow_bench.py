"""A stranger's flow bench: a valve, and a mass flow sensor whose output lags; dry runs on it."""

from __future__ import annotations

from command import rig

BENCH = """
name = "gas flow bench"
[instruments.valve]
driver = "scpi-source"
address = "socket://192.0.2.31:5025"
maker = "ROHDE&SCHWARZ"
model = "HMP2020"
asset = "DC-01"
unit = "kg_per_min"
low = 0
high = 10
set = "VOLT {value}"
decimals = 3
readback = 0.001
setpoint = "VOLT?"
on = "OUTP ON"
off = "OUTP OFF"
output = "OUTP?"
dwell_s = 5
[instruments.counter]
driver = "scpi-meter"
address = "socket://192.0.2.35:5025"
maker = "KEYSIGHT"
model = "53220A"
asset = "CNT-01"
unit = "Hz"
fetch = "READ?"
reading_s = 1
[sensors.mfs]
reader = "counter"
unit = "Hz"
[factors]
flow_kg_per_min = "valve"
[limits]
flow_kg_per_min = [0, 10]
"""
PROCEDURE = """
kind = "general"
name = "mass flow sensor"
seed = 3
replications = 3
[factors.flow_kg_per_min]
levels = [0.5, 1, 1.5, 2, 2.5, 3, 3.5]
order = "up-down"
[settle]
dwell_s = 30
[measure]
readings = 5
[model]
formula = "1 + flow_kg_per_min + flow_kg_per_min^2"
[expect]
sigma = { mfs = 0.3 }
output = { mfs = "50 + 180*flow_kg_per_min" }
"""
WORLD = """
seed = 5
[sources.flow_kg_per_min]
formula = "set"
time_constant_s = 2
[sensors.mfs]
formula = "50 + 180*flow_kg_per_min + -3*flow_kg_per_min^2"
noise = 0.1
hidden = "6*volume"
[lags.volume]
of = "flow_kg_per_min"
time_constant_s = 60
"""


def run_of(folder, name, procedure=PROCEDURE, world=WORLD):
    folder = folder / name
    folder.mkdir()
    for file, text in (("bench.toml", BENCH), ("procedure.toml", procedure), ("world.toml", world)):
        (folder / file).write_text(text)
    done = rig("run", "procedure.toml", "--bench", "bench.toml", "--dry", "--world", "world.toml", cwd=folder)
    assert done.returncode == 0, done.stderr
    (path,) = folder.glob("**/*.sqlite")
    return path
